"""The samples in memory, linearised at one theta with every sign frozen, and the signs that are in doubt there.

With sign(dx) frozen at each sample the predictor is smooth in theta, so

    e(theta_0 + delta) = e_0 - J delta        and        M = [J e_0]' W [J e_0]

hold all the information of a record, except at the samples whose dx is so small that other parameters
could flip its sign.  Those samples are listed with everything needed to flip them: dx, its gradient and
curvature in (a, b), the frozen sign, the height of the law's jump, and the rows of [J e_0] that v(t) enters,
t + 1 .. t + n_c (this is an equation error, so measured outputs propagate nothing further).

The curvature follows from the gradients.  With x = A/B u, each gradient G_k = d dx / d theta_k is a signal filtered by
1/B, and therefore

    d^2 dx / d theta_k d b_j = -F_k(t - j) - [theta_k is a b_i] F_j(t - i),        B(q) F_k = G_k,

and all other second derivatives are zero, because dx is linear in a.  They are needed because a sign that is
passed on from page to page is evaluated at parameters estimated later than its own page.  On 20,000 samples of
Example 5.1 the estimate after the first page is 0.005 from the truth.  There the error of dx from the gradient
alone is up to 8e-5, while the posterior determines dx to 1e-4.  The sign of one of 512 samples came out wrong,
which cost 15 units of log density at the truth.

When a page is turned, M is kept, linearised at the parameters of that time, together with the signs that
are still in doubt.  Both can be moved to another theta_0, because e is linear while no sign flips and dx is
expanded to second order: M -> T' M T with T = [I; -delta'], dx += g' delta + delta' H delta / 2, g += H delta.
The posterior of a stream of any length therefore costs no more than that of its memory.  It is computed on
request (`whsklearn.recursion.memory.multistart.posterior`), not at every sample.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from whsklearn._numba import njit
from whsklearn.effects.base import Array, Bools, Integers
from whsklearn.effects.codes import COULOMB, POSITION_FRICTION, STRIBECK_EXP
from whsklearn.effects.rows import law_values
from whsklearn.recursion.memory.gauss_newton import AT, BUDGET, COST, PHASE, Memory, Prior, Work, refine_part
from whsklearn.recursion.memory.predictor_block import LENGTH
from whsklearn.recursion.memory.refit import memory_of
from whsklearn.recursion.memory.settings import Settings, State
from whsklearn.recursion.rows.predictor import Law, state_size

CAPACITY = 512  # largest number of signs kept; on Example 5.1 the median is 20 to 130 at any length, the maximum 537
IN_DOUBT = 7.0  # standard deviations of dx under the covariance with signs frozen, which is wider than the posterior
JUMPING = frozenset((COULOMB, STRIBECK_EXP, POSITION_FRICTION))  # terms that jump where dx changes its sign
NONE = -1  # instead of a row that a sign does not enter because another experiment has begun
SETTLED = 12.0  # beyond this many standard deviations a listed sign is frozen permanently when a page is turned

Indices = NDArray[np.intp]


class Signs(NamedTuple):
    """The signs in doubt, one entry each."""

    # dx, sign, scale (E,): dx at theta_0, the sign frozen in the rows, and the square root of the sample's weight
    dx: Array
    sign: Array
    scale: Array
    gradient: Array  # (E, n_1): d dx / d(a, b)
    curvature: Array  # (E, n_1, n_1): d^2 dx / d(a, b)^2
    height: Array  # (E, K): value of each term of the law at sign 1
    rows: Array  # (E, n_c, n + 1): weighted [psi, e] of the samples that v(t) enters
    # (E, n_c): indices of those samples, counted from the start of the stream; -1 for none, -2 - i for sample i of the
    # next page, whose row is not known yet
    at: Integers

    def take(self, chosen: Indices) -> Signs:
        """Some of the entries."""
        return Signs._make(v[chosen] for v in self)

    def joined(self, others: Signs) -> Signs:
        """These entries followed by others."""
        return Signs(*(np.concatenate(pair) for pair in zip(self, others, strict=True)))

    def shifted(self, delta: Array) -> Signs:
        """The same entries at theta_0 + delta, with the signs frozen as before."""
        first = delta[: self.gradient.shape[1]]
        bent = self.curvature @ first
        dx = self.dx + (self.gradient + 0.5 * bent) @ first
        rows = self.rows.copy()
        rows[..., -1] -= rows[..., :-1] @ delta
        return self._replace(dx=dx, gradient=self.gradient + bent, rows=rows)

    def met(self, psi: Array, restart: Bools, first: int) -> Signs:
        """The entries with the rows ``psi`` that follow the end of a page; the first of them is sample ``first``.

        When signs were frozen there, one of the last signs of a page was wrong in one of 60 streams of 20,000 samples
        at 40 dB, and b_1 was off by twelve standard errors.
        """
        ahead = -2 - self.at - first
        entry, lag = np.nonzero((self.at < NONE) & (ahead >= 0) & (ahead < len(psi)))
        if not entry.size:
            return self
        sample = ahead[entry, lag]
        begins = np.flatnonzero(restart)
        there = sample < begins[0] if begins.size else np.ones(sample.size, dtype=bool)
        rows, at = self.rows.copy(), self.at.copy()
        rows[entry, lag] = psi[sample] * there[:, None]
        at[entry, lag] = np.where(there, first + sample, NONE)
        return self._replace(rows=rows, at=at)

    def weighted(self, left: float) -> Signs:
        """The same entries with each sample's weight multiplied by ``left``."""
        if left == 1.0:
            return self
        root = np.sqrt(left)
        return self._replace(scale=self.scale * root, rows=self.rows * root)

    def doubt(self, covariance: Array | None) -> Array:
        """|dx| in standard deviations; zero if the ``covariance`` of (a, b) is not known."""
        if covariance is None:
            return np.zeros(self.dx.size)
        # a copy: that of a state is read-only, for which the kernel would be compiled once more
        return np.abs(self.dx) / deviation(np.array(self.gradient), covariance)


