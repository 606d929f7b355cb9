"""A record that is slow or down never holds a stream up."""

from __future__ import annotations

import threading
import time

import pytest

from whsklearn.tracking import BesideRun, TrackingError, open_tracker


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
    assert "the stream continues" in told[0]


def test_it_writes_from_a_thread_of_its_own():
    seen = []

    def opened():
        seen.append(threading.current_thread())
        return open_tracker("x", enabled=False)

    BesideRun(opened, "stream").close()
    assert seen[0] is not threading.main_thread()


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
