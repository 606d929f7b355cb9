"""A stream among hostile files, clocks and servers: nothing of the user's is lost, and nothing is learnt twice."""

from __future__ import annotations

import json
import os
import signal
import time
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from filelock import FileLock

from whsklearn.cli import stream_job, stream_loop
from whsklearn.cli.stream import main
from whsklearn.cli.stream_clock import Clock
from whsklearn.cli.stream_out import Out, OutputLost
from whsklearn.state import read_state
from whsklearn.tracking import BesideRun, TrackingError

QUICK = ["--no-track", "--time", "t", "--p", "1", "--every", "100", "--estimator", "rls"]


def rows(n, first=0):
    rng = np.random.default_rng(first)
    u = rng.normal(size=n)
    return [f"{0.01 * (first + i):.2f},{a:.9g},{0.5 * a:.9g}\n" for i, a in enumerate(u)]


def write(path, lines):
    path.write_text("t,u,y\n" + "".join(lines))
    return path


def run(log, *args):
    return CliRunner().invoke(main, [str(log), *map(str, args), *QUICK])


def carried(path):
    return read_state(path, "stream")[1]["carried"]


# -- files -----------------------------------------------------------------------------------


@pytest.mark.parametrize("option", ["--out", "--checkpoint"])
@pytest.mark.parametrize("link", [False, True])
def test_the_source_is_never_written_to(tmp_path, option, link):
    log = write(tmp_path / "log.csv", rows(50))
    other = tmp_path / "link" if link else log
    if link:
        other.symlink_to(log)
    before = log.read_bytes()
    done = run(log, option, other, "--fresh")
    assert done.exit_code == 1
    assert "are one file" in done.stderr
    assert log.read_bytes() == before


def test_records_and_checkpoint_are_two_files(tmp_path):
    log = write(tmp_path / "log.csv", rows(50))
    assert "are one file" in run(log, "--out", tmp_path / "a", "--checkpoint", tmp_path / "a").stderr
    assert not (tmp_path / "a").exists()


@pytest.mark.parametrize("fresh", [["--fresh"], []])
@pytest.mark.parametrize("option", ["--out", "--checkpoint"])
def test_a_file_that_is_not_ours_stays(tmp_path, option, fresh):
    log, diary = write(tmp_path / "log.csv", rows(50)), tmp_path / "diary.txt"
    diary.write_text("years of work\n")
    done = run(log, option, diary, *fresh)
    assert done.exit_code == 1
    assert "diary.txt" in done.stderr
    assert diary.read_text() == "years of work\n"


def test_two_streams_on_one_checkpoint(tmp_path):
    log = write(tmp_path / "log.csv", rows(50))
    with FileLock(tmp_path / ".log.csv.whs.lock"):
        done = run(log)
    assert done.exit_code == 1
    assert "in use by another stream" in done.stderr
    assert run(log).exit_code == 0


def test_a_longer_file_in_the_place_of_the_source_is_noticed(tmp_path):
    log = write(tmp_path / "log.csv", rows(50))
    assert run(log).exit_code == 0
    write(log, rows(90, first=7))
    assert "not the file that the checkpoint was written for" in run(log).stderr
    assert carried(tmp_path / "log.csv.whs")["rows"] == 50


def test_half_a_row_at_the_end_waits_until_it_is_whole(tmp_path):
    lines = rows(51)
    log = write(tmp_path / "log.csv", [*lines[:50], lines[50][:-4]])
    done = run(log)
    assert "has no end" in done.stderr
    assert carried(tmp_path / "log.csv.whs")["rows"] == 50
    write(log, lines)
    run(log)
    assert carried(tmp_path / "log.csv.whs")["rows"] == 51
    assert carried(tmp_path / "log.csv.whs")["last"] == [float(v) for v in lines[50].split(",")]


def test_what_cannot_be_written_is_said_before_the_first_row(tmp_path):
    log = write(tmp_path / "log.csv", rows(50))
    for option in ("--out", "--checkpoint"):
        done = run(log, option, tmp_path / "none" / "file")
        assert done.exit_code == 1
        assert "does not exist" in done.stderr