def jumps(codes: Integers) -> Bools:
    """Which terms of a law jump where dx changes its sign."""
    return np.array([code in JUMPING for code in codes.tolist()], dtype=np.bool_)


@njit(error_model="numpy", short=True)
def deviation(gradient, covariance):
    """Standard deviation of dx at every sample, from its gradient with respect to (a, b)."""
    out = np.empty(gradient.shape[0])
    for t in range(gradient.shape[0]):
        variance = 1e-300
        for i in range(gradient.shape[1]):
            for j in range(gradient.shape[1]):
                variance += covariance[i, j] * gradient[t, i] * gradient[t, j]
        out[t] = np.sqrt(max(variance, 1e-300))
    return out


class Linearisation:
    """A memory linearised at ``theta`` with the true sign, read segment by segment.

    ``matrix`` is M of the first ``done`` samples. ``rows`` (n, n_theta + 1) holds their [psi, e], already weighted,
    ``motion`` (n, 2) their x and dx, and ``gradient`` (n, n_1) that of dx with respect to (a, b). ``work`` must not
    hold a re-run that is in progress. Once all samples have been read, ``end`` is the state after the last one, with
    every sign frozen, as in the rows.
    """

    def __init__(self, theta: Array, law: Law, record: Memory, work: Work):
        n, stop, self.n1 = theta.size, record.fill, int(law[0][0] - 1 + law[0][1])
        self.theta, self.law, self.record, self.done = theta, law, record, 0
        self.matrix = np.zeros((n + 1, n + 1))
        self.rows, self.motion, self.gradient = (np.empty((stop, k)) for k in (n + 1, 2, self.n1))
        self._work, self.end = work, work.trial_state
        work.at[AT] = work.at[PHASE] = 0.0
        self._nothing = Prior(theta, np.zeros((n, n)))
        nx = max(int(law[0][1]), 1)
        self._before = np.append(record.origin[:1], record.origin[nx : nx + self.n1])  # x(t-1) and its gradient

    def read_segment(self) -> None:
        """Read on to the end of a segment, which `add_segment` must then add; NaN if the model has diverged."""
        work, memory, first, m = self._work, self.record, self.done, self.record.u.shape[1]
        budget, work.at[BUDGET] = float(work.at[BUDGET]), 0.0  # read to the end of a segment, whatever it costs
        ended = refine_part(
            self.theta, self.law, np.inf, memory, self._nothing, 0, work.trial_information, work.trial_state, work
        )
        work.at[BUDGET] = budget
        self.done = memory.fill if ended else int(work.at[AT])
        self._segment = slice(first, self.done)
        if ended and work.at[COST] == np.inf:
            for values in (self.rows, self.motion, self.gradient):
                values[first:] = np.nan
            return
        n, past = self.done - first, work.segment.signals.shape[1] - LENGTH
        x = work.segment.signals[m : m + 1 + self.n1, past : past + n].T
        before = np.vstack([np.zeros_like(self._before) if memory.restart[first] else self._before, x[:-1]])
        self._before = x[-1].copy()
        self.rows[self._segment] = work.segment.psi[:, :n].T
        self.motion[self._segment, 0] = x[:, 0]
        self.motion[self._segment, 1] = x[:, 0] - before[:, 0]
        self.gradient[self._segment] = x[:, 1:] - before[:, 1:]

    def add_segment(self) -> None:
        """Weight the rows that were read last, and add them to M."""
        psi = self.rows[self._segment]
        psi *= np.sqrt(self.record.weights[self._segment, None])
        self.matrix += psi.T @ psi

    def doubt(self, covariance: Array | None, part: slice = slice(None)) -> Array:
        """|dx| of the samples in standard deviations; infinite if the ``covariance`` of (a, b) is not known."""
        dx, gradient = np.abs(self.motion[part, 1]), self.gradient[part]
        return np.full(dx.size, np.inf) if covariance is None else dx / deviation(gradient, covariance)

    def in_doubt(self, before: Array, doubt: Array) -> tuple[Indices, Indices]:
        """Choose the most doubtful of the unsettled signs of the past and of the signs of the memory in doubt.

        ``before`` and ``doubt``: |dx| of the one and of the other, in standard deviations.
        """
        counts = (self.record.weights != 0.0) & (self.motion[:, 1] != 0.0)
        kept, chosen = np.flatnonzero(before < SETTLED), np.flatnonzero((doubt < IN_DOUBT) & counts)
        if kept.size + chosen.size > CAPACITY:
            bar = np.sort(np.concatenate([before[kept], doubt[chosen]]))[CAPACITY]
            kept, chosen = kept[before[kept] < bar], chosen[doubt[chosen] < bar]
        return kept, chosen

    def heights(self, chosen: Indices) -> Array:
        """Value of each term at sign 1 at the samples ``chosen``, shape (E, K); zero for terms that do not jump."""
        _, codes, shapes = self.law
        x, dx = np.ascontiguousarray(self.motion[chosen].T)
        height = np.zeros((chosen.size, codes.size))
        for k, code in enumerate(codes.tolist()):
            if code in JUMPING:
                height[:, k] = law_values(codes[k : k + 1], shapes[k : k + 1], x, np.abs(dx), np.inf)[0]
        return height

    def entries(self, chosen: Indices, experiment: Integers, bent: Array, height: Array, first: int) -> Signs:
        """Entries for the samples ``chosen``, with their curvature ``bent`` and their `heights`.

        ``experiment`` is that of each sample, ``first`` the number of samples of the stream before the memory.
        """
        dx = self.motion[chosen, 1]
        after = chosen[:, None] + 1 + np.arange(int(self.law[0][2]))
        there = after < experiment.size
        later = np.where(there, NONE, -2 - first - after)
        after = np.where(there, after, 0)
        there &= experiment[after] == experiment[chosen][:, None]  # a sign has no effect after a restart
        entered = self.rows[after] * there[..., None]
        at = np.where(there, first + after, later)
        scale = np.sqrt(self.record.weights[chosen])
        return Signs(dx, np.sign(dx), scale, self.gradient[chosen], bent, height, entered, at)


