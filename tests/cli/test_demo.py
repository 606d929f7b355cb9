"""The demonstration: two commands in a row, and a log that is written for the second."""

from __future__ import annotations

import contextlib
import sys
from types import SimpleNamespace

import click
import numpy as np
import pandas as pd
import pytest
from click.testing import CliRunner

from whsklearn.cli import demo, gap, simulated_example
from whsklearn.cli.job import RecordLost
from whsklearn.datasets import make_servo_log


@pytest.fixture
def called(monkeypatch):
    """What each command was called with, in turn."""
    calls = []

    def stands_for(name):
        return click.command()(lambda **options: calls.append((name, options)))

    for module in (simulated_example, gap):
        monkeypatch.setattr(module, "main", stands_for(module.__name__.rpartition(".")[2]))
    monkeypatch.setattr(demo, "compiled_beside", contextlib.nullcontext)
    return calls


def test_the_commands_run_in_turn_and_hand_on_seed_record_and_log(called, tmp_path):
    out = tmp_path / "new" / "reports"
    done = CliRunner().invoke(demo.main, ["--seed", "7", "--no-track", "--out", str(out)], catch_exceptions=False)
    assert done.exit_code == 0
    assert [name for name, _ in called] == ["simulated_example", "gap"]
    options = dict(called)
    assert all(o["seed"] == 7 for o in options.values())
    assert options["simulated_example"]["track"] is options["gap"]["track"] is False
    assert options["gap"]["log_file"] == str(out / "hidden.csv")
    assert len(pd.read_csv(out / "hidden.csv")) == 40_000
    assert f"to {out / 'hidden.csv'}; hidden in it: cogging." in done.output
    assert str(out / "gap") == options["gap"]["report"]
    assert str(out / "gap" / "gap.html") in done.output
    assert out.is_dir()


def test_a_folder_that_cannot_be_written_is_one_sentence_before_any_work(called, tmp_path):
    (tmp_path / "file").write_text("")
    done = CliRunner().invoke(demo.main, ["--out", str(tmp_path / "file" / "reports")])
    assert done.exit_code == 1
    assert done.output.startswith("Error: Cannot write to")
    assert called == []


def test_a_log_that_could_not_be_written_is_told_before_it_is_looked_for(called, tmp_path):
    (tmp_path / "hidden.csv").mkdir()
    done = CliRunner().invoke(demo.main, ["--out", str(tmp_path)])
    assert done.exit_code == 1
    assert "hidden.csv" in done.output.splitlines()[-1]
    assert [name for name, _ in called] == ["simulated_example"]


def test_where_the_first_part_fails_no_log_is_written(called, monkeypatch, tmp_path):
    monkeypatch.setattr(simulated_example, "main", click.command()(lambda **_: (_ for _ in ()).throw(click.Abort())))
    done = CliRunner().invoke(demo.main, ["--out", str(tmp_path)])
    assert done.exit_code == 1
    assert called == []
    assert not (tmp_path / "hidden.csv").exists()


def test_a_record_that_is_lost_in_the_first_part_leaves_the_report_of_the_second(called, monkeypatch, tmp_path):
    def loses_its_server(**_):
        raise RecordLost("The record cannot be written.")

    monkeypatch.setattr(simulated_example, "main", click.command()(loses_its_server))
    done = CliRunner().invoke(demo.main, ["--out", str(tmp_path)])
    assert [(name, options["track"]) for name, options in called] == [("gap", False)]
    assert done.exit_code == 1
    assert done.output.endswith("Error: The record cannot be written.\n")


@pytest.mark.parametrize(("kept", "cores"), [(False, 2), (True, 2), (False, 1)])
def test_what_is_not_compiled_is_compiled_beside_on_a_second_core_until_the_end(monkeypatch, kept, cores):
    said = []

    def started(arguments, **_):
        said.append("begun")
        assert arguments[:2] == [sys.executable, "-c"]
        compile(arguments[2], "a program", "exec")
        return SimpleNamespace(terminate=lambda: said.append("ended"), wait=lambda: said.append("gone"))

    monkeypatch.setattr("whsklearn.systems.servo.is_compiled", lambda: kept)
    monkeypatch.setattr("joblib.cpu_count", lambda: cores)
    monkeypatch.setattr(demo.subprocess, "Popen", started)
    work = demo.compiled_beside()(lambda: said.append("work") or sys.exit(1))
    with pytest.raises(SystemExit):
        work()
    beside = not kept and cores > 1
    assert said == (["begun", "work", "ended", "gone"] if beside else ["work"])


# --- the log --------------------------------------------------------------------------------------------------
def written(folder, *options):
    out = folder / "new" / "log.csv"
    done = CliRunner().invoke(demo.hidden_effect, ["--duration", "5", "--out", str(out), *options])
    assert done.exit_code == 0, done.output
    return pd.read_csv(out)


def test_a_seed_is_a_log_and_the_effect_is_in_it(tmp_path):
    plain, same = (written(tmp_path, "--effect", "none", "--seed", "3") for _ in range(2))
    pd.testing.assert_frame_equal(plain, same)
    hidden = written(tmp_path, "--effect", "cogging", "--size", "0.2", "--seed", "3")
    assert list(hidden.columns) == list(plain.columns)
    wanted = make_servo_log("cogging", sizes=0.2, duration=5.0, random_state=3)
    np.testing.assert_allclose(hidden.torque_nm, wanted.torque_nm)
    assert np.abs(hidden.torque_nm - plain.torque_nm).max() > 0.01


def test_an_unknown_effect_is_one_sentence(tmp_path):
    done = CliRunner().invoke(demo.hidden_effect, ["--effect", "magic", "--out", str(tmp_path / "log.csv")])
    assert done.exit_code == 1
    assert "Unknown effect 'magic'" in done.output
    assert not (tmp_path / "log.csv").exists()
