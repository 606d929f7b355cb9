"""The default reading as a stream: several starts side by side, and a memory of bounded length.

State in, state out: `initial_state` makes the arrays, `run` takes them through samples,
`consolidate` re-linearises the memory, `answer` picks the model that speaks.  A run may be
cut anywhere; everything scheduled is scheduled on samples seen.

With ``memory = 0`` this is the pure recursion.  With a memory, the samples of the first
``memory`` are re-run at instants that grow geometrically: poor starts are dropped there and
fresh ones drawn, so that by the time it is full one or two models go on.  After that each
full block is re-run once, with all that came before it as a prior.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from whsklearn.recursion.consolidation import replay
from whsklearn.recursion.covariance import WIND_UP
from whsklearn.recursion.predictor import state_size
from whsklearn.recursion.reading import Reading, State
from whsklearn.recursion.rerun import consolidate
from whsklearn.recursion.starts import random_start
from whsklearn.recursion.subinnovations import run_windows

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["Reading", "State", "answer", "consolidate", "initial_state", "run"]

GROWTH = 1.25  # ratio of successive re-runs: an answer is never older than a fifth of the record
PURE_SHARPEST = 80.0  # without re-runs a sharper sign loses more starts than it gains accuracy


def initial_state(r: Reading) -> State:
    """Arrays of a stream that has seen nothing."""
    n, m, h = r.size, r.memory, r.history
    rng = np.random.default_rng([r.seed, 0])
    n_models = 1 if m else r.n_starts
    theta = np.array([random_start(tuple(r.dims), rng) for _ in range(n_models)])
    if m:
        theta[:] = 0.0  # silent until the first re-run draws the starts on the record itself
    if r.theta0 is not None:
        theta[0] = r.theta0
    return {
        "seen": 0,
        "since": 0,
        "theta": theta,
        "ud": np.repeat(np.eye(n)[None] * r.p0, n_models, axis=0),
        "before": np.zeros((n_models, state_size(r.dims))),
        "loss": np.zeros((n_models, 2)),
        "motion": np.zeros((n_models, 2)),
        "sharpness": np.ones(n_models),
        "recent_u": np.zeros((r.p + h) * r.n_inputs),
        "recent_y": np.zeros(r.p + h),
        # the pure recursion forgets its beginnings, a re-run mends them instead
        "forgetting": np.array([r.forgetting if m else min(0.95, r.forgetting), r.forgetting, 0.99]),
        "ceiling": WIND_UP * r.p0,
        "memory_u": np.zeros((h + m, r.n_inputs)),
        "memory_y": np.zeros(h + m),
        "memory_restart": np.zeros(m, dtype=bool),
        "fill": 0,
        "blocks": 0,
        "origin": np.zeros((n_models, state_size(r.dims))),
        "prior_theta": theta.copy(),
        "prior_information": np.zeros((n_models, n, n)),
    }


def run(state: State, r: Reading, u: NDArray[np.float64], y: NDArray[np.float64], restart: NDArray[np.bool_]) -> None:
    """Take the state through samples, in place; ``restart`` marks where an experiment begins."""
    at = 0
    while at < y.size:
        if restart[at]:
            _begin_experiment(state)
        stop = at + 1
        limit = min(y.size, at + _until_event(state, r))
        while stop < limit and not restart[stop]:
            stop += 1
        _remember(state, r, u[at:stop], y[at:stop], bool(restart[at]))
        state["since"] = run_windows(
            state["theta"], state["ud"], state["before"], state["loss"], state["motion"], state["recent_u"],
            state["recent_y"], state["since"], state["seen"], state["forgetting"], state["ceiling"], state["sharpness"],
            0.0 if r.memory else PURE_SHARPEST, *r.law, r.p, r.frozen, u[at:stop], y[at:stop],
        )  # fmt: skip
        state["seen"] += stop - at
        if r.memory and state["fill"] in _instants(state, r):
            consolidate(state, r)
        if r.memory and state["fill"] == r.memory:
            _turn_page(state, r)
        at = stop


def _begin_experiment(state: State) -> None:
    """Nothing is known of the past; parameters and covariance stay."""
    state["since"] = 0
    for name in ("before", "recent_u", "recent_y"):
        state[name][:] = 0.0


def _instants(state: State, r: Reading) -> list[int]:
    """Fills of the memory at which it is re-run."""
    if state["blocks"]:
        return [r.memory // 2, r.memory]
    instants, at = [], float(r.first_rerun)
    while at < r.memory:
        instants.append(int(at))
        at *= GROWTH
    return [*instants, r.memory]


def _until_event(state: State, r: Reading) -> int:
    """Samples to the next re-run."""
    if not r.memory:
        return np.iinfo(np.int64).max
    return min(i for i in _instants(state, r) if i > state["fill"]) - state["fill"]


def _remember(state: State, r: Reading, u: NDArray[np.float64], y: NDArray[np.float64], restarts: bool) -> None:
    """Append samples to the memory."""
    if not r.memory:
        return
    first = r.history + state["fill"]
    state["memory_u"][first : first + y.size] = u
    state["memory_y"][first : first + y.size] = y
    state["memory_restart"][state["fill"]] = restarts
    state["fill"] += y.size


def _turn_page(state: State, r: Reading) -> None:
    """Start a new block: what the old one says becomes the prior."""
    fill, h = state["fill"], r.history
    for s in range(len(state["theta"])):
        information, slope = np.zeros((r.size, r.size)), np.zeros(r.size)
        end = np.empty_like(state["origin"][s])
        replay(
            state["theta"][s], *r.law, state["sharpness"][s], state["origin"][s], state["memory_u"],
            state["memory_y"], state["memory_restart"], fill, h, 1, r.forgetting, information, slope, end,
        )  # fmt: skip
        decay = r.forgetting**fill
        state["prior_information"][s] = information + decay * state["prior_information"][s]
        state["prior_theta"][s] = state["theta"][s]
        state["origin"][s] = end
    for name in ("memory_u", "memory_y"):
        state[name][:h] = state[name][fill : fill + h]
        state[name][h:] = 0.0
    state["memory_restart"][:] = False
    state["fill"] = 0
    state["blocks"] += 1


def answer(state: State) -> int:
    """Index of the model with the least innovation variance."""
    return int(np.argmin(state["loss"][:, 0] / np.maximum(state["loss"][:, 1], 1e-300)))
