"""A real tracking server that is killed, stopped or slow in mid-run: commands end, and their report is on the disk.

`python -m benchmarks.interruptions --deaths` does it with every command and every death, and with full-sized logs.
"""

from __future__ import annotations

import sqlite3
from pathlib import Path

import numpy as np
import pytest

from benchmarks.interruptions import ALLOWED, COMMANDS, REPORTS, Server, death
from whsklearn.datasets import make_servo_log

pytest.importorskip("mlflow", reason="needs the extra mlflow")
pytestmark = [
    pytest.mark.timeout(900),
    # connections that a killed server leaves behind close when they are collected
    pytest.mark.filterwarnings("ignore::ResourceWarning", "ignore::pytest.PytestUnraisableExceptionWarning"),
]
LOADED = 2.0  # times ALLOWED on a machine that does more than this; MLflow itself waits for more than 600 s


def material(folder: Path) -> None:
    """A short servo log as a file, and a fleet of one."""
    folder.mkdir()
    frame = make_servo_log([], duration=5.0, random_state=0)[::2]
    frame["velocity_rad_s"] = np.gradient(frame["position_rad"], frame["time_s"])
    frame.to_csv(folder / "axis.csv", index=False)
    home = folder / "logs" / "axis=joint"
    home.mkdir(parents=True)
    frame.to_parquet(home / "part.parquet", index=False)


def ended(server: Server, name: str, how: str, folder: Path) -> tuple[int, str]:
    """Exit status and what was said, of a command that ended in time with its report on the disk and no traceback."""
    material(folder)
    _, after, code, said = death(server, name, COMMANDS[name], how, folder)
    assert after < LOADED * ALLOWED, (name, how, said)
    assert name not in REPORTS or how.endswith("SIGTERM") or (folder / REPORTS[name]).exists(), (name, how, said)
    assert "Traceback" not in said
    return code, said


def test_gap_ends_whatever_becomes_of_its_server(tmp_path, migrated_database):
    server = Server(tmp_path, migrated_database)
    try:
        assert ended(server, "gap", "alive", tmp_path / "alive")[0] == 0
        with sqlite3.connect(server.store) as database:
            runs = database.execute("select status from runs").fetchall()
        assert runs
        assert {status for (status,) in runs} == {"FINISHED"}
        server.forget()
        for how in ("stopped", "slow", "killed"):
            code, said = ended(server, "gap", how, tmp_path / how)
            assert code == 1
            assert said.count("cannot be written (") == 1
            server.forget()
    finally:
        server.close()


def test_every_other_command_ends_when_its_server_is_stopped(tmp_path, migrated_database):
    server = Server(tmp_path, migrated_database)
    try:
        for name in ("identify", "fleet", "tune"):
            code, said = ended(server, name, "stopped", tmp_path / name)
            assert code == 1, said
            assert said.count("cannot be") + said.count("does not answer") == 1, said
            server.forget()
        assert ended(server, "gap", "stopped, then SIGTERM", tmp_path / "gap")[0] == 143
    finally:
        server.close()
