"""A fleet: every axis has its row, whatever fails or dies on the way, and the odd ones are named."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import time
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from click.testing import CliRunner
from sklearn.base import BaseEstimator, RegressorMixin

from tests.cli.fleet_folder import MODEL, source, write_axis
from whsklearn import ServoAxis
from whsklearn.cli.fleet import Kept, main, run_here, run_on_cluster, summary, to_table, write_table
from whsklearn.cli.fleet_axis import axes_of, digest_of, identify_axes, outliers
from whsklearn.cli.options import build_model
from whsklearn.datasets import make_servo_log
from whsklearn.effects import Coulomb, Viscous

LEAST_SQUARES = {"estimator": "rls", "orders": (2, 2, 2, 2), "law": "reduced", "p": 4, "forgetting": 1.0, "seed": 0}

pytest.importorskip("pyarrow", reason="needs the extra parquet")
QUICK = ["--no-track", "--estimator", "rls", "--in-process", "--workers", "1", "--time", "t"]


def identified(model, folder):
    """What a worker does with the names of some axes."""
    return partial(identify_axes, model, source=source(folder), test_share=0.25)


def test_the_job_writes_one_row_an_axis_and_names_the_odd_ones(fleet, tmp_path):
    out = tmp_path / "fleet.parquet"
    done = CliRunner().invoke(main, [str(fleet), "--out", str(out), *QUICK])
    assert done.exit_code == 3, done.output  # the table is whole, and an axis failed
    table = pd.read_parquet(out)
    assert list(table["axis"]) == axes_of(fleet, "axis")
    good = table[table["axis"] != "broken"]
    assert (good["failure"] == "").all()
    assert (good["rows"] == 600).all()
    assert good["nmse"].max() < 0.05
    assert good.set_index("axis").loc["ax05", "coulomb"] == pytest.approx(1.4, abs=0.25)
    assert "cannot be read" in table.set_index("axis").loc["broken", "failure"]
    assert "ax05" in set(outliers(table)["axis"])
    assert "broken" not in set(outliers(table)["axis"])
    assert "broken: part-0.parquet cannot be read" in " ".join(done.output.split())


def test_a_drive_and_a_position_are_servo_axes_whose_worn_one_is_named(tmp_path):
    rng, logs = np.random.default_rng(0), tmp_path / "logs"
    for i in range(8):
        friction = [Viscous(0.12), Coulomb(0.45 if i == 4 else 0.3 * (1.0 + 0.02 * rng.standard_normal()))]
        axis = ServoAxis(inertia=0.05 * (1.0 + 0.02 * rng.standard_normal()), law=friction)
        frame = make_servo_log(axis=axis, duration=4.0, random_state=i)
        frame["position_deg"] = np.degrees(frame["position_rad"])
        (logs / f"axis=ax{i}").mkdir(parents=True)
        frame.to_parquet(logs / f"axis=ax{i}" / "part.parquet")
    columns = ["--input", "torque_nm", "--output", "position_deg"]
    args = [str(logs), "--out", str(tmp_path / "fleet.parquet"), "--no-track", "--in-process", "--workers", "1"]
    done = CliRunner().invoke(main, [*args, *columns, "--time", "time_s"])
    assert done.exit_code == 0, done.output
    assert "torque_nm and position_deg are those of servo axes, with numbers in Nm and deg" in done.output
    table = pd.read_parquet(tmp_path / "fleet.parquet").set_index("axis")
    assert table["inertia"].median() == pytest.approx(np.radians(0.05), rel=1e-2)
    assert table.loc["ax4", "coulomb"] == pytest.approx(0.45, rel=5e-3)
    assert table["input_delay"].median() == pytest.approx(0.5e-3, abs=0.1e-3)  # the drive is held over a sample
    assert table["nmse"].max() < 3e-3  # of the drive; 0.027 against the samples at which the rows end
    assert outliers(table.reset_index())["axis"].tolist() == ["ax4"]
    timeless = CliRunner().invoke(main, [*args, *columns])
    assert timeless.exit_code == 2
    assert "give --time, or --orders for a chain" in " ".join(timeless.output.split())
    turned = CliRunner().invoke(main, [*args, "--input", "position_deg", "--output", "torque_nm", "--time", "time_s"])
    assert "exchange them" in turned.output


def test_the_fleet_is_recorded_with_a_child_for_each_outlier(fleet, mlflow_root):
    import mlflow

    args = [a for a in QUICK if a != "--no-track"]
    done = CliRunner().invoke(main, [str(fleet), "--out", str(mlflow_root / "fleet.parquet"), *args])
    assert done.exit_code == 3, done.output
    client = mlflow.MlflowClient(os.environ["MLFLOW_TRACKING_URI"])
    runs = client.search_runs([client.get_experiment_by_name("fleet").experiment_id])
    (parent,) = [r for r in runs if "mlflow.parentRunId" not in r.data.tags]
    children = {r.info.run_name for r in runs if r is not parent}
    assert {"axis ax05", "axis broken"} <= children
    assert parent.data.metrics["failed"] == 1.0
    assert parent.data.metrics["outliers"] == len(children) - 1


def test_a_fleet_that_is_stopped_keeps_what_is_finished_and_goes_on_from_there(fleet, tmp_path, monkeypatch):
    out, given = tmp_path / "fleet.parquet", []

    def here(work, batches, workers):
        for names in batches:
            if given and stops:
                os.kill(os.getpid(), signal.SIGTERM)
            given.extend(names)
            yield work(names)

    monkeypatch.setattr("whsklearn.cli.fleet.run_here", here)
    arguments = [str(fleet), "--out", str(out), "--batch", "4", *QUICK]
    stops = True
    stopped = CliRunner().invoke(main, arguments)
    assert stopped.exit_code == 143, stopped.output
    assert "4 axes are kept" in stopped.output
    assert not out.exists()
    assert len(pd.read_parquet(tmp_path / "fleet.parquet.part")) == 4
    first, stops = list(given), False
    os.utime(next((fleet / f"axis={first[0]}").glob("*.parquet")))  # whose log is another one now
    given.clear()
    done = CliRunner().invoke(main, arguments)
    assert done.exit_code == 3, done.output
    assert "Resuming: 3 of 9 axes" in done.output
    assert sorted(given) == sorted({first[0], *axes_of(fleet, "axis")} - set(first[1:]))
    assert [p.name for p in tmp_path.iterdir()] == ["fleet.parquet"]
    at_once = to_table(identify_axes(build_model(LEAST_SQUARES), axes_of(fleet, "axis"),
                                     source(fleet), 0.25), axes_of(fleet, "axis"))  # fmt: skip
    pd.testing.assert_frame_equal(pd.read_parquet(out).drop(columns="seconds"), at_once.drop(columns="seconds"))


@pytest.mark.slow
def test_a_real_process_that_gets_sigterm_leaves_its_workers_and_resumes(fleet, tmp_path):
    """The log of one axis is a pipe that nobody writes to, so its worker is busy when the signal comes."""
    folder = shutil.copytree(fleet, tmp_path / "logs")
    out, pipe = tmp_path / "fleet.parquet", folder / "axis=zz" / "part-0.parquet"
    pipe.parent.mkdir()
    os.mkfifo(pipe)
    script = "from whsklearn.cli import fleet; fleet.EVERY_SECONDS = 0.0; fleet.main()"
    arguments = [str(folder), "--out", str(out), "--batch", "1", *QUICK, "--workers", "2"]
    with subprocess.Popen([sys.executable, "-c", script, *arguments], stderr=subprocess.PIPE, text=True) as process:
        while process.poll() is None and not Path(f"{out}.part").exists():
            time.sleep(0.1)
        process.send_signal(signal.SIGTERM)
        said = process.communicate(timeout=60)[1]
    assert process.returncode == 143, said
    kept = pd.read_parquet(f"{out}.part")
    assert f"{len(kept)} ax" in said
    assert "Traceback" not in said
    assert "leaked" not in said
    assert not out.exists()
    pipe.unlink()
    pipe.write_text("no log")
    done = CliRunner().invoke(main, [*arguments[:-1], "1", "--in-process"])  # other workers, the same settings
    assert done.exit_code == 3, done.output
    assert f"Resuming: {len(kept)} of 10 axes" in done.output
    assert list(pd.read_parquet(out)["axis"]) == axes_of(folder, "axis")


def test_what_is_kept_of_other_settings_is_not_taken(fleet, tmp_path):
    row = {"axis": "ax00", "rows": 1, "failure": "", "digest": digest_of(fleet, "axis", "ax00")}
    kept = Kept(tmp_path / "t", "p=4", fleet, "axis")
    kept.add([row])
    kept.write()
    assert Kept(tmp_path / "t", "p=4", fleet, "axis").rows(["ax00", "ax01"]) == [row]
    assert Kept(tmp_path / "t", "p=8", fleet, "axis").rows(["ax00", "ax01"]) == []
    kept.path.write_text("no table")
    assert Kept(tmp_path / "t", "p=4", fleet, "axis").rows(["ax00"]) == []


def test_failures_do_not_crowd_outliers_out_and_no_reason_is_cut():
    reason = "part-0.parquet cannot be read: " + "a long reason with many words " * 8
    names = [f"ax{i:03d}" for i in range(300)]
    rng = np.random.default_rng(0)
    rows = [
        {"axis": n, "rows": 9, "failure": "" if i < 150 else reason + "end", "seconds": 0.1}
        | ({"nmse": 0.01, "coulomb": 9.0 if i == 7 else rng.normal(1.0, 0.1)} if i < 150 else {})
        for i, n in enumerate(names)
    ]
    found = to_table(rows, names)
    text = summary(found, outliers(found), found[found["failure"] != ""], Path("fleet.parquet"), 1.0)
    assert "ax007: NMSE 0.01; coulomb +" in text
    assert "and 140 more: part-0.parquet" in " ".join(text.split())
    assert " ".join(text.split()).endswith(reason + "end")
    assert max(map(len, text.splitlines())) <= 100
    assert len(text.splitlines()) < 15  # one reason, once


def test_processes_and_one_process_give_the_same(fleet):
    names = axes_of(fleet, "axis")[:4]
    alone = to_table(identify_axes(MODEL, names, source(fleet), 0.25), names)
    batches = [names[:1], names[1:]]
    shared = to_table([r for rows in run_here(identified(MODEL, fleet), batches, 2) for r in rows], names)
    pd.testing.assert_frame_equal(alone.drop(columns="seconds"), shared.drop(columns="seconds"))


class DiesOnce(RegressorMixin, BaseEstimator):
    """Kills its own worker process the first time that it is fitted anywhere."""

    def __init__(self, mark=""):
        self.mark = mark

    def fit(self, X, y):
        try:
            Path(self.mark).touch(exist_ok=False)
        except FileExistsError:
            time.sleep(0.1)
        else:
            os.kill(os.getpid(), signal.SIGKILL)
        self.parameters_ = {"gain": float(X[:, 0] @ y / (X[:, 0] @ X[:, 0]))}
        return self

    def predict(self, X):
        return self.parameters_["gain"] * X[:, 0]


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::ResourceWarning", "ignore::pytest.PytestUnraisableExceptionWarning")
def test_a_worker_that_is_killed_loses_no_axis(fleet, tmp_path):
    pytest.importorskip("distributed", reason="needs the extra dask")
    names = [n for n in axes_of(fleet, "axis") if n != "broken"]
    batches = [names[i : i + 2] for i in range(0, len(names), 2)]
    model = DiesOnce(str(tmp_path / "died"))
    rows = [r for done in run_on_cluster(identified(model, fleet), batches, 1, None) for r in done]
    assert (tmp_path / "died").exists()
    table = to_table(rows, names)
    assert list(table["axis"]) == names
    assert (table["failure"] == "").all()


def test_a_cluster_that_is_not_there_is_told_with_what_to_do(fleet, tmp_path, monkeypatch):
    pytest.importorskip("distributed", reason="needs the extra dask")
    monkeypatch.setattr("whsklearn.cli.job.ANSWERS", 1.0)
    asked = [str(fleet), "--no-track", "--estimator", "rls", "--out", str(tmp_path / "t.parquet")]
    done = CliRunner().invoke(main, [*asked, "--scheduler", "tcp://127.0.0.1:9"])
    assert done.exit_code == 1
    assert "does not answer; start it, or omit --scheduler" in done.output
    monkeypatch.setitem(sys.modules, "distributed", None)
    assert "pip install 'whsklearn[dask]'" in CliRunner().invoke(main, asked).output


def test_a_lost_axis_does_not_go_unnoticed():
    with pytest.raises(ValueError, match="1 axes returned no result, the first is b"):
        to_table([{"axis": "a", "rows": 1, "failure": "", "seconds": 0.1}], ["a", "b"])


def test_a_folder_without_axes_is_refused(tmp_path):
    done = CliRunner().invoke(main, [str(tmp_path), *QUICK])
    assert done.exit_code == 1
    assert "holds no folder axis=NAME" in done.stderr


# --- finished axes: kept beside the table, and taken up again only where nothing has changed --------------------------
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
    again.path.unlink()
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