def filtered(gradient: Array, restart: Bools, law: Law, theta: Array) -> Array:
    """F of all samples, shape (n, n_1), from rest at the start of each experiment.

    F before the first sample is unknown and taken as zero, so in a page that does not begin at rest the curvature at
    the first samples is too small.
    """
    n1 = gradient.shape[1]
    out = np.empty_like(gradient)
    _filter_gradients(gradient, restart, theta[n1 - law[0][1] : n1], out)
    return out


@njit(error_model="numpy", short=True)
def _filter_gradients(gradient, restart, b, out):
    since = 0
    for t in range(gradient.shape[0]):
        if restart[t]:
            since = 0
        for k in range(gradient.shape[1]):
            value = gradient[t, k]
            for j in range(min(b.size, since)):
                value -= b[j] * out[t - 1 - j, k]
            out[t, k] = value
        since += 1


def curvature(f: Array, experiment: Integers, law: Law, chosen: Indices) -> Array:
    """Second derivatives of dx with respect to (a, b) at the samples ``chosen`` from F, shape (E, n_1, n_1)."""
    n1, nb = f.shape[1], int(law[0][1])
    bent = np.zeros((chosen.size, n1, n1))
    for j in range(nb):
        before = chosen - 1 - j
        there = before >= 0
        there &= experiment[before] == experiment[chosen]
        term = f[before] * there[:, None]
        bent[:, :, n1 - nb + j] -= term
        bent[:, n1 - nb + j, :] -= term
    return bent


# --- what the state of a stream keeps of earlier pages, and the samples in memory together with it ------------------
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


def linearisation(state: State, r: Settings, theta: Array, weights: Array, work: Work) -> Linearisation:
    """The first samples in memory, as many as there are ``weights`` after forgetting, to be linearised at ``theta``."""
    origin = origin_at(state["past_origin"], r.dims, theta - state["past_theta"])
    return Linearisation(theta, r.law, memory_of(state, r, weights.size, weights, origin, tail=1), work)


def with_past(page: Linearisation, state: State, s: int, left: float, count: float) -> tuple[Array, float]:
    """M and the number of samples for past and memory together.

    ``left`` is the weight of the past after forgetting, ``count`` the number of samples of the memory.
    """
    if state["past_count"][0] > 0.0:
        matrix = moved(state["past_matrix"], page.theta - state["past_theta"])
        return page.matrix + left * matrix, count + left * float(state["past_count"][0])
    # P0, as the information that the re-run of the memory uses
    matrix = np.zeros_like(page.matrix)
    matrix[:-1, :-1] = left * state["prior_information"][s]
    return page.matrix + moved(matrix, page.theta - state["prior_theta"][s]), count