def full(*args):
    raise OSError(28, "No space left on device")


def test_a_full_disk_leaves_the_stream_without_a_checkpoint_or_ends_it(tmp_path, monkeypatch):
    log = write(tmp_path / "log.csv", rows(300))
    monkeypatch.setattr("whsklearn.cli.stream_job.write_state", full)
    done = run(log, "--out", tmp_path / "out.jsonl")
    assert done.exit_code == 0
    assert "log.csv.whs cannot be written (No space left on device); the stream goes on without it" in done.stderr
    assert (tmp_path / "out.jsonl").read_text().count('"estimate"') == 3
    done = run(log, "--disk-full", "stop")
    assert done.exit_code == 1
    assert "log.csv.whs cannot be written" in done.stderr


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="no /dev/full")
def test_records_that_find_no_room_are_an_error_with_the_files_name(tmp_path):
    out = Out(tmp_path / "out", None)
    out.file.close()
    out.file = open("/dev/full", "ab", buffering=0)
    out({"kind": "estimate"})
    with pytest.raises(OutputLost, match="out cannot be written"):
        out.settle()
    out.close()


# -- the clock -------------------------------------------------------------------------------


def verdicts(times, values=None):
    clock, found = Clock(), []
    for line, now in enumerate(times):
        value = line if values is None else values[line]
        found += [(v.what, v.line) for v in clock.take(line, [now, float(value)])]
    return found


def lines_of(found, what):
    return [line for kind, line in found if kind == what]


@pytest.mark.parametrize("stamp", [1e9, 30.0, -1e9, 0.0, 3.5])
def test_one_wrong_stamp_is_one_bad_row(stamp):
    times = [float(i) for i in range(20)]
    times[8] = stamp
    found = verdicts(times)
    assert lines_of(found, "bad") == [8]
    assert lines_of(found, "row") == [i for i in range(20) if i != 8]


def test_a_clock_that_restarts_begins_a_new_experiment_and_loses_no_row():
    found = verdicts([float(i) for i in range(20)] + [float(i) for i in range(15)])
    assert lines_of(found, "row") == list(range(35))
    assert lines_of(found, "restart") == [20]
    assert lines_of(found, "bad") == []


@pytest.mark.parametrize("again", [range(20), range(12, 20), range(19, 20)])
def test_rows_sent_again_are_passed_over(again):
    order = [*range(20), *again, *range(20, 25)]
    found = verdicts([float(i) for i in order], order)
    assert lines_of(found, "row") == [*range(20), *range(20 + len(again), 25 + len(again))]
    assert len(lines_of(found, "repeated")) == len(again)


def test_a_pause_is_no_fault_and_rows_out_of_order_are_put_right():
    found = verdicts([*map(float, range(10)), *map(float, range(500, 510))])
    assert [kind for kind, _ in found] == ["row"] * 20
    assert lines_of(verdicts([0.0, 1.0, 2.0, 3.0, 4.0, 6.0, 5.0, 7.0, 8.0]), "row") == [0, 1, 2, 3, 4, 6, 5, 7, 8]


def test_each_case_raises_an_alarm_that_names_it(tmp_path):
    lines = rows(400)
    spoilt = [*lines[:100], "1e9," + lines[100].split(",", 1)[1], *lines[101:200], *lines[150:300]]
    spoilt += ["x\n"] * 30 + rows(60, first=0)[:60]
    log = write(tmp_path / "log.csv", [*spoilt[:-60], *[f"{0.01 * i:.2f},{i},{i}\n" for i in range(60)]])
    done = run(log, "--out", tmp_path / "out.jsonl")
    assert done.exit_code == 0, done.output
    records = [json.loads(line) for line in (tmp_path / "out.jsonl").read_text().splitlines()]
    causes = [r["cause"] for r in records if r["kind"] == "alarm"]
    assert causes == ["clock_outlier", "repeated_rows", "held_rows", "clock_restart"]
    state = carried(tmp_path / "log.csv.whs")
    assert state["rows"] == 300 + 10 + 60  # one held for the outlier, ten of thirty, and the new experiment
    assert state["repeated"] == 50


