"""A search over the memory: which starts there are, how sharp the sign is, which models continue, what they take over.

`whsklearn.recursion.memory.schedule` runs it, in parts where samples arrive meanwhile.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from whsklearn._numba import njit
from whsklearn.effects.base import Array
from whsklearn.recursion.memory.gauss_newton import HUGE, Memory
from whsklearn.recursion.memory.settings import Settings, State
from whsklearn.recursion.rows.covariance import factors_of_inverse

# kappa times the root mean square of dx; at the last value about 1 sample in 400 lies within the smoothed sign
LADDER = (1.0, 2.0, 4.0, 8.0, 20.0, 50.0, 100.0, 200.0, 400.0)
ITERATIONS = 8
EARLY_ITERATIONS = 5  # per rung while the memory fills and time is short; the next rung continues from there anyway
REOPENING = 100.0  # forgetting may always inflate P to this many times its largest pivot at the last re-run
LEAST = 1e-9
FEWEST = 40.0  # or to what P was when only this many samples were known
SLACK = 1.01  # factor on the error: on a staircase a better estimate may be one step higher
INFERENCE = 20.0  # sharpness at which P is evaluated: the intervals have their coverage there (benchmarks/accuracy.py)
# The same for a full memory; sharper costs coverage of L1, blunter costs accuracy.  There the information is taken with
# the error of the true sign and the slope of a smooth one (a negative sharpness).
LONG_INFERENCE = 150.0
LIVE = 2  # models updated at every sample; the others wait for the next re-run, which starts from their parameters
KEPT_SHARE = 0.62  # share of the starts that continue after the first re-run; fewer at each later one
FRESH_IN_STREAM = 2  # initial starts per fresh start, at each re-run in the background
# If there is time, fresh starts are drawn until this many have ended in the best minimum, but no more than there were
# initially.  With an eighth of the initial number, whatever they found, 3 of 400 random systems kept a wrong minimum,
# whose free run is a thousand times worse (benchmarks/accuracy.py, seeds 3000 to 3399).  With two confirmations it was
# 1 of these, and 1 of another 200 (6600 to 6799); with four it was none of the 200, but 54091 had 60 times PEM's NMSE,
# where four of 32 starts reach a wrong minimum before the first reaches the right one.
CONFIRMED = 8


class Refined(NamedTuple):
    """A model after a re-run of the memory."""

    cost: float
    theta: Array
    information: Array
    before: Array
    sharpness: float
    parent: int


def climb_to(sharpest: float) -> list[float]:
    """The rungs of the ladder up to ``sharpest``, without rungs so close that the second would add nothing."""
    return [k for k in LADDER if 1.5 * k < sharpest] + [sharpest]


def long_strides(climb: list[float]) -> list[float]:
    """The first rung, one in between and the last, for starts that are tried while a stream runs.

    On 128 to 256 samples of Example 5.1 such starts reach the right minimum four times in 100,000 samples re-run;
    starts that take every rung reach it 2.6 times.
    """
    return climb[:1] + climb[2:-1][:1] + climb[-1:]


def reached(found: list[Refined | None], carried: int) -> int:
    """How many candidates behind the first ``carried`` are in the best minimum of all."""
    costs = [np.inf if c is None else c.cost for c in found]
    bound = SLACK * min(costs, default=np.inf)
    return sum(cost <= bound < np.inf for cost in costs[carried:])


def best_first(found: list[Refined | None]) -> list[Refined]:
    """Candidates in order of cost, without those that ended in the same minimum as a better one."""
    kept: list[Refined] = []
    for c in sorted((c for c in found if c is not None), key=lambda c: c.cost):
        if not kept or c.cost - kept[-1].cost > 1e-4 * kept[-1].cost:  # the last one kept is the closest in cost
            kept.append(c)
    return kept


def memory_of(state: State, r: Settings, size: int, weights: Array, origin: Array, tail: int) -> Memory:
    """The first ``size`` samples in memory, in the form that the kernels take."""
    return Memory(origin, state["memory_u"], state["memory_y"], state["memory_restart"], size, r.history, tail, weights)


def left_of(state: State, fill: int) -> Array:
    """Weight after forgetting of each of the first ``fill`` samples of the memory; zero for samples at standstill.

    The forgetting factors are those in use when the samples arrived, so a re-run forgets as much as the recursion did.
    """
    left: Array = np.ones(fill)
    left[:-1] = state["memory_kept"][1:fill]
    _multiply_back(left)
    left[state["memory_still"][:fill]] = 0.0
    return left


@njit(error_model="numpy")
def _multiply_back(left):
    """Set each entry to the product from it to the last one; ``cumprod`` takes 50 us to start if rarely called."""
    for t in range(left.size - 2, -1, -1):
        left[t] *= left[t + 1]


def number_of(left: Array, weight: Array) -> float:
    """Number of samples, after forgetting and whatever their own ``weight``, unless that is zero."""
    return float(left[weight > 0.0].sum())


def left_of_prior(state: State, fill: int) -> float:
    """Weight after forgetting of the information from before the memory, bounded below so that P stays bounded."""
    return max(float(np.prod(state["memory_kept"][:fill])), LEAST)


def factors_of(chosen: list[Refined]) -> list[Array]:
    """U D U' of the covariances of the live models."""
    return [factors_of_inverse(c.information) for c in chosen[:LIVE]]


def adopted(chosen: list[Refined], live: list[Array], count: float, known: float) -> State:
    """State entries of the chosen models at the end of the samples on which they were re-run.

    Models that wait for the next re-run have no P of their own and are never chosen for the answer.
    """
    ud = np.array([live[min(i, len(live) - 1)] for i in range(len(chosen))])
    # far from where it was learnt the linearised model is wrong, so P must not be too large after an idle period
    ceiling = float(max(REOPENING, known / FEWEST) * ud.diagonal(axis1=1, axis2=2).max())
    return {
        "theta": np.array([c.theta for c in chosen]),
        "before": np.array([c.before for c in chosen]),
        "sharpness": np.array([c.sharpness for c in chosen]),
        "loss": np.array([[c.cost if i < LIVE else HUGE, max(count, 1.0)] for i, c in enumerate(chosen)]),
        "motion": np.zeros((len(chosen), 2)),
        "ud": ud,
        "ceiling": ceiling,
    }


def fresh_starts(state: State, r: Settings, size: int, *, bounded: bool) -> int:
    """Largest number of fresh starts drawn in addition to the models of earlier re-runs."""
    if state["blocks"] or 2 * size > r.memory:
        return 0
    return r.n_starts // (FRESH_IN_STREAM if bounded else 1)


def survivors(state: State, r: Settings, size: int) -> int:
    """Number of models that continue: half as many at each re-run; a page keeps all models that reached it."""
    if state["blocks"]:
        return r.n_starts
    if size >= r.memory:
        return 1
    return max(1, int(KEPT_SHARE * r.n_starts * (r.first_rerun / size) ** 0.8))


def prior_of(scales: Array, r: Settings, y: Array) -> State:
    """P0 as information, relative to what each parameter can contribute to the output ``y``."""
    n1 = r.dims[0] - 1 + r.dims[1]
    power = np.mean(y**2)  # not the variance, which is zero for a constant output
    information = np.full(r.size, power / r.p0)
    information[n1 : n1 + r.dims[4]] = power / scales**2 / r.p0
    return {"prior_information": np.diag(information)[None], "prior_theta": np.zeros((1, r.size))}
