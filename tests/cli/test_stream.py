"""The stream: same records and state however rows arrive, through stops, kills, bad rows and changes."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from datetime import datetime, timedelta

import numpy as np
import pandas as pd
import pytest
from click.testing import CliRunner

from tests.streaming.recorded_stream import QUICK, ROOT, carried, records, stream, write
from whsklearn import RLSRegressor
from whsklearn.change import ChangeAlarm
from whsklearn.checks import state_difference
from whsklearn.cli.job import Ended
from whsklearn.cli.stream import head_of
from whsklearn.cli.stream import main as stream_command
from whsklearn.datasets import make_servo_log
from whsklearn.effects import Coulomb
from whsklearn.logs.units import respelled
from whsklearn.streaming import Options, StreamMonitor
from whsklearn.streaming.rows import CsvParser


def test_estimates_and_predictions_come_at_their_rows(undisturbed, rows):
    estimates = records(undisturbed / "out.jsonl", "estimate")
    assert [r["row"] for r in estimates] == [500, 1000, 1500, 2000, 2500]
    assert estimates[-1]["time"] == pytest.approx(24.99)
    assert estimates[-1]["parameters"]["coulomb"] == pytest.approx(0.7, abs=0.05)
    assert estimates[-1]["innovation_rmse"] < 0.15
    predictions = records(undisturbed / "out.jsonl", "prediction")
    assert [r["row"] for r in predictions] == list(range(1, 2601))
    assert predictions[0]["y_hat"] is None
    errors = np.array([r["y"] - r["y_hat"] for r in predictions[1500:]])
    assert np.sqrt(np.mean(errors**2)) < 0.15
    assert records(undisturbed / "out.jsonl", "bad_row") == []


def test_json_lines_on_stdin_are_the_same_stream(tmp_path, undisturbed, rows):
    lines = [json.dumps(dict(zip("tuy", map(float, row.split(",")), strict=True))) for row in rows]
    kept = tmp_path / "kept.whs"
    process = subprocess.run(
        [sys.executable, "-m", "pipelines.stream", "-", *QUICK, "--checkpoint", str(kept)],
        input="\n".join(lines), cwd=ROOT, capture_output=True, text=True, check=True,
    )  # fmt: skip
    estimates = [json.loads(line) for line in process.stdout.splitlines()]
    assert estimates == records(undisturbed / "out.jsonl", "estimate")
    assert state_difference(carried(kept), carried(undisturbed / "log.csv.whs")) == 0.0


def test_the_run_is_recorded(mlflow_root, rows):
    import mlflow

    log = write(mlflow_root / "log.csv", rows[:1100])
    args = [a for a in QUICK if a != "--no-track"]
    done = stream(log, "--out", mlflow_root / "out.jsonl", *args)
    assert done.exit_code == 0, done.output
    client = mlflow.MlflowClient(os.environ["MLFLOW_TRACKING_URI"])
    (run,) = client.search_runs([client.get_experiment_by_name("stream").experiment_id])
    path = client.get_metric_history(run.info.run_id, "path/coulomb")
    assert [(m.step, m.value) for m in path] == [
        (r["row"], r["parameters"]["coulomb"]) for r in records(mlflow_root / "out.jsonl", "estimate")
    ]


@pytest.mark.parametrize(
    ("change", "said", "status"),
    [
        (["--input", "torque"], "The header has no column 'torque'", 2),
        (["--law", "nonsense"], "Unknown effect 'nonsense'", 2),
        (["--law", "nonsense", "--input", "u_nm", "--output", "y_rad"], "Unknown effect 'nonsense'", 2),
        (["--time", "nope", "--input", "u_nm", "--output", "y_rad"], "The header has no column 'nope'", 2),
        (["--checkpoint", "log.csv"], "are the same file", 2),
        (["--p", "0"], "'--p': 0 is not in the range x>=1", 2),
    ],
)
def test_impossible_requests_are_one_sentence(tmp_path, rows, change, said, status):
    log = write(tmp_path / "log.csv", rows[:50])
    if "y_rad" in change:
        log.write_text(log.read_text().replace("t,u,y", "t,u_nm,y_rad"))
    done = stream(log, "--no-track", *[log if word == "log.csv" else word for word in change])
    assert done.exit_code == status
    assert said in done.stderr
    assert "Traceback" not in done.stderr


def test_a_picture_is_no_log_without_columns(tmp_path):
    picture = tmp_path / "plot.csv"
    picture.write_bytes(b"\x89PNG\r\n\x1a\n" + bytes(range(256)))
    done = stream(picture, "--no-track")
    assert done.exit_code == 3
    assert "plot.csv is a picture" in done.stderr


def test_a_log_none_of_whose_lines_is_a_row_cannot_be_used_and_says_so_in_few_lines(tmp_path):
    log = write(tmp_path / "log.csv", [f"{0.01 * i},off,{i}\n" for i in range(1200)])
    done = stream(log, "--no-track", "--out", tmp_path / "out.jsonl")
    assert done.exit_code == 3, done.output
    assert "None of the 1200 lines" in done.stderr
    assert done.stderr.count("skipped") == 10
    assert len(records(tmp_path / "out.jsonl", "bad_row")) == 10


@pytest.mark.parametrize("text", ["", "t,u,y\n"])
def test_a_source_without_rows_cannot_be_used(tmp_path, text):
    (tmp_path / "log.csv").write_text(text)
    done = stream(tmp_path / "log.csv", "--no-track")
    assert done.exit_code == 3
    assert "log.csv holds no rows." in done.stderr


def test_bad_rows_in_a_row_are_counted_in_one_record(tmp_path, rows):
    spoilt = [r if not 200 <= i < 260 else r.replace(",", ",x", 1) for i, r in enumerate(rows[:400])]
    log = write(tmp_path / "log.csv", spoilt)
    assert stream(log, "--no-track", "--time", "t", "--out", tmp_path / "out.jsonl").exit_code == 0
    bad = records(tmp_path / "out.jsonl", "bad_row")
    assert [r["line"] for r in bad] == [*range(202, 212), 261]
    assert [r.get("rows", 1) for r in bad] == [1] * 10 + [50]
    for block in (1, 7, 400):  # however the rows arrive
        told = []
        monitor = StreamMonitor(RLSRegressor(), ChangeAlarm(), Options(timed=True, every=100), told.append)
        lines, parse = [s.encode() for s in spoilt], CsvParser(b"t,u,y", ["t", "u", "y"])
        for at in range(0, len(lines), block):
            monitor.feed(lines[at : at + block], parse, at + 2)
        assert [{k: v for k, v in r.items() if k != "row"} for r in told if r["kind"] == "bad_row"] == [
            {k: v for k, v in r.items() if k != "row"} for r in bad
        ]


def test_a_zone_behind_the_date_may_change(tmp_path, rows):
    start = datetime(2026, 10, 25, 2, 59, 58)
    stamps = [start + timedelta(seconds=0.01 * i) - timedelta(hours=i >= 200) for i in range(600)]
    lines = [
        f"{t.isoformat(' ', 'milliseconds')} {'CET' if i >= 200 else 'CEST'},{row.split(',', 1)[1]}"
        for i, (t, row) in enumerate(zip(stamps, rows, strict=False))
    ]
    log = write(tmp_path / "log.csv", lines)
    assert stream(log, "--no-track", "--time", "t", "--out", tmp_path / "out.jsonl").exit_code == 0
    assert records(tmp_path / "out.jsonl", "bad_row") == []
    assert [r["cause"] for r in records(tmp_path / "out.jsonl", "alarm")] == ["clock_restart"]


def test_rows_sent_again_and_again_are_said_a_few_times(tmp_path, rows):
    log = write(tmp_path / "log.csv", [row for row in rows[:150] for _ in range(2)])
    done = stream(log, "--no-track", "--time", "t", "--out", tmp_path / "out.jsonl")
    assert done.exit_code == 0, done.output
    assert done.stderr.count("was sent before") == 11
    assert sum(r["cause"] == "repeated_rows" for r in records(tmp_path / "out.jsonl", "alarm")) == 150


def test_a_start_with_a_wrong_column_does_not_bind_the_next_one(tmp_path):
    log = tmp_path / "log.csv"
    log.write_text("torque_nm,speed\n" + "".join(f"{i % 7},{2 * (i % 7)}\n" for i in range(300)))
    run = [str(log), "--no-track", "--estimator", "rls", "--output", "speed"]
    assert CliRunner().invoke(stream_command, [*run, "--input", "torque"]).exit_code == 2
    assert list(tmp_path.iterdir()) == [log]  # nor does it write anything
    twice = CliRunner().invoke(stream_command, [str(log), "--no-track", "--input", "speed", "--output", "speed"])
    assert twice.exit_code == 2
    assert "expected a different one for each role" in twice.output
    done = CliRunner().invoke(stream_command, [*run, "--input", "torque_nm"])
    assert done.exit_code == 0, done.output


def test_json_lines_in_a_file_are_sent_to_stdin(tmp_path):
    log = tmp_path / "log.jsonl"
    log.write_text('{"u": 1.0, "y": 2.0}\n')
    done = CliRunner().invoke(stream_command, [str(log), "--no-track"])
    assert done.exit_code == 3
    assert "whsklearn stream - <" in done.output


def test_a_stream_of_several_inputs_names_the_numbers_of_each(tmp_path):
    X = np.random.default_rng(0).normal(size=(300, 2))
    y = np.r_[0.0, 0.0, X[:-2] @ [1.0, 0.5]]
    log = tmp_path / "log.csv"
    log.write_text("u1,u2,y\n" + "".join(f"{a},{b},{c}\n" for (a, b), c in zip(X, y, strict=True)))
    several = ["--input", "u1", "--input", "u2", "--orders", "1,0,1,0", "--law", "linear"]
    done = stream(log, "--no-track", *several, "--every", "300", "--out", tmp_path / "out.jsonl")
    assert done.exit_code == 0, done.output
    (estimate,) = records(tmp_path / "out.jsonl", "estimate")
    assert estimate["parameters"]["a1_2"] == pytest.approx(0.5, abs=0.01)


@pytest.fixture(scope="module")
def changing_axis():
    """The log of an axis at 250 Hz whose Coulomb friction is raised by two thirds in the middle."""
    parts = [
        make_servo_log([Coulomb(0.2)] if k else (), duration=72.0, sample_rate=250.0, random_state=k) for k in (0, 1)
    ]
    log = pd.concat(parts, ignore_index=True).rename(columns={"time_s": "time", "torque_nm": "torque_Nm"})
    log["time"] = np.arange(len(log)) / 250.0 + np.repeat([0.0, 1.0], len(parts[0]))
    return log[["time", "torque_Nm", "position_rad"]]


@pytest.mark.parametrize("names", [("torque_Nm", "position_rad"), ("torque", "position")])
def test_a_drive_and_a_position_are_an_axis_whose_change_is_found_and_named(tmp_path, changing_axis, names):
    log = tmp_path / "axis.csv"
    changing_axis.set_axis(["time", *names], axis=1).to_csv(log, index=False)
    args = ["--no-track", "--time", "time", "--input", names[0], "--output", names[1], "--out", tmp_path / "out.jsonl"]
    done = stream(log, *args)
    assert done.exit_code == 0, done.output
    assert "an axis, whose inertia and friction are estimated at 250 Hz; --orders takes them for a chain" in done.stderr
    assert "A change is told from 24 s of motion on" in done.stderr
    told = [r for r in records(tmp_path / "out.jsonl") if r["kind"] in ("alarm", "change")]
    alarms = [r["row"] for r in told if r.get("cause") == "change"]
    assert len(alarms) == 1, told
    assert 18_000 < alarms[0] < 20_000
    assert [c.split()[:2] for r in told if r["kind"] == "change" for c in r["changes"]] == [["coulomb", "rose"]]
    assert ("Coulomb rose" in done.stderr) == (names[0] == "torque_Nm")  # the comparison needs units


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="there are no named pipes")
def test_a_pipe_that_is_given_as_a_file_is_refused_at_once(tmp_path):
    """Its first rows are read for their rate, and it was waited for."""
    os.mkfifo(tmp_path / "axis.csv")
    done = stream(tmp_path / "axis.csv", "--no-track")
    assert done.exit_code == 3
    assert "axis.csv is a pipe or a device, which cannot be read twice; send JSON lines to stdin" in done.output
    assert list(tmp_path.iterdir()) == [tmp_path / "axis.csv"]


def test_an_axis_goes_on_from_its_checkpoint(tmp_path, changing_axis):
    whole, part = tmp_path / "whole.csv", tmp_path / "part.csv"
    changing_axis.head(3000).to_csv(whole, index=False)
    changing_axis.head(1234).to_csv(part, index=False)
    args = ["--no-track", "--time", "time", "--input", "torque_Nm", "--output", "position_rad", "--every", "500"]
    assert stream(whole, *args, "--out", tmp_path / "whole.jsonl").exit_code == 0
    for _ in range(2):
        assert stream(part, *args, "--out", tmp_path / "part.jsonl").exit_code == 0
        part.write_bytes(whole.read_bytes())
    assert (tmp_path / "part.jsonl").read_bytes() == (tmp_path / "whole.jsonl").read_bytes()
    assert state_difference(carried(f"{part}.whs"), carried(f"{whole}.whs")) == 0.0


@pytest.mark.parametrize("where", ["in names", "below names"])
def test_an_estimate_states_the_units_of_its_numbers(tmp_path, changing_axis, where):
    """Of stamps that count ms since 1970, too; they were taken for seconds, and an inertia came out a million times."""
    table, found = changing_axis.head(2500), []
    mend, below = (" [mNm]", " [deg]"), ""
    if where == "below names":
        mend, below = ("", ""), ",mNm,deg\n"
    for k, (drive, by, position, far) in enumerate(
        [("torque_Nm", 1.0, "position_rad", 1.0), (f"torque{mend[0]}", 1e-3, f"position{mend[1]}", np.radians(1.0))]
    ):
        time = np.round(1e3 * table["time"]).astype("int64") + 1_700_000_000_000 if k else table["time"]
        columns = {"time": time, drive: table["torque_Nm"] / by, position: table["position_rad"] / far}
        rows = pd.DataFrame(columns).to_csv(index=False).replace("\n", f"\n{below * k}", 1)
        (tmp_path / f"{k}.csv").write_text(rows)
        args = ["--no-track", "--time", "time", "--input", drive, "--output", position, "--every", "2500"]
        assert stream(tmp_path / f"{k}.csv", *args, "--out", tmp_path / f"{k}.jsonl").exit_code == 0
        found.append(records(tmp_path / f"{k}.jsonl", "estimate")[-1])
    assert found[0]["units"]["inertia"] == "kg m²"
    assert found[1]["units"]["inertia"] == "mNm s²/deg"
    assert found[0]["units"].keys() == found[0]["parameters"].keys()
    for name, unit in found[0]["units"].items():
        factor, own = respelled(unit.replace("kg m²", "Nm s²/rad"), {"Nm": "mNm", "rad": "deg"})
        assert found[1]["units"][name] == own
        (value, error), other = (found[0][k][name] for k in ("parameters", "standard_errors")), found[1]["parameters"]
        assert other[name] * factor == pytest.approx(value, abs=1e-4 * error)  # P(0) is one number in any unit


def test_what_a_stream_cannot_take_for_an_axis_is_told(tmp_path, changing_axis):
    log = tmp_path / "axis.csv"
    changing_axis.head(600).to_csv(log, index=False)
    args = ["--no-track", "--fresh", "--out", tmp_path / "out.jsonl"]
    swapped = stream(log, *args, "--input", "position_rad", "--output", "torque_Nm", "--time", "time")
    assert swapped.exit_code == 2
    assert "--input is position_rad, a position, and --output torque_Nm, a drive; exchange them" in swapped.output
    columns = ["--input", "torque_Nm", "--output", "position_rad"]
    assert "without --time or --rate they are taken for a chain" in stream(log, *args, *columns).stderr
    assert "an axis" in stream(log, *args, *columns, "--rate", "250").stderr
    assert "an axis" not in stream(log, *args, *columns, "--time", "time", "--orders", "2,1,1,1").stderr
    other = stream(log, *args, *columns, "--time", "time", "--rate", "500")
    assert other.exit_code == 2
    assert "--rate is 500 Hz, and time of the first rows shows 250; leave out --rate" in other.output
    changing_axis.head(600).rename(columns={"position_rad": "speed_rpm"}).to_csv(log, index=False)
    velocity = [*args, "--input", "torque_Nm", "--output", "speed_rpm", "--time", "time"]
    assert "speed_rpm is a velocity, so the columns are taken for a chain" in stream(log, *velocity).stderr
    assert "is a velocity" not in stream(log, *velocity, "--orders", "2,1,1,1").stderr
    changing_axis.head(1).to_csv(log, index=False)
    short = stream(log, *args, *columns, "--time", "time")
    assert short.exit_code == 2
    assert (
        "does not show its sample rate by time of three rows in order; sort them, or give --rate HZ too" in short.output
    )


@pytest.mark.parametrize("forgetting", ["2", "0", "nan"])
def test_a_forgetting_factor_that_is_none_is_a_wrong_option(tmp_path, forgetting):
    done = stream(write(tmp_path / "log.csv", ["0,1,2\n"]), "--no-track", "--forgetting", forgetting)
    assert done.exit_code == 2
    assert "--forgetting" in done.output


def test_a_rate_is_given_instead_of_a_time(tmp_path):
    log = write(tmp_path / "log.csv", ["0,1,2\n"])
    done = stream(log, "--no-track", "--time", "t", "--rate", "100")
    assert done.exit_code == 2
    assert "--time or --rate" in done.output


@pytest.mark.parametrize("asked_by", [KeyboardInterrupt, Ended])
def test_a_stop_before_the_first_row_is_one_that_was_asked_for(tmp_path, rows, monkeypatch, asked_by):
    """SIGTERM while libraries are imported."""

    def stopped(*args):
        raise asked_by

    monkeypatch.setattr("whsklearn.cli.stream.axis_stream", stopped)
    done = stream(write(tmp_path / "log.csv", rows[:50]), "--no-track")
    assert done.exit_code == 0
    assert done.stderr == "Stopped before the first row; nothing was read.\n"


# --- what a source's first rows say of an axis -----------------------------------------------------------------------
@pytest.mark.parametrize(
    ("time", "stamps"),
    [
        ("time_s", ["0", "0.002", "0.004", "0.006"]),
        ("t_ms", ["0", "2", "4", "6"]),
        ("time_s", ["0,000", "0,002", "0,004", "0,006"]),
        ("stamp", [f"2026-01-01T00:00:00.00{k}Z" for k in (0, 2, 4, 6)]),
        ("time_s", ["0", "0.002", "0.004", "0.5", "0.502"]),
        ("t_ms", ["0", "2", "2", "4", "4", "6"]),
    ],
    ids=["seconds", "milliseconds", "decimal comma", "dates", "a pause", "rows that share a stamp"],
)
def test_the_usual_step_is_that_of_the_time_in_any_form(tmp_path, time, stamps):
    log = tmp_path / "log.csv"
    log.write_text(f"{time};q\n" + "".join(f"{t};1\n" for t in stamps))
    names, step, _ = head_of(str(log), time)
    assert names == [time, "q"]
    assert step == pytest.approx(0.002)


@pytest.mark.parametrize("rate", [400.0, 667.0, 800.0])
def test_stamps_in_whole_milliseconds_tell_the_rate_of_the_rows(tmp_path, rate):
    """The median of 2, 3, 2, 3 ms is 3 ms; an inertia had come out by the square of that too large."""
    log = tmp_path / "log.csv"
    log.write_text("t_ms,q\n" + "".join(f"{round(1e3 * k / rate)},1\n" for k in range(1000)))
    assert head_of(str(log), "t_ms")[1] == pytest.approx(1.0 / rate, rel=0.005)


@pytest.mark.parametrize("rows", ["", "t,q\n", "t,q\n0,1\n1,1\n", "t,q\n5,1\n5,1\n5,1\n"])
def test_a_source_that_shows_no_step_has_none(tmp_path, rows):
    log = tmp_path / "log.csv"
    log.write_text(rows)
    assert head_of(str(log), "t")[1] is None
    assert head_of("-", "t") == ([], None, {})


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (b"", "holds no rows"),
        (b"time_s,torque_nm,position_rad\n", "holds no rows"),
        ("time_s,torque_nm,position_rad\n0,1,2\n".encode("utf-16"), "is not text in UTF-8"),
        (b"\x8f\x00\xfe\x01\n\x00\x02", "is not text in UTF-8"),
        (b"time_s,torque,position_rad\n0,1,2\n", "no column 'torque_nm'; it has: time_s, torque, position_rad"),
        (b"time_s,torque_nm,position_rad\n0,1,2\n", "does not show its sample rate"),
    ],
    ids=["empty", "a header", "UTF-16", "binary", "another column", "one row"],
)
def test_a_file_that_is_no_log_is_told_as_what_it_is(tmp_path, content, says):
    source = tmp_path / "log.csv"
    source.write_bytes(content)
    columns = ("--input", "torque_nm", "--output", "position_rad", "--time", "time_s")
    done = CliRunner().invoke(stream_command, [str(source), *columns, "--no-track"])
    assert done.exit_code != 0
    assert says in done.output
