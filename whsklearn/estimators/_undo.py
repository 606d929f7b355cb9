"""How a call of ``partial_fit`` that an exception or a signal ended halfway is undone.

A stream holds settings only.  Everything learned is in its state, a plain dict of numbers and arrays, so that it can
be copied, saved, compared and put back.

Arrays change in place, and copying them before every row would cost more than the row.  So a copy is made now
and then, and the few rows since are noted.  After an exception these rows are learned again on a copy of that copy.
The recursion is deterministic, so the result is bit for bit the state before the call.
"""

from __future__ import annotations

import copy
from collections.abc import Callable
from typing import Any

import numpy as np

from whsklearn.effects.base import Array, Bools
from whsklearn.recursion.memory.settings import State

# Learning 64 rows again takes no longer than the longest re-run of a memory.
ROWS = 64
PLAIN = frozenset((int, float, str, type(None)))  # types of immutable values


# Prefixes of names in the state of a stream with a memory.  The memory only grows until another one replaces it
# (`NextMemory`), and the input of a re-run is replaced as a whole when the re-run ends.
REPLACED = "memory_", "page_", "prior_", "past_", "origin"


def copied(state: State, but: tuple[str, ...] = ()) -> State:
    """The state in its own arrays, except for those that are read-only, which never change, or begin with ``but``."""
    return {name: value if name.startswith(but) else _own(value) for name, value in state.items()}


def emptied(state: State) -> State:
    """A state copied but for `REPLACED`, in its own arrays, with nothing in the memory beyond the samples of then."""
    state = copied(state)
    if "memory_restart" in state:
        history = len(state["memory_y"]) - len(state["memory_restart"])
        for name, value in state.items():
            if name.startswith("memory_"):
                before = history if name in ("memory_u", "memory_y") else 0
                value[before + state["fill"] :] = name in ("memory_kept", "memory_weight")
    return state


def _own(value: Any) -> Any:
    """The value, or a copy of it if it is mutable."""
    if isinstance(value, np.ndarray):
        return value.copy() if value.flags.writeable else value
    return value if type(value) in PLAIN else copy.copy(value)


class Undo:
    """What is needed to restore the state before the current call.

    Python handles interrupts where a call returns or a function begins, never between two plain assignments.
    So assignments below that belong together are kept together.
    """

    def __init__(self) -> None:
        self.noted = False  # in this call; further work can wait for the next row
        self._of: Any = None  # the state that was copied; a different one, or one changed by others, is copied again
        self._seen = -1
        self._copy: State = {}
        self._sizes: tuple[int, ...] = ()
        self._filled = 0
        self._u: Array | None = None
        self._y = np.empty(ROWS)

    def before(self, state: State, u: Array, y: Array) -> None:
        """Note rows, of shapes (n, n_columns) and (n,), that are about to be learned within one experiment."""
        n = len(y)
        if self._of is not state or self._seen != state["seen"] or self._filled + n > ROWS:
            kept = copied(state, REPLACED)  # of the memory, too, it would take as long as the row itself
            self.noted = True
            self._of, self._copy, self._seen, self._sizes, self._filled = state, kept, state["seen"], (), 0
        if n <= ROWS:
            if self._u is None or self._u.shape[1] != u.shape[1]:
                self._u = np.empty((ROWS, u.shape[1]))
            self._u[self._filled : self._filled + n] = u
            self._y[self._filled : self._filled + n] = y

    def done(self, n: int) -> None:
        """Count the rows as learned."""
        self.noted = False
        if n > ROWS:
            self._of = None
            return
        self._sizes = (*self._sizes, n)
        self._filled += n
        self._seen += n

    def clear(self) -> None:
        """Forget the copy, because the state is about to change other than by rows."""
        self._of = None

    def restored(self, run: Callable[[State, Array, Array, Bools], None]) -> State:
        """The state before the call, in new arrays; further interrupts wait, as one is already being handled.

        ``run``: learns rows, in place.
        """
        while True:
            try:
                state = emptied(self._copy)
                at = 0
                for n in self._sizes:
                    assert self._u is not None
                    run(state, self._u[at : at + n], self._y[at : at + n], np.zeros(n, dtype=np.bool_))
                    at += n
                self._of = None
                return state
            except KeyboardInterrupt:
                continue
