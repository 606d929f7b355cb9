"""Interruptions that arrive: what is raised by a signal within a callback of compiled code would be lost.

A handler of Python runs wherever the interpreter is when the signal comes.  Within a callback that C calls, the cache
of a compiler for one, nothing can be raised through the C frames: the interpreter reports the exception to
`sys.unraisablehook` and goes on, and whoever pressed Ctrl-C waits.  Here it is raised again until it arrives.
"""

from __future__ import annotations

import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

AGAIN_SECONDS = 0.05  # until it is raised again: a callback is short, and a compiler makes thousands


@contextmanager
def insisted(*kinds: type[BaseException]) -> Iterator[None]:
    """Within it an exception of these kinds that is lost in a callback is raised again in the main thread.

    Where there is no interval timer (Windows) nothing is changed.
    """
    if not hasattr(signal, "setitimer"):
        yield
        return
    before, alarm = sys.unraisablehook, signal.getsignal(signal.SIGALRM)

    def hook(lost: Any) -> None:
        if not issubclass(lost.exc_type, kinds):
            before(lost)
            return
        kind = lost.exc_type

        def again(_number: int, _frame: Any) -> None:
            raise kind

        signal.signal(signal.SIGALRM, again)
        signal.setitimer(signal.ITIMER_REAL, AGAIN_SECONDS)

    sys.unraisablehook = hook
    try:
        yield
    finally:
        sys.unraisablehook = before
        if signal.getsignal(signal.SIGALRM) is not alarm:
            signal.setitimer(signal.ITIMER_REAL, 0.0)
            signal.signal(signal.SIGALRM, alarm)
