"""A stream that is stopped, killed and begun again ends as one that nothing disturbed."""

from __future__ import annotations

import os
import signal
import time

import numpy as np
import pytest

from tests.streaming import short_stream as short
from tests.streaming.recorded_stream import KILLS, QUICK, carried, records, start, stream, wait_for, write
from whsklearn.checks import state_difference
from whsklearn.streaming import service as stream_job


def full(*args):
    raise OSError(28, "No space left on device")


def test_a_full_disk_leaves_the_stream_without_a_checkpoint_or_ends_it(tmp_path, monkeypatch):
    log = short.write(tmp_path / "log.csv", short.rows(300))
    monkeypatch.setattr("whsklearn.streaming.service.write_state", full)
    done = short.run(log, "--out", tmp_path / "out.jsonl")
    assert done.exit_code == 0
    assert "log.csv.whs cannot be written (No space left on device); the stream continues without it" in done.stderr
    assert (tmp_path / "out.jsonl").read_text().count('"estimate"') == 3
    assert "so a restarted stream begins at the first row." in done.stderr
    assert "resumes from" not in done.stderr
    done = short.run(log, "--disk-full", "stop")
    assert done.exit_code == 1
    assert "log.csv.whs cannot be written" in done.stderr


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


def test_a_stream_in_two_sittings_ends_as_in_one(tmp_path, undisturbed, rows):
    log = write(tmp_path / "log.csv", rows[:1234])
    for part in (rows[1234:], []):
        done = stream(log, "--out", tmp_path / "out.jsonl", "--predictions", *QUICK)
        assert done.exit_code == 0, done.output
        with open(log, "a") as file:
            file.writelines(part)
    assert "Resuming after row 1234" in done.stderr
    assert (tmp_path / "out.jsonl").read_bytes() == (undisturbed / "out.jsonl").read_bytes()
    assert state_difference(carried(tmp_path / "log.csv.whs"), carried(undisturbed / "log.csv.whs")) == 0.0


def test_killed_at_random_moments_it_goes_on_to_the_same_end(tmp_path, undisturbed, rows):
    log, out, kept = write(tmp_path / "log.csv", rows), tmp_path / "out.jsonl", tmp_path / "log.csv.whs"
    rng = np.random.default_rng(0)
    for _ in range(KILLS):
        before = kept.stat().st_mtime_ns if kept.exists() else 0
        process = start(log, out, "--predictions", "--checkpoint-every", "0", "--follow")
        wait_for(lambda before=before: kept.exists() and kept.stat().st_mtime_ns > before, process)
        time.sleep(rng.uniform(0, 0.3))
        process.kill()
        process.communicate()
    assert stream(log, "--out", out, "--predictions", *QUICK).exit_code == 0
    assert out.read_bytes() == (undisturbed / "out.jsonl").read_bytes()
    assert state_difference(carried(kept), carried(undisturbed / "log.csv.whs")) == 0.0


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_followed_file_is_taken_as_it_grows_and_a_signal_loses_nothing(tmp_path, rows, number):
    log, out = write(tmp_path / "log.csv", rows[:600]), tmp_path / "out.jsonl"
    process = start(log, out, "--follow", "--checkpoint-every", "0")
    kept = tmp_path / "log.csv.whs"
    wait_for(lambda: kept.exists() and carried(kept)["carried"]["rows"] == 600, process)
    with open(log, "a") as file:
        file.writelines([*rows[600:1100], rows[1100][:5]])  # the last line is not whole yet
    wait_for(lambda: carried(kept)["carried"]["rows"] == 1100, process)
    process.send_signal(number)
    _, said = process.communicate(timeout=30)
    assert process.returncode == 0
    assert f"Stopped by {number.name} after row 1100" in said
    assert [r["row"] for r in records(out, "estimate")] == [500, 1000]


def test_a_checkpoint_of_columns_in_other_units_is_refused_with_both_units(tmp_path):
    kept = tmp_path / "axis.whs"
    for drive, angle in (("torque_nm", "angle_rad"), ("torque_mnm", "angle_deg")):
        log = tmp_path / f"{angle}.csv"
        log.write_text(f"{drive},{angle}\n" + "".join(f"{k % 7},{k % 5}\n" for k in range(300)))
        options = ["--input", drive, "--output", angle, "--checkpoint", kept, "--no-track", "--estimator", "rls"]
        done = stream(log, *options, "--out", tmp_path / f"{angle}.jsonl")
    assert done.exit_code == 1
    assert "learnt from torque_nm in Nm, angle_rad in rad, and this stream reads torque_mnm in mNm" in done.stderr


@pytest.mark.parametrize(("header", "told"), [
    ("torque_mnm,angle_rad", "a header in which 'torque_nm' is called 'torque_mnm'"),
    ("angle_rad,torque_nm", "a header with the columns in another order"),
])  # fmt: skip
def test_rows_below_another_header_are_not_learnt(tmp_path, header, told):
    """It was skipped as a bad row: mNm were learnt as Nm, and the torque as time where a logger rotates its columns."""
    log = tmp_path / "axis.csv"
    rows = "".join(f"{k % 7},{k % 5}\n" for k in range(150))
    log.write_text(f"torque_nm,angle_rad\n{rows}{header}\n{rows}")
    done = stream(log, "--input", "torque_nm", "--output", "angle_rad", "--no-track", "--estimator", "rls")
    assert done.exit_code != 0
    assert f"line 152: {told}" in done.stderr
    assert carried(tmp_path / "axis.csv.whs")["carried"]["rows"] == 150


@pytest.mark.parametrize("hole", ["hold", "restart"])
def test_the_header_again_changes_nothing_in_a_stream_with_stamps(tmp_path, hole):
    """It had counted as a lost row, and a sample that never was took its place."""
    rows, ends = short.rows(200), []
    for name, lines in (("once", rows), ("again", [*rows[:90], "t,u,y\n", *rows[90:]])):
        log = short.write(tmp_path / f"{name}.csv", lines)
        assert short.run(log, "--hole", hole).exit_code == 0
        ends.append(short.carried(tmp_path / f"{name}.csv.whs"))
    assert [e["rows"] for e in ends] == [200, 200]
    assert [e["bad"] for e in ends] == [0, 0]
    assert ends[0]["experiment"] == ends[1]["experiment"]


def test_a_closed_standard_input_is_told(monkeypatch):
    monkeypatch.setattr("sys.stdin", None)
    with pytest.raises(ValueError, match="standard input is closed; pipe the rows"):
        stream_job._open("-", {"number": 0}, follow=False)


def test_a_checkpoint_of_other_settings_or_of_another_file_is_refused(tmp_path, rows):
    log = write(tmp_path / "log.csv", rows[:300])
    assert stream(log, *QUICK).exit_code == 0
    done = stream(log, *QUICK, "--p", "2")
    assert done.exit_code == 1
    assert "give --fresh" in done.stderr
    log.write_text("t,u,y,z\n")
    assert "not the file that the checkpoint was written for" in stream(log, *QUICK).stderr
    (tmp_path / "log.csv.whs").write_bytes(b"torn")
    assert "not a whsklearn state file" in stream(log, *QUICK).stderr
