"""The default method as a stream: several starts in parallel, and a memory of bounded length.

State in, state out: `initial_state` makes the arrays, `run` processes samples, `consolidate`
re-linearises the memory, and `answer` selects the model to report.  A run may be divided anywhere,
because every schedule depends only on the number of samples seen.

With ``memory = 0`` this is the pure recursion.  With a memory, its first ``memory`` samples are
re-run at instants that grow geometrically.  Poor starts are dropped there and fresh ones drawn,
so that one model is left when the memory is full.  After that, each full block is re-run once,
with everything before it as a prior.  All of this is done in parts, so that no sample has to wait
for it (`schedule`).
"""

from __future__ import annotations

import copy

import numpy as np
from numpy.typing import NDArray

from whsklearn.recursion.memory.gauss_newton import new_work
from whsklearn.recursion.memory.linearised import CAPACITY, initial_past, linearisation
from whsklearn.recursion.memory.refit import LIVE, left_of, left_of_prior, number_of
from whsklearn.recursion.memory.schedule import BackgroundRefit, in_one, joined, refit_now, schedule, under_way
from whsklearn.recursion.memory.settings import Settings, State
from whsklearn.recursion.memory.sign_posterior import Gaussian, frozen, posed, sample
from whsklearn.recursion.memory.starts import random_start
from whsklearn.recursion.rows.covariance import WIND_UP, inflate
from whsklearn.recursion.rows.predictor import state_size
from whsklearn.recursion.rows.subinnovations import MOVING, STILL, Models, Samples, Schedule, mark_still, run_windows

__all__ = ["Settings", "State", "answer", "consolidate", "forget_past", "initial_state", "posterior", "run"]

PURE_SHARPEST = 80.0  # without re-runs, a sharper sign loses more starts than it gains in accuracy


def initial_state(r: Settings) -> State:
    """State arrays of a stream before the first sample."""
    n, m, h = r.size, r.memory, r.history
    room = r.page_end if m else 0
    rng = np.random.default_rng([r.seed, 0])
    n_models = 1 if m else r.n_starts
    theta = np.array([random_start(tuple(r.dims), rng) for _ in range(n_models)])
    if m:
        theta[:] = 0.0  # predicts zero until the first re-run draws the starts on the record itself
    if r.theta0 is not None:
        theta[0] = r.theta0
    return {
        "seen": 0,
        "since": 0,
        "repeats": np.zeros(2, dtype=np.int64),
        "known": np.zeros(1),  # number of samples that the estimate rests on, after forgetting
        "page_known": 0.0,
        "oblivion": 1.0,  # weight of the past when the next sample arrives
        "theta": theta,
        "ud": np.repeat(np.eye(n)[None] * r.p0, n_models, axis=0),
        "before": np.zeros((n_models, state_size(r.dims))),
        "loss": np.zeros((n_models, 2)),
        "motion": np.zeros((n_models, 2)),
        "sharpness": np.ones(n_models),
        "recent_u": np.zeros((r.p + h) * r.n_inputs),
        "recent_y": np.zeros(r.p + h),
        "recent_weight": np.ones(r.p + h),
        # the pure recursion forgets its first estimates; a re-run corrects them instead
        "forgetting": np.array([r.forgetting if m else min(0.95, r.forgetting), r.forgetting, 0.99]),
        "ceiling": WIND_UP * r.p0,
        "memory_u": np.zeros((h + room, r.n_inputs)),
        "memory_y": np.zeros(h + room),
        "memory_restart": np.zeros(room, dtype=bool),
        "memory_still": np.zeros(room, dtype=bool),
        "memory_idle": np.zeros(room, dtype=bool),
        "memory_kept": np.ones(room),
        "memory_weight": np.ones(room),
        "fill": 0,
        "blocks": 0,
        "origin": np.zeros((n_models, state_size(r.dims))),
        "page_theta": theta.copy(),
        "prior_theta": theta.copy(),
        "prior_information": np.zeros((n_models, n, n)),
        **initial_past(r),
    }


