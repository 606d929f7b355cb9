"""The stream: same records and state however rows arrive, through stops, kills, bad rows and changes."""

from __future__ import annotations

import io
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from whsklearn import WienerHammersteinSystem
from whsklearn.checks import state_difference
from whsklearn.cli.stream import main
from whsklearn.cli.stream_rows import LONGEST, BadRow, CsvParser, FollowedFile, JsonParser, LineSource
from whsklearn.effects import reduced_law
from whsklearn.state import read_state

ROOT = Path(__file__).resolve().parents[2]
QUICK = ["--no-track", "--time", "t", "--p", "1", "--every", "500"]
KILLS = int(os.environ.get("WHSKLEARN_KILLS", "2"))


def axis(n, seed, coulomb=0.7):
    u = np.random.default_rng(seed).normal(size=n)
    law = reduced_law(coulomb=coulomb)
    return u, WienerHammersteinSystem([1, 2.2], [1, 0.5], [1, 0.2], [0.15, 0.4], law=law).simulate(u[:, None])


@pytest.fixture(scope="module")
def rows():
    u, y = axis(2600, 0)
    y += 0.05 * np.random.default_rng(1).normal(size=y.size)
    return [f"{0.01 * i:.2f},{a:.12g},{b:.12g}\n" for i, (a, b) in enumerate(zip(u, y, strict=True))]


def write(path, rows):
    path.write_text("t,u,y\n" + "".join(rows))
    return path


def stream(*args, **kwargs):
    return CliRunner().invoke(main, [str(a) for a in args], **kwargs)


def records(path, kind=None):
    found = [json.loads(line) for line in Path(path).read_text().splitlines()]
    return [r for r in found if kind in (None, r["kind"])]


def carried(path):
    """What a checkpoint holds, without the place of the source."""
    _, state = read_state(path, "stream")
    return {k: v for k, v in state.items() if k != "place"}


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory, rows):
    folder = tmp_path_factory.mktemp("undisturbed")
    log = write(folder / "log.csv", rows)
    done = stream(log, "--out", folder / "out.jsonl", "--predictions", *QUICK)
    assert done.exit_code == 0, done.output
    return folder


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


def test_a_stream_in_two_sittings_ends_as_in_one(tmp_path, undisturbed, rows):
    log = write(tmp_path / "log.csv", rows[:1234])
    for part in (rows[1234:], []):
        done = stream(log, "--out", tmp_path / "out.jsonl", "--predictions", *QUICK)
        assert done.exit_code == 0, done.output
        with open(log, "a") as file:
            file.writelines(part)
    assert "Going on after row 1234" in done.stderr
    assert (tmp_path / "out.jsonl").read_bytes() == (undisturbed / "out.jsonl").read_bytes()
    assert state_difference(carried(tmp_path / "log.csv.whs"), carried(undisturbed / "log.csv.whs")) == 0.0


def start(log, out, *args):
    command = [sys.executable, "-m", "pipelines.stream", str(log), "--out", str(out), *QUICK, *args]
    return subprocess.Popen(command, cwd=ROOT, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)


def wait_for(condition, process, seconds=60):
    end = time.monotonic() + seconds
    while not condition():
        assert process.poll() is None, process.stderr.read()
        assert time.monotonic() < end, "nothing happened in time"
        time.sleep(0.02)


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


BAD = {3: "0.02,1.0\n", 5: "0.04,x,1.0\n", 8: "0.05,1,1\n", 9: "0.08,nan,1\n", 11: "0.10,1,1e999\n", 12: "\n"}


@pytest.mark.parametrize("gap", ["hold", "restart"])
def test_bad_rows_are_reported_with_their_lines_and_passed_over(tmp_path, rows, gap):
    spoilt = [BAD.get(i + 2, row) for i, row in enumerate(rows[:700])]
    log = write(tmp_path / "log.csv", spoilt)
    done = stream(log, "--out", tmp_path / "out.jsonl", "--gap", gap, *QUICK)
    assert done.exit_code == 0, done.output
    bad = records(tmp_path / "out.jsonl", "bad_row")
    assert [r["line"] for r in bad] == [3, 5, 8, 9, 11]
    assert bad[0]["reason"] == "2 fields, expected 3"
    assert "u is 'x'" in bad[1]["reason"]
    assert "does not come after" in bad[2]["reason"]
    for line in (3, 5, 8, 9, 11):
        assert f"line {line}:" in done.stderr
    assert carried(tmp_path / "log.csv.whs")["carried"]["rows"] == {"hold": 699, "restart": 694}[gap]


def test_a_refused_row_ends_the_stream_before_it_and_corrected_it_goes_on(tmp_path, undisturbed, rows):
    spoilt = list(rows)
    spoilt[1000] = "10.00,1.0,oops\n"
    log, args = write(tmp_path / "log.csv", spoilt), ["--bad-rows", "refuse", "--predictions", *QUICK]
    done = stream(log, "--out", tmp_path / "out.jsonl", *args)
    assert done.exit_code == 1
    assert "line 1002: y is 'oops', no number" in done.stderr
    assert carried(tmp_path / "log.csv.whs")["carried"]["rows"] == 1000
    write(log, rows)
    assert stream(log, "--out", tmp_path / "out.jsonl", *args).exit_code == 0
    assert (tmp_path / "out.jsonl").read_bytes() == (undisturbed / "out.jsonl").read_bytes()


