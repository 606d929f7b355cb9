"""Interruptions within callbacks of compiled code."""

from __future__ import annotations

import ctypes
import os
import signal
import sys
import time

import pytest
from click.testing import CliRunner

from whsklearn._interruption import insisted
from whsklearn.cli.job import job

callback = ctypes.CFUNCTYPE(None)


def lose_a_signal(number: int) -> None:
    """Send a signal that arrives within a callback, through whose C frames nothing can be raised."""

    @callback
    def called():
        os.kill(os.getpid(), number)
        for _ in range(100):  # handlers run between two steps of the interpreter
            pass

    called()


def test_sigterm_lost_in_a_callback_ends_the_command():
    @job
    def main(**options):
        """Wait to be ended."""
        lose_a_signal(signal.SIGTERM)
        time.sleep(20)

    began = time.monotonic()
    assert CliRunner().invoke(main).exit_code == 143
    assert time.monotonic() - began < 10.0


def test_it_is_raised_again_until_it_arrives():
    """Twice lost: the second time within the callback in which it is raised again."""

    @callback
    def slow():
        time.sleep(1.0)

    def lose_both():
        lose_a_signal(signal.SIGINT)
        slow()
        time.sleep(20)

    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        with pytest.raises(KeyboardInterrupt), insisted(KeyboardInterrupt):
            lose_both()
    finally:
        signal.signal(signal.SIGINT, before)


def test_what_is_lost_otherwise_is_reported_as_before(monkeypatch):
    seen = []
    monkeypatch.setattr(sys, "unraisablehook", seen.append)

    @callback
    def broken():
        raise ZeroDivisionError

    alarm = signal.getsignal(signal.SIGALRM)
    with insisted(KeyboardInterrupt):
        broken()
    assert [s.exc_type for s in seen] == [ZeroDivisionError]
    assert sys.unraisablehook == seen.append
    assert signal.getsignal(signal.SIGALRM) == alarm
