"""A record that is slow or down never holds a stream up."""

from __future__ import annotations

import threading
import time

from whsklearn.tracking import BesideRun, open_tracker


def test_metrics_are_handed_over_and_none_is_lost():
    run = BesideRun(lambda: open_tracker("x", enabled=False), "stream")
    for step in range(50):
        run.log_metrics({"nmse": 0.1}, step)
    assert run.close() == 0


def test_a_record_that_cannot_be_opened_costs_no_row_and_is_told_once():
    def broken():
        raise OSError("the server is down")

    told = []
    run = BesideRun(broken, "stream", say=told.append)
    began = time.perf_counter()
    for step in range(20):
        run.log_metrics({"nmse": 0.1}, step)
    assert time.perf_counter() - began < 1.0
    assert run.close() == 20
    assert len(told) == 1
    assert "the stream goes on" in told[0]


def test_it_writes_from_a_thread_of_its_own():
    seen = []

    def opened():
        seen.append(threading.current_thread())
        return open_tracker("x", enabled=False)

    BesideRun(opened, "stream").close()
    assert seen[0] is not threading.main_thread()
