"""A tracking server that is killed, stopped or slow in mid-run: commands end, and their report is on the disk.

All commands lose one real server at the same time, each behind a door of its own (`benchmarks.interruptions.Door`).
`python -m benchmarks.interruptions --deaths` ends the server itself, with full-sized logs.
"""

from __future__ import annotations

import sqlite3
from concurrent.futures import ThreadPoolExecutor

import pytest

from benchmarks.interruptions import AT, AT_RUN, COMMANDS, DEATHS, OTHERS, Door, Server, death, material

pytest.importorskip("mlflow", reason="needs the extra mlflow")
pytestmark = [
    pytest.mark.timeout(600),
    # connections that a killed server leaves behind close when they are collected
    pytest.mark.filterwarnings("ignore::ResourceWarning", "ignore::pytest.PytestUnraisableExceptionWarning"),
]
AT_ONCE = 4


@pytest.fixture(scope="module")
def server(tmp_path_factory, migrated_database):
    server = Server(tmp_path_factory.mktemp("server"), migrated_database)
    yield server
    server.close()


def endings(server, cases, folder):
    """How each (command, death) ended, several at a time: they wait most of it."""

    def one(case):
        name, how = case
        own = folder / f"{name} {how}"
        own.mkdir()
        material(own, duration=5.0, axes=1, rate=250.0)
        if name == "identify":  # too short for the fit of a chain, which is two thirds of the command
            log = (own / "axis.csv").read_text().splitlines(keepends=True)
            (own / "axis.csv").write_text("".join(log[:281]))
        door = Door(server, how, AT.get(name, AT_RUN))
        try:
            return death(name, door, own)
        finally:
            door.close()

    with ThreadPoolExecutor(AT_ONCE) as pool:
        return dict(zip(cases, pool.map(one, cases), strict=True))


@pytest.mark.slow
def test_on_a_server_that_lives_every_run_is_finished(server, tmp_path):
    found = endings(server, [("fleet", "alive")], tmp_path)  # a run with children
    assert {case: e.faults("alive") for case, e in found.items() if e.faults("alive")} == {}
    with sqlite3.connect(server.store) as database:
        runs = database.execute("select status from runs").fetchall()
    assert {status for (status,) in runs} == {"FINISHED"}


@pytest.mark.slow
def test_every_command_outlives_its_server(server, tmp_path, monkeypatch):
    monkeypatch.setitem(COMMANDS, "tune", ["tune", "--samples", "300", "--p", "1"])  # of the benchmark, but shorter
    # every command loses its server once, and every way of losing it is met; each takes a process of seconds.  `demo`
    # is two of them in turn, at full length: what it hands on is in tests/cli/test_demo.py
    cases = [("gap", "stopped, then SIGTERM"), ("identify", "killed"), ("fleet", "slow"), ("tune", "stopped")]
    cases += [("ui", "stopped, then SIGTERM"), ("compare", "killed"), ("stream", "killed")]
    assert {name for name, _ in cases} >= set(COMMANDS) - {"demo"}
    assert {how for _, how in cases} == set(DEATHS)
    found = endings(server, cases, tmp_path)
    wrong = {case: (f, e.said) for case, e in found.items() if (f := e.faults(case[1]))}
    assert not wrong, "\n".join(f"{case}: {faults}\n{said[-500:]}" for case, (faults, said) in wrong.items())
    assert all(e.lost for e in found.values())
    for (name, how), e in found.items():
        if name != "stream" and not how.endswith("SIGTERM"):
            assert e.said.count("cannot be") + e.said.count("does not answer") == 1, (name, how, e.said)


@pytest.mark.slow
def test_what_opens_no_run_asks_no_server(server, tmp_path):
    found = endings(server, [(name, "stopped") for name in OTHERS if name != "ui"], tmp_path)
    assert {case: e.faults("stopped") for case, e in found.items() if e.faults("stopped")} == {}
    assert not any(e.lost for e in found.values())
