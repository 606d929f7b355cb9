"""What the posterior of a stream consists of: the samples in memory, and a summary of the earlier pages.

When a page is turned, M is kept, linearised at the parameters of that time, together with the signs that
are still in doubt.  Both can be moved to another theta_0, because e is linear while no sign flips and dx is
expanded to second order: M -> T' M T with T = [I; -delta'], dx += g' delta + delta' H delta / 2, g += H delta.
The posterior of a stream of any length therefore costs no more than that of its memory.  It is computed on
request (`whsklearn.recursion.memory.multistart.posterior`), not at every sample.
"""

from __future__ import annotations

import numpy as np

from whsklearn.effects.base import Array, Integers
from whsklearn.recursion.memory.gauss_newton import Work
from whsklearn.recursion.memory.linearised import CAPACITY, JUMPING, Linearisation, Signs
from whsklearn.recursion.memory.refit import memory_of
from whsklearn.recursion.memory.settings import Settings, State
from whsklearn.recursion.rows.predictor import state_size


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
