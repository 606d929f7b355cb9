"""Undoing a call of ``partial_fit`` that an exception or a signal ended halfway.

Arrays change in place, and a copy of them before every row would cost more than the row.  So a copy is taken
now and then, the few rows since are noted, and after an exception they are learnt anew on a copy of the copy: the
recursion is deterministic, so that is the state before the call to the bit.
"""

from __future__ import annotations

import copy
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from whsklearn.estimators._streams import State, Stream

    Array = NDArray[np.float64]

# To learn 64 rows anew takes no longer than the longest re-run of a memory.
ROWS = 64
PLAIN = frozenset((int, float, str, type(None)))  # types of values that nothing can change


def copied(state: State) -> State:
    """The state in arrays of its own, but for the read-only ones: what changes them puts others in their place."""
    return {name: _own(value) for name, value in state.items()}


# of a stream with a memory, beginnings of names: the memory only grows, up to where another one takes its place
# (`NextMemory`), and what a re-run is given is replaced whole where it ends
REPLACED = "memory_", "page_", "prior_", "past_", "origin"


def noted(state: State) -> State:
    """The same, but for what only grows or is replaced: its copy would take as long as the row that waits for it."""
    return {name: value if name.startswith(REPLACED) else _own(value) for name, value in state.items()}


def emptied(state: State) -> State:
    """A noted state in arrays of its own, and nothing in the memory beyond the samples that it held."""
    state = copied(state)
    if "memory_restart" in state:
        history = len(state["memory_y"]) - len(state["memory_restart"])
        for name, value in state.items():
            if name.startswith("memory_"):
                before = history if name in ("memory_u", "memory_y") else 0
                value[before + state["fill"] :] = name in ("memory_kept", "memory_weight")
    return state


def _own(value: Any) -> Any:
    """The value, or a copy of what can be changed."""
    if isinstance(value, np.ndarray):
        return value.copy() if value.flags.writeable else value
    return value if type(value) in PLAIN else copy.copy(value)


class Undo:
    """What is needed to go back to the state before the present call.

    Interrupts are taken by Python where a call returns or a function begins, never between two plain assignments:
    those below that belong together stand together.
    """

    def __init__(self) -> None:
        self.noted = False  # in this call: what else a row has to do can wait for the next one
        self._of: Any = None  # the state that was copied; another one, or one that others changed, is copied anew
        self._seen = -1
        self._copy: State = {}
        self._sizes: tuple[int, ...] = ()
        self._filled = 0
        self._u: Array | None = None
        self._y = np.empty(ROWS)

    def before(self, state: State, u: Array, y: Array) -> None:
        """Note rows of shapes (n, n_columns) and (n,) that are about to be learnt within one experiment."""
        n = len(y)
        if self._of is not state or self._seen != state["seen"] or self._filled + n > ROWS:
            kept = noted(state)
            self.noted = True
            self._of, self._copy, self._seen, self._sizes, self._filled = state, kept, state["seen"], (), 0
        if n <= ROWS:
            if self._u is None or self._u.shape[1] != u.shape[1]:
                self._u = np.empty((ROWS, u.shape[1]))
            self._u[self._filled : self._filled + n] = u
            self._y[self._filled : self._filled + n] = y

    def done(self, n: int) -> None:
        """Count the rows as learnt."""
        self.noted = False
        if n > ROWS:
            self._of = None
            return
        self._sizes = (*self._sizes, n)
        self._filled += n
        self._seen += n

    def clear(self) -> None:
        """Forget the copy: the state is about to change in another way than by rows."""
        self._of = None

    def restored(self, stream: Stream) -> State:
        """The state before the call, in new arrays; interrupts meanwhile wait, as one is under way already."""
        while True:
            try:
                state = emptied(self._copy)
                at = 0
                for n in self._sizes:
                    assert self._u is not None
                    stream.run(state, self._u[at : at + n], self._y[at : at + n], np.zeros(n, dtype=np.bool_))
                    at += n
                self._of = None
                return state
            except KeyboardInterrupt:
                continue