def run(
    state: State, r: Settings, u: NDArray[np.float64], y: NDArray[np.float64], restart: NDArray[np.bool_],
    page: BackgroundRefit | None = None, weight: NDArray[np.float64] | None = None,
) -> BackgroundRefit | None:  # fmt: skip
    """Run the state through samples, in place; ``restart`` marks where an experiment begins.

    ``weight`` is the weight of each sample's squared error; by default all are one.

    Returns the page re-run in progress; pass it in again with the next samples so that it need not start over.
    """
    state["forgetting"][1] = r.forgetting
    if r.memory:
        state["forgetting"][0] = r.forgetting
    at = 0
    weight = np.ones(y.size) if weight is None else weight
    while at < y.size:
        if restart[at]:
            _begin_experiment(state)
        stop = at + 1
        if stop < y.size:
            stop = _first(restart, stop, min(y.size, at + _until_event(state, r)))
        still = np.empty(stop - at, dtype=np.uint8)
        mark_still(
            state["repeats"], state["recent_u"], state["recent_y"], state["known"], r.forgetting, u[at:stop],
            y[at:stop], still,
        )  # fmt: skip
        samples = Samples(u[at:stop], y[at:stop], weight[at:stop])
        _remember(state, r, samples, still, bool(restart[at]))
        models = Models(*(state[name][: LIVE if r.memory else None] for name in Models._fields))
        recent = Samples(state["recent_u"], state["recent_y"], state["recent_weight"])
        schedule = Schedule(state["forgetting"], state["ceiling"], 0.0 if r.memory else PURE_SHARPEST)
        state["since"] = run_windows(
            models, recent, state["since"], state["seen"], schedule, r.law, r.p, r.frozen, samples, still
        )
        state["seen"] += stop - at
        if r.memory:
            page = _tend_memory(state, r, page, stop - at)
        at = stop
    return page


def _first(marked: NDArray[np.bool_], start: int, stop: int) -> int:
    """Index of the first marked sample from ``start`` on, or ``stop`` if there is none before it."""
    found = start + int(marked[start:stop].argmax()) if start < stop else stop
    return found if found < stop and marked[found] else stop


def consolidate(state: State, r: Settings, page: BackgroundRefit | None = None) -> None:
    """Re-run the memory now, in place; a page whose re-run is in progress is turned first."""
    if state["fill"] >= r.memory:
        _the_refit(state, r, page, schedule(r, filling=False)[0]).take_over()
    refit_now(state, r)


def settled(state: State, r: Settings) -> State:
    """A copy whose memory has been re-run."""
    state = copy.deepcopy(state)
    consolidate(state, r)
    return state


def is_silent(state: State) -> bool:
    """Whether no start has been tried yet: the first re-run, which begins with P0, has not taken over."""
    return not state["prior_information"].any()


def _tend_memory(state: State, r: Settings, refit: BackgroundRefit | None, n_new: int) -> BackgroundRefit | None:
    """Begin, continue or end a re-run of the memory, as needed after ``n_new`` samples."""
    now = under_way(state, r)
    if now is not None:
        refit = _the_refit(state, r, refit, now)
        if state["fill"] < now[1]:
            refit.advance(n_new)
            return refit
        refit.take_over()
    if state["fill"] in [begin for begin, _ in schedule(r, not state["blocks"])]:
        state["page_theta"], state["page_known"] = state["theta"].copy(), float(state["known"][0])
    return None


def _the_refit(state: State, r: Settings, refit: BackgroundRefit | None, now: tuple[int, int]) -> BackgroundRefit:
    """The re-run in progress, or a new one."""
    return refit if refit is not None and refit.is_of(state, now[0]) else BackgroundRefit(state, r, *now)


def _begin_experiment(state: State) -> None:
    """Forget the past signals; parameters and covariance are kept."""
    state["since"] = 0
    state["repeats"][:] = 0
    for name in ("before", "recent_u", "recent_y"):
        state[name][:] = 0.0


def _until_event(state: State, r: Settings) -> int:
    """Number of samples until a re-run next begins or ends."""
    if not r.memory:
        return np.iinfo(np.int64).max
    fill = state["fill"]
    return min([i for span in schedule(r, not state["blocks"]) for i in span if i > fill]) - fill


def _remember(state: State, r: Settings, samples: Samples, still: NDArray[np.uint8], restarts: bool) -> None:
    """Append samples to the memory."""
    if not r.memory:
        return
    u, y, weight = samples
    first, h, n = state["fill"], r.history, y.size
    if n == 1:  # the same for one sample, because slices would cost as much as its update
        state["memory_u"][h + first] = u[0]
        state["memory_y"][h + first] = y[0]
        state["memory_weight"][first] = weight[0]
        state["memory_still"][first] = still[0] == STILL
        state["memory_idle"][first] = still[0] != MOVING
        state["memory_kept"][first] = state["forgetting"][1] if still[0] == MOVING else 1.0
    else:
        state["memory_u"][h + first : h + first + n] = u
        state["memory_y"][h + first : h + first + n] = y
        state["memory_weight"][first : first + n] = weight
        state["memory_still"][first : first + n] = still == STILL
        state["memory_idle"][first : first + n] = still != MOVING
        state["memory_kept"][first : first + n] = np.where(still == MOVING, state["forgetting"][1], 1.0)
    state["memory_restart"][first] = restarts
    state["memory_kept"][first] *= state["oblivion"]
    state["oblivion"] = 1.0
    state["fill"] += n


