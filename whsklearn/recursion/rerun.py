"""Re-running the memory: starts are drawn, sharpened, compared, and the best go on."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from whsklearn.recursion.consolidation import refine_part
from whsklearn.recursion.covariance import factorise
from whsklearn.recursion.predictor import motion
from whsklearn.recursion.replay import AT, BUDGET, COST, HEAD, PHASE, UNBOUNDED, work_size
from whsklearn.recursion.starts import least_squares_start, random_start, term_scales
from whsklearn.recursion.subinnovations import relative_sharpness

if TYPE_CHECKING:
    from collections.abc import Generator

    from numpy.typing import NDArray

    from whsklearn.recursion.reading import Reading, State

    Array = NDArray[np.float64]
    Record = tuple[Array, Array, NDArray[np.bool_]]

LADDER = (1.0, 2.0, 4.0, 8.0, 20.0, 50.0, 100.0, 200.0, 400.0)
ITERATIONS = 8
REOPENING = 100.0  # how far forgetting may widen P beyond its widest direction at the last re-run, at least
LEAST = 1e-9
FEWEST = 40.0  # samples: or as wide as it was when so few were known
SLACK = 1.01  # of the error: on a staircase a better estimate may stand a stair higher
INFERENCE = 20.0  # sharpness at which P is taken: intervals cover there (benchmarks/accuracy.py)
LONG_INFERENCE = 150.0  # the same once the memory is full, where sharper costs coverage of L1 and blunter its accuracy


@dataclass
class _Candidate:
    """A model after a re-run of the memory."""

    cost: float
    theta: NDArray[np.float64]
    information: NDArray[np.float64]
    before: NDArray[np.float64]
    sharpness: float
    parent: int


def consolidate(state: State, r: Reading) -> None:
    """Re-run the memory for every model and for fresh starts; the best go on, in place."""
    fill = state["fill"]
    record = (
        state["memory_u"][r.history :][:fill],
        state["memory_y"][r.history :][:fill],
        state["memory_restart"][:fill],
    )
    if not fill or np.ptp(record[1]) == 0.0:
        return  # an axis at rest shows nothing
    first_block = not state["blocks"]
    climb = climb_to(relative_sharpness(state["seen"], LADDER[-1]))
    rng = np.random.default_rng([r.seed, state["seen"]])
    if first_block and not state["prior_information"].any():
        scales = term_scales(r.law, *record, rng)
        _set_prior(state, r, scales, record[1])
        tasks = [(0, theta, climb) for theta in _fresh(r, r.n_starts, scales, record, rng)]
        if r.theta0 is not None:
            tasks.append((0, r.theta0, climb))
    else:
        # few models are worth the whole climb: a blunt rung may end on a lower step of the staircase
        rungs = climb if first_block and len(state["theta"]) <= 2 else climb[-2:]
        tasks = [(s, theta, rungs) for s, theta in enumerate(state["theta"])]
        if first_block and fill <= r.memory // 2:
            scales = term_scales(r.law, *record, rng)
            tasks += [(0, theta, climb) for theta in _fresh(r, r.n_starts // 8, scales, record, rng)]
    weights = weights_of(state, fill)
    chosen = best_first([_rerun(state, r, *task, record[0], record[2], weights) for task in tasks])
    if chosen:
        keep = max(1, r.n_starts * r.first_rerun // (2 * fill)) if first_block else len(chosen)
        chosen = chosen[:keep]
        parents = [c.parent for c in chosen]
        for name in ("origin", "prior_theta", "prior_information"):
            state[name] = state[name][parents].copy()
        state.update(adopted(chosen, weights.sum(), float(state["known"][0])))
        state["page_theta"] = state["theta"].copy()


def climb_to(sharpest: float) -> list[float]:
    """The rungs of the ladder below ``sharpest``, and that."""
    return [k for k in LADDER if k < sharpest] + [sharpest]


def _fresh(r: Reading, count: int, scales: Array, record: Record, rng: np.random.Generator) -> list[Array]:
    """Starts of two kinds in turn: all random, and least squares given a random L1."""
    thetas = [random_start(tuple(r.dims), rng, scales) for _ in range(count)]
    return [least_squares_start(t, r.law, *record) if i % 2 == 0 else t for i, t in enumerate(thetas)]


def _set_prior(state: State, r: Reading, scales: Array, y: Array) -> None:
    """P0 becomes information: about what each parameter can contribute to the output."""
    n1 = r.dims[0] - 1 + r.dims[1]
    power = np.mean(y**2)  # not the variance, which an output that stands still has none of
    information = np.full(r.size, power / r.p0)
    information[n1 : n1 + r.dims[4]] = power / scales**2 / r.p0
    state["prior_information"] = np.diag(information)[None]
    state["prior_theta"] = np.zeros((1, r.size))


def _rerun(
    state: State, r: Reading, parent: int, theta: Array, steps: list[float], u: Array, restart: NDArray[np.bool_],
    weights: Array,
) -> _Candidate | None:  # fmt: skip
    """`rerun_in_parts` in one."""
    work = np.zeros(work_size(r.dims, state["before"].shape[1]))
    work[BUDGET] = UNBOUNDED
    steps_taken = rerun_in_parts(state, r, parent, theta, steps, u, restart, weights, work)
    while True:
        try:
            next(steps_taken)
        except StopIteration as end:
            return end.value


def rerun_in_parts(
    state: State, r: Reading, parent: int, theta: Array, steps: list[float], u: Array, restart: NDArray[np.bool_],
    weights: Array, work: Array,
) -> Generator[None, None, _Candidate | None]:  # fmt: skip
    """Sharpen one model rung by rung; the rung with the least error under the true sign counts.

    Yields whenever the budget in ``work`` is spent.

    A search of the staircase itself, sample by sample, was tried: it lowers the error on the
    record and raises it on others (50 random systems: 1.6 times, against 1.2 for the rungs).
    """
    theta = theta.copy()
    n, n_state = r.size, state["before"].shape[1]
    n1 = int(r.dims[0] - 1 + r.dims[1])
    prior = state["prior_information"][parent] * (left_of_prior(state, weights.size) if state["blocks"] else 1.0)
    shared = (
        state["origin"][parent], state["memory_u"], state["memory_y"], state["memory_restart"], weights.size,
        r.history, r.p, weights, state["prior_theta"][parent], prior,
    )  # fmt: skip

    def refined(kappa: float, iterations: int, information: Array, before: Array) -> Generator[None, None, float]:
        work[AT] = work[PHASE] = 0
        while not refine_part(theta, *r.law, kappa, *shared, iterations, information, before, work):
            yield
        return float(work[COST])

    best = None
    for relative in steps:
        kappa = relative / max(motion(theta, r.dims, u, restart), 1e-12)
        information, before = np.zeros((n, n)), np.zeros(n_state)
        yield from refined(kappa, ITERATIONS, information, before)
        cost = yield from refined(np.inf, 0, np.zeros((n, n)), before)
        if np.isfinite(cost) and np.isfinite(information).all() and (best is None or cost < best.cost):
            best = _Candidate(cost, theta.copy(), information, before, kappa, parent)
    if best is not None:
        moves = max(motion(best.theta, r.dims, u, restart), 1e-12)
        theta = best.theta.copy()
        if not state["blocks"] and weights.size < r.memory:
            yield from refined(INFERENCE / moves, 0, best.information, np.empty(n_state))
            return best
        # A record this long shows what tanh() near zero adds to the weights: they are fitted with the error of the sign
        # itself, and only the slopes are of a smooth one.  L1 stays on the stair it found.
        for step in range(3):
            information, before = np.zeros((n, n)), np.zeros(n_state)
            cost = yield from refined(-LONG_INFERENCE / moves, 0, information, before)
            if not np.isfinite(information).all() or (step and not cost < SLACK * best.cost):
                break
            best = _Candidate(cost, theta.copy(), information, before, best.sharpness, parent)
            theta[n1:] += _inverse(information[n1:, n1:]) @ work[HEAD + n1 : HEAD + n]
    return best


def best_first(found: list[_Candidate | None]) -> list[_Candidate]:
    """Candidates by their cost, without those that ended in the same minimum as a better one."""
    kept: list[_Candidate] = []
    for c in sorted((c for c in found if c is not None), key=lambda c: c.cost):
        if all(abs(c.cost - k.cost) > 1e-4 * k.cost for k in kept):
            kept.append(c)
    return kept


def weights_of(state: State, fill: int) -> Array:
    """What forgetting has left of each of the first ``fill`` samples of the memory; nothing of those that stood still.

    The factors are those that held when the samples came, so a re-run forgets what the recursion forgot.
    """
    kept = state["memory_kept"][:fill]
    left = np.cumprod(np.append(kept[1:], 1.0)[::-1])[::-1]
    return np.where(state["memory_still"][:fill], 0.0, left)


def inference_sharpness(theta: Array, r: Reading, u: Array, restart: NDArray[np.bool_]) -> float:
    """At which a long record says how much it knows: the sign's error, a smooth one's slope."""
    return -LONG_INFERENCE / max(float(motion(theta, r.dims, u, restart)), 1e-12)


def left_of_prior(state: State, fill: int) -> float:
    """What forgetting has left of what was known before the memory; never so little that nothing holds P."""
    return max(float(np.prod(state["memory_kept"][:fill])), LEAST)


def adopted(chosen: list[_Candidate], weight: float, known: float) -> State:
    """What the state holds of the chosen models at the end of the samples they were re-run on."""
    ud = np.array([factorise(_inverse(c.information)) for c in chosen])
    return {
        "theta": np.array([c.theta for c in chosen]),
        "before": np.array([c.before for c in chosen]),
        "sharpness": np.array([c.sharpness for c in chosen]),
        "loss": np.array([[c.cost, max(weight, 1.0)] for c in chosen]),
        "motion": np.zeros((len(chosen), 2)),
        "ud": ud,
        # far from where it was learnt the model is another one: after an idle spell P must not be wide open
        "ceiling": float(max(REOPENING, known / FEWEST) * ud.diagonal(axis1=1, axis2=2).max()),
    }


def _inverse(information: NDArray[np.float64]) -> NDArray[np.float64]:
    """Inverse of a symmetric positive definite matrix of any scaling."""
    scale = 1.0 / np.sqrt(np.maximum(np.diag(information), 1e-200))
    values, vectors = np.linalg.eigh(information * np.outer(scale, scale))
    inverse = (vectors / np.maximum(values, 1e-13)) @ vectors.T
    return inverse * np.outer(scale, scale)
