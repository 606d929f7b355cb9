"""Finished axes of a fleet: kept beside the table, and taken up again only where nothing has changed."""

from __future__ import annotations

import pandas as pd
import pytest

from tests.cli.fleet_folder import write_axis
from whsklearn.cli.fleet_axis import digest_of
from whsklearn.cli.fleet_kept import Kept, write_table


@pytest.fixture
def folder(tmp_path):
    home = tmp_path / "logs"
    home.mkdir()
    for k in range(2):
        write_axis(home, f"a{k}", 0.7, seed=k)
    return home


def row(folder, name, **more):
    return {"axis": name, "digest": digest_of(folder, "axis", name), "nmse": 0.1} | more


def test_rows_are_taken_up_again_and_a_missing_column_stays_missing(folder, tmp_path):
    kept = Kept(tmp_path / "t.parquet", "p=1", folder, "axis")
    rows = [row(folder, "a0", b1=1.5), row(folder, "a1")]
    kept.add(rows)
    assert not kept.path.exists()  # written every half minute
    kept.write()
    again = Kept(tmp_path / "t.parquet", "p=1", folder, "axis")
    assert again.rows(["a0", "a1"]) == rows
    again.remove()
    assert again.rows(["a0"]) == []


def test_an_axis_whose_files_changed_is_done_anew(folder, tmp_path):
    kept = Kept(tmp_path / "t.parquet", "p=1", folder, "axis")
    kept.add([row(folder, "a0"), row(folder, "a1")])
    kept.write()
    file = next((folder / "axis=a1").glob("*.parquet"))
    pd.read_parquet(file).iloc[:-50].to_parquet(file, index=False)
    assert [r["axis"] for r in Kept(tmp_path / "t.parquet", "p=1", folder, "axis").rows(["a0", "a1"])] == ["a0"]


def _add_and_stop(kept, row):
    kept.add([row])
    raise KeyboardInterrupt


def test_an_error_keeps_what_is_finished_and_says_where(folder, tmp_path, capsys):
    kept = Kept(tmp_path / "t.parquet", "p=1", folder, "axis")
    with pytest.raises(KeyboardInterrupt), kept:
        _add_and_stop(kept, row(folder, "a0"))
    assert len(pd.read_parquet(kept.path)) == 1
    assert "1 axis is kept in" in capsys.readouterr().err
    again = Kept(tmp_path / "t.parquet", "p=1", folder, "axis")
    again.rows(["a0", "a1"])
    with pytest.raises(KeyboardInterrupt), again:
        raise KeyboardInterrupt
    assert "1 axis is kept in" in capsys.readouterr().err  # of before, though nothing was added


def test_nothing_is_said_to_be_kept_where_nothing_was_finished(folder, tmp_path, capsys):
    kept = Kept(tmp_path / "t.parquet", "p=1", folder, "axis")
    with pytest.raises(KeyboardInterrupt), kept:
        raise KeyboardInterrupt
    assert not kept.path.exists()
    assert capsys.readouterr().err == "Stopped before the first axes were finished: nothing is kept.\n"


def test_a_table_is_written_in_one_step(tmp_path):
    table = pd.DataFrame({"axis": ["a"], "nmse": [0.1]})
    write_table(table, tmp_path / "t.parquet")
    pd.testing.assert_frame_equal(pd.read_parquet(tmp_path / "t.parquet"), table)
    assert [p.name for p in tmp_path.iterdir()] == ["t.parquet"]
