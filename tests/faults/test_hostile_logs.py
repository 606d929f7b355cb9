"""A diagnosis of hostile logs: a sentence and an exit status, never a traceback; the same bytes for the same log."""

from __future__ import annotations

import json
import os
import sqlite3
import subprocess
import sys
import time

import numpy as np
import pytest
from click.testing import CliRunner
from threadpoolctl import threadpool_info, threadpool_limits

from whsklearn.cli.gap import main
from whsklearn.datasets import make_servo_log
from whsklearn.effects import Cogging
from whsklearn.gap import GapFinder
from whsklearn.streaming.rows import AT_ONCE, LineSource
from whsklearn.tracking import TrackingError, open_tracker, store

COLUMNS = ["time_s", "torque_nm", "position_rad"]


@pytest.fixture(scope="module")
def frame():
    return make_servo_log([Cogging(0.3, 12.0)], duration=8.0, random_state=0)[COLUMNS]


def run(*arguments):
    return CliRunner().invoke(main, [*map(str, arguments), "--no-track"])


HOSTILE = {
    "empty": (lambda f: b"", 3),
    "blanks": (lambda f: b" \n\n \n", 3),
    "a name and nothing": (lambda f: b"time_s\n", 3),
    "zero bytes": (lambda f: bytes(5000), 3),
    "a program": (lambda f: b"\x7fELF\x02\x01\x01" + bytes(range(256)) * 64, 3),
    "a picture": (lambda f: b"\x89PNG\r\n\x1a\n" + bytes(range(256)) * 64, 3),
    "a cut archive": (lambda f: b"PK\x03\x04" + bytes(range(256)), 3),
    "a page": (lambda f: b"<!DOCTYPE html><html><body><script>alert(1)</script></body></html>\n" * 30, 3),
    "all 1e300": (lambda f: (f * 0 + 1e300).assign(time_s=f.time_s).to_csv(index=False).encode(), 3),
    "all 1e-300": (lambda f: (f * 1e-300).assign(time_s=f.time_s).to_csv(index=False).encode(), 3),
    "no motion": (lambda f: f.assign(position_rad=1.0).to_csv(index=False).encode(), 3),
    "not a number": (lambda f: f.assign(torque_nm=np.nan).to_csv(index=False).encode(), 3),
}


@pytest.mark.parametrize("name", HOSTILE)
def test_a_hostile_log_is_refused_in_a_sentence_with_status_3(name, frame, tmp_path):
    make, status = HOSTILE[name]
    (tmp_path / "a.csv").write_bytes(make(frame))
    done = run(tmp_path / "a.csv", "--report", tmp_path / "gap")
    assert done.exit_code == status, done.output
    assert done.exception is None or isinstance(done.exception, SystemExit)
    assert json.loads((tmp_path / "gap" / "gap.json").read_text())["verdict"] == "data_problem"


def test_markup_in_names_is_shown_and_not_run(frame, tmp_path):
    bad = "<script>alert(1)</script>"
    path = tmp_path / "<b>&.csv"
    frame.iloc[:2000].rename(columns={"torque_nm": bad}).to_csv(path, index=False)  # two seconds: refused with a page
    done = run(path, "--drive", bad, "--report", tmp_path / "gap")
    assert done.exit_code == 3
    page = (tmp_path / "gap" / "gap.html").read_text(encoding="utf-8")
    assert "&lt;b&gt;&amp;.csv" in page
    assert "<b>&" not in page
    assert bad not in page


@pytest.mark.slow
def test_threads_and_time_leave_no_trace_in_the_file(frame, tmp_path):
    seen = []

    def progress(step):
        seen.extend(p["num_threads"] for p in threadpool_info() if p["user_api"] == "blas")

    texts = []
    for threads in (1, 2):
        with threadpool_limits(threads, user_api="blas"):
            finder = GapFinder("servo", progress=progress).fit(frame, position="position_rad")
        finder.report(tmp_path)
        texts.append((tmp_path / "gap.json").read_bytes())
    assert texts[0] == texts[1]
    assert set(seen) <= {1}  # also where the machine has more: two threads sum in another order
    assert json.loads(texts[0])["seconds"] == 0.0
    assert json.loads((tmp_path / "run.json").read_text())["seconds"] > 0


def test_an_interruption_before_the_report_leaves_no_half_of_one(frame, tmp_path, monkeypatch):
    frame.to_csv(tmp_path / "a.csv", index=False)
    monkeypatch.setattr("whsklearn.gap.report.render", lambda d: (_ for _ in ()).throw(KeyboardInterrupt))
    done = run(tmp_path / "a.csv", "--report", tmp_path / "gap")
    assert done.exit_code == 130
    assert not (tmp_path / "gap").exists()  # an empty folder goes with it


def test_a_database_locked_at_the_end_is_one_sentence_after_the_result(mlflow_root, monkeypatch, caplog):
    monkeypatch.setattr("mlflow.store.tracking.sqlalchemy_store.SqlAlchemyStore.log_batch", _locked)
    with pytest.raises(TrackingError, match="database is locked") as caught, open_tracker("x").run("one") as kept:
        kept.log_tags({"verdict": "named"})
    assert "\n" not in str(caught.value)
    assert "Traceback" not in caplog.text


@pytest.mark.slow
def test_two_runs_at_once_on_one_new_store_are_both_recorded(tmp_path):
    env = {**os.environ, "MLFLOW_TRACKING_URI": f"sqlite:///{tmp_path}/mlflow.db"}
    code = "import sys; from whsklearn.tracking import open_tracker\n"
    code += "with open_tracker('gap').run('gap of ' + sys.argv[1]) as kept: kept.log_tags({'verdict': 'named'})"
    both = [
        subprocess.Popen([sys.executable, "-c", code, name], env=env, stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
        for name in ("one", "two")
    ]
    said = [job.communicate(timeout=200)[0].decode() for job in both]
    assert [job.returncode for job in both] == [0, 0], said
    with sqlite3.connect(tmp_path / "mlflow.db") as database:
        status = database.execute("select status from runs where name like 'gap of%' and lifecycle_stage = 'active'")
        assert [row[0] for row in status] == ["FINISHED", "FINISHED"]


def test_a_folder_in_which_nothing_can_be_made_is_told_before_the_work(frame, tmp_path):
    frame.to_csv(tmp_path / "a.csv", index=False)
    (tmp_path / "file").write_text("no folder")
    began = time.monotonic()
    done = run(tmp_path / "a.csv", "--report", tmp_path / "file" / "gap")
    assert done.exit_code == 1
    assert "name another folder" in done.output
    assert time.monotonic() - began < 3.0


def _locked(*_args, **_kwargs):
    raise sqlite3.OperationalError("database is locked")


def test_chatter_of_mlflow_is_kept_back_but_only_during_a_call():
    import logging

    before = logging.getLogger("mlflow").level
    with store.quiet(logging.CRITICAL):
        assert logging.getLogger("mlflow").level == logging.CRITICAL
    assert logging.getLogger("mlflow").level == before


def test_a_stream_hands_out_few_lines_at_a_time_so_that_a_signal_is_heard(tmp_path):
    text = b"".join(b"%d,1\n" % i for i in range(1000))
    (tmp_path / "a.csv").write_bytes(text)
    source, taken = LineSource(open(tmp_path / "a.csv", "rb")), []
    while (lines := source.read()) is not None:
        assert len(lines) <= AT_ONCE
        taken += lines
        assert source.offset == sum(map(len, taken)) + len(taken)
        assert source.number == len(taken)
    assert b"\n".join(taken) + b"\n" == text
    source.close()