# -- the record ------------------------------------------------------------------------------


def test_a_server_that_hangs_costs_no_time_and_what_is_lost_is_counted():
    said = []

    def hang():
        time.sleep(30)

    began = time.monotonic()
    import whsklearn.tracking.beside as beside

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(beside, "OPEN_SECONDS", 0.1)
        patch.setattr(beside, "WAITING", 50)
        run = BesideRun(hang, "one", say=said.append)
        for step in range(100):
            run.log_metrics({"nmse": 1.0}, step)
        assert run.close(beside.HURRIED_SECONDS) == 100
    assert time.monotonic() - began < 2.0
    assert len(said) == 1


def test_rows_that_take_long_are_given_up_soon_after_a_signal(monkeypatch):
    monkeypatch.setattr(stream_job, "GRACE_SECONDS", 0.2)
    stopper = stream_job.Stopper()
    try:
        began = time.monotonic()
        with pytest.raises(stream_job.Late):  # noqa: PT012 - the signal comes in the midst
            os.kill(os.getpid(), signal.SIGTERM)
            while time.monotonic() - began < 10:
                sum(range(100))
        assert stopper.by == "SIGTERM"
        assert time.monotonic() - began < 2.0
    finally:
        stopper.restore()
    assert signal.getitimer(signal.ITIMER_REAL)[0] == 0.0


def test_rows_given_up_are_taken_again_and_none_is_lost(tmp_path, monkeypatch):
    log = write(tmp_path / "log.csv", rows(300))
    whole = tmp_path / "whole.jsonl"
    assert run(log, "--out", whole, "--checkpoint", tmp_path / "whole.whs").exit_code == 0
    feed = stream_loop.Stream.feed
    calls = []

    def slow(self, block, parse, number):
        calls.append(number)
        if len(calls) == 3:
            feed(self, block[:10], parse, number)
            raise stream_job.Late
        return feed(self, block, parse, number)

    out = tmp_path / "out.jsonl"
    monkeypatch.setattr(stream_loop.Stream, "feed", slow)
    first = run(log, "--out", out, "--checkpoint-every", "0")
    assert first.exit_code == 0
    assert "given up" in first.stderr
    monkeypatch.setattr(stream_loop.Stream, "feed", feed)
    assert run(log, "--out", out).exit_code == 0
    assert out.read_text() == whole.read_text()


class Flaky:
    """A tracker whose first writes fail."""

    id = "1"

    def __init__(self):
        self.held, self.written, self.fails = [], [], 2

    def run(self, name, tags=None):
        from contextlib import nullcontext

        return nullcontext(self)

    def log_params(self, params):
        pass

    def log_metrics(self, metrics, step):
        self.held.append(step)

    def flush(self):
        self.fails -= 1
        if self.fails >= 0:
            raise TrackingError("locked")
        self.written, self.held = self.written + self.held, []


def test_metrics_arrive_later_when_the_server_is_back(monkeypatch):
    monkeypatch.setattr("whsklearn.tracking.beside.POLL_SECONDS", 0.05)
    tracker, said = Flaky(), []
    run = BesideRun(lambda: tracker, "one", say=said.append)
    for step in range(20):
        run.log_metrics({"nmse": 1.0}, step)
    time.sleep(0.5)
    assert run.close() == 0
    assert tracker.written == list(range(20))
    assert len(said) == 1


def test_a_stream_without_a_server_goes_on(tmp_path, monkeypatch):
    monkeypatch.setenv("MLFLOW_TRACKING_URI", "http://127.0.0.1:9")
    log = write(tmp_path / "log.csv", rows(150))
    done = CliRunner().invoke(main, [str(log), *[a for a in QUICK if a != "--no-track"]])
    assert done.exit_code == 0, done.output
    assert "The record in MLflow has gaps" in done.stderr
    assert "did not reach the record" in done.stderr
    assert carried(Path(f"{log}.whs"))["rows"] == 150