def forget_past(state: State, samples: float) -> None:
    """Reduce the weight of the past to at most ``samples`` samples, in P and in the memory."""
    left = min(1.0, samples / max(float(state["known"][0]), 1e-300))
    state["known"] *= left
    state["oblivion"] *= left
    for ud in state["ud"]:
        inflate(ud, 1.0 / left, state["ceiling"])


def answer(state: State) -> int:
    """Index of the model with the least innovation variance."""
    return int(np.argmin(state["loss"][:, 0] / np.maximum(state["loss"][:, 1], 1e-300)))


# --- the posterior of a model: linearised anew where the mean is, until it stays -------------------------------------
ROUNDS = 3  # linearisations of the memory at least; the second is at the mean of the first
# Most linearisations made while the mean still moves.  A record with 500 signs in doubt needed five; with fewer, its
# mean fitted worse than the start (benchmarks/accuracy.py --section systems, seed 35: ten times the error).
MOST_ROUNDS = 16
# The mean counts as moving if it changes by more than this many standard deviations in a round; sampling alone changes
# it by a tenth.  Along a pole that a zero nearly cancels it moves slowly: with 0.5 here, seed 21 of these systems ended
# ten standard deviations off.
MOVED = 0.25
# The first rounds only find where to linearise, and a few sweeps are enough for that; with 500 signs in doubt they
# were the most expensive ones.  Once a step is below this many standard deviations, rounds use all sweeps.
NEAR = 0.5
# After this many rounds a mean that still takes longer steps is accepted, after one more round with all sweeps.  Of
# 250 random systems (benchmarks/accuracy.py --section systems, seeds 0 to 249) 248 finished within six rounds in all;
# if the record does not determine the parameters, the mean never settles.
MOST_ROUGH = 8
WORSE = 1.02  # ratio of squared errors at the mean to those at theta_0 above which the linearisation is not valid


def posterior(state: State, r: Settings, s: int) -> Gaussian | None:
    """Mean and covariance of the parameters of model ``s`` from all samples, or None if there is no posterior.

    Where a page had more signs in doubt than are kept, the rest counts as settled, and the summary is blind to those
    that turn; where samples are forgotten, it may be of other parameters than those of now.  The mean then has to fit
    the memory as well as ``theta``: with noise at the output, 12 % more was left, and after a long rest the error of
    the mean was 0.9, that of ``theta`` 0.1 (benchmarks/endurance.py).
    The state is not changed, and the same state always gives the same numbers.
    """
    theta, best, fill = state["theta"][s], np.inf, state["fill"]
    left, own = left_of(state, fill), state["memory_weight"][:fill]
    is_doubtful = np.count_nonzero(state["signs"][:, 2]) == CAPACITY
    is_doubtful |= bool(np.any(state["memory_kept"][:fill] < 1.0))
    answer: Gaussian | None = None
    found: Gaussian | None = None
    near = still = False
    rng = np.random.default_rng([r.seed, 1, state["seen"]])
    for k in range(MOST_ROUNDS + 1):
        if not np.isfinite(theta).all():
            break
        memory = linearisation(state, r, theta.copy(), left * own, new_work(r.dims, r.n_inputs))
        while memory.done < fill:
            memory.read_segment()
            memory.add_segment()
        matrix, signs, count = in_one(
            joined(memory, state, r, s, left_of_prior(state, fill), number_of(left, own), found)
        )
        if not np.isfinite(matrix).all():
            break
        best = min(best, matrix[-1, -1])
        in_memory = memory.matrix[-1, -1]
        if found is None:
            at_theta = in_memory
        elif matrix[-1, -1] < WORSE * best and (not is_doubtful or in_memory < WORSE * at_theta):
            answer = found  # the mean, found with signs and slopes at another point, fits the record here as well
            if k >= ROUNDS and still:
                break
        if k == MOST_ROUNDS or (k > MOST_ROUGH and not near):
            break
        # with no sign in doubt, least squares here gives the posterior
        start = (signs.dx.size and found) or frozen(matrix, theta, count)
        rough = not near and k < MOST_ROUGH
        found = start and sample(posed(matrix, theta, r.dims, count, signs), start, rng, rough=rough)
        if found is None:
            break
        step = float(np.max(np.abs(found.mean - theta) / np.sqrt(np.diag(found.covariance))))
        near, still = step < NEAR, step < MOVED and not rough
        theta = found.mean
    return answer
