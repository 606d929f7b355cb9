"""``python -m whsklearn``: the exit status of the command, also beside a record that still waits for its server."""

from __future__ import annotations

import io
import os
import threading
import types

import pytest

from whsklearn import __main__ as program
from whsklearn.tracking import beside


def ended(monkeypatch, status):
    def command(**options):
        raise SystemExit(status)

    monkeypatch.setattr(program, "main", command)
    with pytest.raises(SystemExit) as end:
        program.run()
    return end.value.code


@pytest.mark.parametrize("status", [0, 1, 3])
def test_the_exit_status_is_the_commands(monkeypatch, status):
    assert ended(monkeypatch, status) == status


def test_a_record_that_waits_for_a_server_holds_nobody_up(monkeypatch):
    left, over, cleaned = [], threading.Event(), []

    def leave(status):
        left.append(status)
        raise SystemExit(status)

    monkeypatch.setattr(os, "_exit", leave)
    monkeypatch.setattr(program, "CLEANING_SECONDS", 0.01)
    monkeypatch.setattr(program.atexit, "_run_exitfuncs", lambda: (cleaned.append(1), over.wait()))  # waits, too
    monkeypatch.setattr(program.multiprocessing, "active_children", list)
    pool = types.SimpleNamespace(_executor=None)
    monkeypatch.setitem(program.sys.modules, "joblib.externals.loky.reusable_executor", pool)
    assert ended(monkeypatch, 3) == 3
    assert left == []  # the usual way, by which files are flushed
    thread = threading.Thread(target=over.wait, name=beside.THREAD + "stream", daemon=True)
    thread.start()
    try:
        assert ended(monkeypatch, 3) == 3
        assert left == [3]
        assert not cleaned  # there are no workers whose folders stay
        pool._executor = object()
        ended(monkeypatch, "a sentence")
        assert left == [3, 1]
        assert cleaned
    finally:
        over.set()
        thread.join()


def test_a_terminal_without_umlauts_ends_no_job(monkeypatch):
    bytes_out = io.BytesIO()
    monkeypatch.setattr(program.sys, "stdout", io.TextIOWrapper(bytes_out, "ascii"))
    monkeypatch.setattr(program, "main", lambda **options: print("Größe 30°", flush=True))
    with pytest.raises(SystemExit):
        program.run()
    assert bytes_out.getvalue() == b"Gr??e 30?\n"