def test_a_rise_of_friction_raises_the_alarm_and_is_named(tmp_path):
    u, y = axis(12_000, 3)
    y[7000:] = axis(12_000, 3, coulomb=0.84)[1][7000:]
    y += 0.05 * np.random.default_rng(4).normal(size=y.size)
    log = tmp_path / "log.csv"
    log.write_text("u,y\n" + "".join(f"{a:.12g},{b:.12g}\n" for a, b in zip(u, y, strict=True)))
    done = stream(log, "--no-track", "--out", tmp_path / "out.jsonl")
    assert done.exit_code == 0, done.output
    (alarm,) = records(tmp_path / "out.jsonl", "alarm")
    assert 7000 < alarm["row"] < 7100
    (change,) = records(tmp_path / "out.jsonl", "change")
    assert change["alarm_row"] == alarm["row"]
    assert len(change["changes"]) == 1
    assert change["changes"][0].startswith("coulomb rose")
    # the forgetting settles again, so the estimate is no noisier than one of the new regime alone
    assert records(tmp_path / "out.jsonl", "estimate")[-1]["parameters"]["coulomb"] == pytest.approx(0.84, abs=0.03)


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
    ("change", "said"),
    [
        (["--input", "torque"], "Column 'torque' stands 0 times"),
        (["--orders", "2,2"], "--orders is '2,2'"),
        (["--law", "nonsense"], "Unknown effect 'nonsense'"),
        (["--p", "0"], "p is 0"),
    ],
)
def test_impossible_requests_are_one_sentence(tmp_path, rows, change, said):
    log = write(tmp_path / "log.csv", rows[:50])
    done = stream(log, "--no-track", *change)
    assert done.exit_code == 1
    assert said in done.stderr
    assert "Traceback" not in done.stderr


def test_a_checkpoint_of_other_settings_or_of_another_file_is_refused(tmp_path, rows):
    log = write(tmp_path / "log.csv", rows[:300])
    assert stream(log, *QUICK).exit_code == 0
    done = stream(log, *QUICK, "--p", "2")
    assert done.exit_code == 1
    assert "give --fresh" in done.stderr
    log.write_text("t,u,y,z\n")
    assert "not the file that the checkpoint was written for" in stream(log, *QUICK).stderr
    (tmp_path / "log.csv.whs").write_bytes(b"torn")
    assert "no whsklearn state file" in stream(log, *QUICK).stderr


def test_lines_keep_their_numbers_and_places_whatever_the_blocks(tmp_path):
    text = b"a,b\n" + b"".join(b"%d,%d\n" % (i, i) for i in range(50_000)) + b"last,1"
    path = tmp_path / "log"
    path.write_bytes(text)
    source, lines = LineSource(io.BytesIO(text), open_end=True), []
    while (block := source.read()) is not None:
        lines += block
        assert text[: source.offset].rstrip(b"\n").split(b"\n") == lines or not lines
    assert lines == text.split(b"\n")
    assert (source.number, source.offset) == (50_002, len(text))


def test_a_line_without_end_takes_no_memory_and_is_no_row():
    text = b"1,1\n" + b"7" * (3 * LONGEST) + b",2\n3,3\n"
    source, lines = LineSource(io.BytesIO(text)), []
    while (block := source.read()) is not None:
        lines += block
        assert len(source._rest) <= LONGEST + (1 << 16)
    assert (lines[0], lines[2], source.offset) == (b"1,1", b"3,3", len(text))
    with pytest.raises(BadRow):
        CsvParser(b"u,y", ["u", "y"])(lines[1])


def test_a_followed_file_that_is_replaced_begins_anew(tmp_path):
    path = tmp_path / "log.csv"
    path.write_bytes(b"u,y\n1,1\n")
    source = FollowedFile(path)
    assert source.read() == [b"u,y", b"1,1"]
    (tmp_path / "new").write_bytes(b"u,y\n2,2\n")
    os.replace(tmp_path / "new", path)
    assert source.read() == []
    assert source.restarted
    assert source.read() == [b"u,y", b"2,2"]
    path.write_bytes(b"u,y\n")
    assert source.read() == []
    assert source.read() == [b"u,y"]
    source.close()


@pytest.mark.parametrize("header", [b"t,u,y", b'\xef\xbb\xbf"t","u","y"\r\n', b"t;u;y", b"t\tu\ty", b"t , u , y"])
def test_headers_of_many_kinds(header):
    parse = CsvParser(header, ["t", "u", "y"])
    assert parse(b"1,2.5,-3e2".replace(b",", parse.delimiter.encode())) == [1.0, 2.5, -300.0]
    assert parse(b'"1","2.5","-3e2"\r'.replace(b",", parse.delimiter.encode())) == [1.0, 2.5, -300.0]


@pytest.mark.parametrize("line", [b"", b"1", b"1,2,3", b"a,1", b"nan,1", b"1,inf", b"1_0,1", b"\xff,1", b"1,,"])
def test_lines_that_are_no_rows(line):
    with pytest.raises(BadRow):
        CsvParser(b"u,y", ["u", "y"])(line)


@pytest.mark.parametrize(
    "line",
    [b"", b"{", b"[1,2]", b"3", b'{"u": 1}', b'{"u": "1", "y": 1}', b'{"u": true, "y": 1}', b'{"u": NaN, "y": 1}',
     b'{"u": 1e999, "y": 1}', b'{"u": 1' + b"0" * 400 + b', "y": 1}', b"[" * 100_000, b"\xff\xfe"],
)  # fmt: skip
def test_json_lines_that_are_no_rows(line):
    with pytest.raises(BadRow):
        JsonParser(["u", "y"])(line)
