"""What the posterior of a stream consists of: the samples in memory, and a summary of the earlier pages.

When a page is turned, M is kept, linearised at the parameters of that time, together with the signs that
are still in doubt.  Both can be moved to another theta_0, because e is linear while no sign flips and dx is
expanded to second order: M -> T' M T with T = [I; -delta'], dx += g' delta + delta' H delta / 2, g += H delta.
The posterior of a stream of any length therefore costs no more than that of its memory.  It is computed on
request (`whsklearn.recursion.memory.multistart.posterior`), not at every sample.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from whsklearn.effects.base import Array, Integers
from whsklearn.recursion.memory.gauss_newton import Memory, Work
from whsklearn.recursion.memory.linearised import (
    CAPACITY,
    IN_DOUBT,
    JUMPING,
    SETTLED,
    Pass,
    Rows,
    Signs,
    deviation,
    empty_rows,
)
from whsklearn.recursion.memory.refit import memory_of
from whsklearn.recursion.memory.settings import Settings, State
from whsklearn.recursion.memory.sign_posterior import Gaussian
from whsklearn.recursion.rows.predictor import state_size

Indices = NDArray[np.intp]


def has_posterior(r: Settings) -> bool:
    """Whether signs can be in doubt: the law jumps, L1 has parameters and there is a memory."""
    # in plain Python: this is evaluated between two samples, and four NumPy calls would cost half a sample
    return bool(r.memory and r.dims[0] - 1 + r.dims[1] > 0 and not JUMPING.isdisjoint(r.codes.tolist()))


def initial_past(r: Settings) -> State:
    """The summary of earlier pages before there are any."""
    n, n1, nw, nc = r.size, int(r.dims[0] - 1 + r.dims[1]), int(r.dims[4]), int(r.dims[2])
    room = CAPACITY if has_posterior(r) else 0
    signs = {
        "signs": np.zeros((room, 3 + n1 + n1 * n1 + nw + nc * (n + 1))),
        "signs_at": np.full((room, nc), -1, dtype=np.int64),
    }
    past = {"past_matrix": np.zeros((n + 1, n + 1)), "past_theta": np.zeros(n), "past_count": np.zeros(1)}
    past["past_origin"] = np.zeros(int(state_size(r.dims)))
    return past | _read_only(signs)


def flattened(signs: Signs) -> Array:
    """One row for each sign, with all its numbers but the samples it enters."""
    n = signs.dx.size
    return np.column_stack([v.reshape(n, int(np.prod(v.shape[1:]))) for v in signs[:-1]])


def stored(rows: Array, at: Integers, state: State) -> State:
    """The signs in the form in which the state stores them, from the rows of `flattened` and the samples they enter."""
    # plain constructors: ``zeros_like`` and ``full`` go through Python, which takes a sample's time if rarely called
    out = {"signs": np.zeros(state["signs"].shape), "signs_at": np.empty(state["signs_at"].shape, dtype=np.int64)}
    out["signs"][: len(rows)] = rows
    out["signs_at"][: len(rows)], out["signs_at"][len(rows) :] = at, -1
    return _read_only(out)


def _read_only(arrays: State) -> State:
    """The same arrays, read-only, so that the copy of the state for an interrupted call can share them."""
    for value in arrays.values():
        value.flags.writeable = False
    return arrays


def unpacked(state: State, r: Settings) -> Signs:
    """The reverse of `stored`."""
    n1, nw, nc = int(r.dims[0] - 1 + r.dims[1]), int(r.dims[4]), int(r.dims[2])
    n = np.count_nonzero(state["signs"][:, 2])
    rows = state["signs"][:n]  # views: nothing here is changed in place, and a copy would take a sample's time
    g, c = 3 + n1, 3 + n1 + n1 * n1
    h = c + nw
    return Signs(
        rows[:, 0], rows[:, 1], rows[:, 2], rows[:, 3:g], rows[:, g:c].reshape(-1, n1, n1), rows[:, c:h],
        rows[:, h:].reshape(-1, nc, r.size + 1), state["signs_at"][:n],
    )  # fmt: skip


def moved(matrix: Array, delta: Array) -> Array:
    """M linearised at theta_0 + delta."""
    t = np.eye(matrix.shape[0])
    t[:-1, -1] = -delta
    return t.T @ matrix @ t


def origin_at(origin: Array, dims: Integers, delta: Array) -> Array:
    """The state at the start of a memory if the earlier samples had been run at theta + delta with the same signs.

    In 20,000 samples of Example 5.1 the second sample of a page had the wrong sign, at a dx of 0.003, when x continued
    from its value at the parameters of the page before.
    """
    nb, nc, nw = int(dims[1]), int(dims[2]), int(dims[4])
    n1, nx = int(dims[0]) - 1 + nb, max(nb, 1)
    out, v = origin.copy(), nx * (1 + n1)
    out[:nx] += origin[nx:v].reshape(nx, n1) @ delta[:n1]
    out[v : v + nc] += origin[v + nc :].reshape(nc, n1 + nw) @ delta[: n1 + nw]
    return out


class Linearisation:
    """The first samples in memory linearised at ``theta``, together with the summary of all earlier samples.

    Every method takes what the ones before returned, so that a stream may do one of them between two samples
    (`whsklearn.recursion.memory.schedule`).
    It does not change the ``state`` of the stream, of which ``s`` is the model; as many samples are read as there are
    ``weights``, which are those after forgetting.
    """

    def __init__(self, state: State, r: Settings, s: int, theta: Array, weights: Array):
        self.state, self.settings, self.model, self.theta, self.weights = state, r, s, theta, weights
        self.stop, self.first = weights.size, state["seen"] - state["fill"]
        origin = origin_at(state["past_origin"], r.dims, theta - state["past_theta"])
        self.record: Memory = memory_of(state, r, self.stop, weights, origin, tail=1)
        self.matrix = np.zeros((theta.size + 1, theta.size + 1))
        self.rows: Rows = empty_rows(self.stop, theta.size, int(r.dims[0] - 1 + r.dims[1]))

    def begin(self, work: Work) -> None:
        """Begin to read; ``work`` must belong to a re-run that has finished."""
        self._pass = Pass(self.theta, self.settings.law, self.record, work, self.rows)

    @property
    def is_read(self) -> bool:
        """Whether all samples have been read."""
        return self._pass.done >= self.stop

    def read_segment(self) -> None:
        """Read on to the end of a segment, which `add_segment` must then add to M."""
        begin = self._pass.done
        self._pass.read_segment()
        self._segment = slice(begin, self._pass.done)

    def add_segment(self) -> None:
        """Weight the rows that were read last, and add them to M."""
        psi = self.rows.psi[self._segment]
        psi *= np.sqrt(self.weights[self._segment, None])
        self.matrix += psi.T @ psi

    def with_past(self, left: float, count: float) -> tuple[Array, float]:
        """M and the number of samples for past and memory together.

        ``left`` is the weight of the past after forgetting, ``count`` the number of samples of the memory.
        """
        state, n = self.state, self.theta.size
        if self._has_past:
            matrix = moved(state["past_matrix"], self.theta - state["past_theta"])
            return self.matrix + left * matrix, count + left * float(state["past_count"][0])
        # P0, as the information that the re-run of the memory uses
        matrix = np.zeros((n + 1, n + 1))
        matrix[:n, :n] = left * state["prior_information"][self.model]
        return self.matrix + moved(matrix, self.theta - state["prior_theta"][self.model]), count

    @property
    def _has_past(self) -> bool:
        return bool(self.state["past_count"][0] > 0.0)

    def past_signs(self, left: float) -> Signs:
        """The signs of earlier pages, weighted by ``left``."""
        signs = unpacked(self.state, self.settings)
        return signs.weighted(left) if self._has_past else signs

    def moved_here(self, signs: Signs) -> Signs:
        """The signs of earlier pages at ``theta``."""
        return signs.shifted(self.theta - self.state["past_theta"]) if self._has_past else signs

    def met(self, signs: Signs) -> Signs:
        """The signs of earlier pages, the last of which enter the first rows of the memory."""
        return signs.met(self.rows.psi, self.record.restart[: self.stop], self.first) if self._has_past else signs

    def doubt(self, about: Gaussian | None, part: slice = slice(None)) -> Array:
        """|dx| of the samples in standard deviations; infinite if nothing is known of them."""
        dx, gradient = np.abs(self.rows.motion[part, 1]), self.rows.gradient[part]
        if about is None:
            return np.full(dx.size, np.inf)
        return dx / deviation(
            gradient, np.ascontiguousarray(about.covariance[: gradient.shape[1], : gradient.shape[1]])
        )

    def in_doubt(self, old: Signs, doubt: Array, about: Gaussian | None) -> tuple[Indices, Indices]:
        """Choose the most doubtful of the unsettled signs of the past and of the signs of the memory in doubt."""
        n1 = self.rows.gradient.shape[1]
        before = np.zeros(old.dx.size) if about is None else old.doubt(about.covariance[:n1, :n1])
        counts = (self.weights != 0.0) & (self.rows.motion[:, 1] != 0.0)
        kept, chosen = np.flatnonzero(before < SETTLED), np.flatnonzero((doubt < IN_DOUBT) & counts)
        if kept.size + chosen.size > CAPACITY:
            bar = np.sort(np.concatenate([before[kept], doubt[chosen]]))[CAPACITY]
            kept, chosen = kept[before[kept] < bar], chosen[doubt[chosen] < bar]
        return kept, chosen

    def left_behind(self, matrix: Array, count: float) -> State:
        """The summary of a page for later ones, without its signs (`stored`), as the state stores it."""
        past = {"past_matrix": matrix, "past_theta": self.theta.copy(), "past_count": np.array([count])}
        return past | {"past_origin": self._pass.end.copy()}
