"""A stream among hostile files, clocks and servers: nothing of the user's is lost, and nothing is learnt twice."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from click.testing import CliRunner

from tests.streaming.short_stream import QUICK, carried, rows, run, write
from whsklearn.cli.stream import main
from whsklearn.streaming import monitor as stream_loop
from whsklearn.streaming import service as stream_job


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


def test_a_log_without_a_line_feed_is_refused(tmp_path):
    log = tmp_path / "log.csv"
    log.write_bytes("".join(rows(50)).replace("\n", "\r").encode())
    done = run(log)
    assert done.exit_code == 3
    assert "has no complete line; a stream reads lines that end with LF or CR LF" in done.stderr


@pytest.mark.parametrize("follower", [None, rows(5, first=900)], ids=["gone", "replaced"])
def test_a_log_that_is_moved_away_while_it_is_read_is_read_to_its_end(tmp_path, monkeypatch, follower):
    """The checkpoint is that of the log that was read, also where the next one has its name already."""
    log, aside, feed = write(tmp_path / "log.csv", rows(300)), tmp_path / "log.csv.1", stream_loop.StreamMonitor.feed
    run(log)
    calm = carried(tmp_path / "log.csv.whs")

    def moved(*args):
        if not aside.exists():
            log.rename(aside)
            if follower:
                write(log, follower)
        return feed(*args)

    with monkeypatch.context() as patched:
        patched.setattr(stream_loop.StreamMonitor, "feed", moved)
        done = run(log, "--fresh")
    assert done.exit_code == 0, done.output
    assert carried(tmp_path / "log.csv.whs") == calm
    aside.replace(log)
    assert run(log).exit_code == 0  # it is the log that the checkpoint knows


def test_what_cannot_be_written_is_said_before_the_first_row(tmp_path):
    log = write(tmp_path / "log.csv", rows(50))
    for option in ("--out", "--checkpoint"):
        done = run(log, option, tmp_path / "none" / "file")
        assert done.exit_code == 1
        assert "does not exist" in done.stderr


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


def test_lost_rows_are_told_ten_times_and_change_nothing_else(tmp_path):
    lines = [line for i, line in enumerate(rows(400)) if i % 20 not in (10, 11, 12)]
    log = write(tmp_path / "log.csv", lines)
    assert run(log, "--out", tmp_path / "out.jsonl").exit_code == 0
    records = [json.loads(line) for line in (tmp_path / "out.jsonl").read_text().splitlines()]
    alarms = [r for r in records if r["kind"] == "alarm"]
    assert [r["cause"] for r in alarms] == ["pause"] * 10
    assert "a pause of 4 usual steps" in alarms[0]["reason"]
    assert carried(tmp_path / "log.csv.whs")["rows"] == len(lines)


@pytest.mark.parametrize("step", [1.0, 3.0])
def test_a_pause_is_told_also_where_a_new_experiment_begins(tmp_path, step):
    """Two seconds without rows."""
    lines = [line for i, line in enumerate(rows(400)) if not 100 <= i < 300]
    done = run(write(tmp_path / "log.csv", lines), "--out", tmp_path / "out.jsonl", "--max-step", step)
    assert done.exit_code == 0
    records = [json.loads(line) for line in (tmp_path / "out.jsonl").read_text().splitlines()]
    [alarm] = [r for r in records if r["kind"] == "alarm"]
    assert (alarm["cause"], alarm["row"]) == ("pause", 100)
    assert ("a new experiment begins" in alarm["reason"]) == (step < 2.0)
    assert ("taken as neighbours" in alarm["reason"]) == (step > 2.0)
    assert carried(tmp_path / "log.csv.whs")["experiment"] == (step < 2.0)


def test_rows_given_up_are_taken_again_and_none_is_lost(tmp_path, monkeypatch):
    log = write(tmp_path / "log.csv", rows(300))
    whole = tmp_path / "whole.jsonl"
    assert run(log, "--out", whole, "--checkpoint", tmp_path / "whole.whs").exit_code == 0
    feed = stream_loop.StreamMonitor.feed
    calls = []

    def slow(self, block, parse, number):
        calls.append(number)
        if len(calls) == 3:
            feed(self, block[:10], parse, number)
            raise stream_job.Late
        return feed(self, block, parse, number)

    out = tmp_path / "out.jsonl"
    monkeypatch.setattr(stream_loop.StreamMonitor, "feed", slow)
    first = run(log, "--out", out, "--checkpoint-every", "0")
    assert first.exit_code == 0
    assert "abandoned" in first.stderr
    monkeypatch.setattr(stream_loop.StreamMonitor, "feed", feed)
    assert run(log, "--out", out).exit_code == 0
    assert out.read_text() == whole.read_text()


def test_a_stream_without_a_server_goes_on(tmp_path, monkeypatch):
    monkeypatch.setenv("MLFLOW_TRACKING_URI", "http://127.0.0.1:9")
    log = write(tmp_path / "log.csv", rows(150))
    done = CliRunner().invoke(main, [str(log), *[a for a in QUICK if a != "--no-track"]])
    assert done.exit_code == 0, done.output
    assert "The record in MLflow is incomplete" in done.stderr
    assert "did not reach the record" in done.stderr
    assert carried(Path(f"{log}.whs"))["rows"] == 150
