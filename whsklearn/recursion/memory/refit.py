"""Re-run the memory: starts are drawn, sharpened and compared, and the best continue."""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from whsklearn._numba import njit
from whsklearn.recursion.memory.cost import AT, BUDGET, COST, HUGE, PHASE, SPENT, UNBOUNDED, Memory, Work, new_work
from whsklearn.recursion.memory.first_block import increment_rms
from whsklearn.recursion.memory.gauss_newton import Prior, refine_part
from whsklearn.recursion.memory.settings import Settings, State
from whsklearn.recursion.memory.starts import (
    least_squares_steps,
    random_start_steps,
    regressors,
    scales_from,
    term_sizes_steps,
)
from whsklearn.recursion.memory.steps import in_one
from whsklearn.recursion.rows.covariance import factors_of_inverse, times
from whsklearn.recursion.rows.subinnovations import relative_sharpness

Array = NDArray[np.float64]
Steps = Generator[None, None, "_Candidate | None"]

LADDER = (1.0, 2.0, 4.0, 8.0, 20.0, 50.0, 100.0, 200.0, 400.0)
ITERATIONS = 8
EARLY_ITERATIONS = 5  # per rung while the memory fills and time is short; the next rung continues from there anyway
REOPENING = 100.0  # forgetting may always inflate P to this many times its largest pivot at the last re-run
LEAST = 1e-9
FEWEST = 40.0  # or to what P was when only this many samples were known
SLACK = 1.01  # factor on the error: on a staircase a better estimate may be one step higher
INFERENCE = 20.0  # sharpness at which P is evaluated: the intervals have their coverage there (benchmarks/accuracy.py)
LONG_INFERENCE = 150.0  # the same for a full memory; sharper costs coverage of L1, blunter costs accuracy
LIVE = 2  # models updated at every sample; the others wait for the next re-run, which starts from their parameters
KEPT_SHARE = 0.62  # share of the starts that continue after the first re-run; fewer at each later one
FRESH_IN_STREAM = 2  # initial starts per fresh start, at each re-run in the background
# If there is time, fresh starts are drawn until this many have ended in the best minimum, but no more than there were
# initially.  With an eighth of the initial number, whatever they found, 3 of 400 random systems kept a wrong minimum,
# whose free run is a thousand times worse (benchmarks/accuracy.py, seeds 3000 to 3399).  With two confirmations it was
# 1 of these, and 1 of another 200 (6600 to 6799); with four it was none of the 200.
CONFIRMED = 4
SAMPLED = 128  # latest samples from which a start and the scale of dx are computed; there is no time for more
WHOLE_ROW = 1e6  # samples re-run: more than the budget of any row
COST_OF_BEGIN = 300  # cost of the work before the first pass of a model, in samples re-run
COST_OF_RUNG = 150  # the same for the other work on a rung, while the many starts of a stream are tried
COST_OF_RARE_RUNG = 350  # the same later, when less of the code is cached and there is time to spare
COST_OF_START = 900  # the same for drawing a start, which takes as long as two or three samples


@dataclass
class _Candidate:
    """A model after a re-run of the memory."""

    cost: float
    theta: NDArray[np.float64]
    information: NDArray[np.float64]
    before: NDArray[np.float64]
    sharpness: float
    parent: int


class Refit:
    """A search over the first ``size`` samples in memory, in parts.

    Parameters
    ----------
    state : dict
        State of the stream; it is not changed.
    r : Settings
    size : int
        Number of samples.
    work : Work
        Its budget; the steps yield when it is spent.
    limit : float
        Number of samples re-run after which no further start or rung is begun.
    """

    def __init__(self, state: State, r: Settings, size: int, work: Work, limit: float = np.inf):
        self.state, self.settings, self.size, self.work, self.limit = state, r, size, work, limit
        h = r.history
        self.latest = state["memory_u"][h : h + size][-SAMPLED:], state["memory_restart"][max(size - SAMPLED, 0) : size]
        self._is_first = True
        self._is_hurried = False
        self.iterations = EARLY_ITERATIONS if np.isfinite(limit) else ITERATIONS
        self._y = state["memory_y"][h : h + size]
        self.given = {name: state[name] for name in ("origin", "prior_theta", "prior_information")}

    def prepare(self) -> Generator[None, None, None]:
        """Compute what needs the whole memory once: the weights and their sum, the prior's weight, and any motion.

        Everything after this is done in small pieces too.  Code that runs once per page is no longer cached, and
        work that takes 20 us in a loop takes 100 us here.
        """
        state, size = self.state, self.size
        left = yield from left_steps(state, size)
        yield
        self.weights = left * state["memory_weight"][:size]
        yield
        self.count = _number(left, state["memory_weight"][:size])
        yield
        self.kept = left_of_prior(state, size)
        self.left = self.kept if state["blocks"] else 1.0
        yield
        self.moved = bool(size and np.ptp(self._y) > 0.0)
        yield
        self.moved = self.moved and not state["memory_idle"][:size].all()

    def search(self, thetas: Array) -> Generator[None, None, list[_Candidate]]:
        """Refine the models ``thetas`` and fresh ones; return the best ones, best first.

        There is no search on an axis at rest.
        """
        if not self.moved:
            return []
        r, work = self.settings, self.work
        first_page = not self.state["blocks"]
        seen = self.state["seen"] - self.state["fill"] + self.size
        climb = climb_to(relative_sharpness(seen, LADDER[-1]))
        begins = first_page and not self.state["prior_information"].any()
        yield
        bounded = bool(np.isfinite(self.limit))
        self._is_hurried = bounded and begins  # every start must be tried, and there is no time to spare
        count = r.n_starts if begins else self._fresh(bounded)
        scales = None
        if count:
            sequence = np.random.SeedSequence([r.seed, seen])
            yield from self._row()
            bits = np.random.PCG64(sequence)
            yield from self._row()
            rng = np.random.Generator(bits)  # as default_rng does, in three pieces
            yield from self._row()
            scales = yield from self._scales(rng)
            yield
        found: list[_Candidate | None] = []
        if begins:
            assert scales is not None  # there are always starts at the beginning of a stream
            yield
            self._set_prior(scales)
            yield
            # LAPACK is no longer cached: the first least-squares solution would take 100 us, and this halves it
            np.linalg.solve(np.eye(1), np.ones(1))
            yield from self._row()
            np.linalg.eigh(np.eye(2))
            yield from self._row()
            if r.theta0 is not None:
                found.append((yield from self.refine(0, r.theta0, climb)))
        else:
            # a few models are worth the whole climb, because a blunt rung may end on a lower step.  A page is
            # not, because the posterior takes the mean over the steps in any case
            rungs = climb if first_page and len(thetas) <= 2 and self.size < r.memory else climb[-2:]
            for s, theta in enumerate(thetas):
                yield
                found.append((yield from self.refine(s, theta, rungs)))
        carried = len(found)
        for i in range(count):
            if work.at[SPENT] >= self.limit or not (bounded or begins or reached(found, carried) < CONFIRMED):
                break
            yield
            # two kinds in turn: all random, and least squares given a random L1; on 320 samples or more the latter
            # do not end in the right minimum more often, and a stream has no time to spare for them
            theta = yield from self._drawn(rng, scales, begins, i % 2 == 0 and (begins or not bounded))
            work.at[SPENT] += COST_OF_START
            found.append((yield from self.refine(0, theta, long_strides(climb) if bounded else climb)))
        yield
        chosen = best_first(found)[: self._kept()]
        yield
        return chosen

    def _drawn(
        self, rng: np.random.Generator, scales: Array | None, begins: bool, by_least_squares: bool
    ) -> Generator[None, None, Array]:
        """Draw a fresh start, in parts."""
        r = self.settings
        steps = random_start_steps(tuple(r.dims), rng, scales)
        if begins:  # there are many, so the code stays in the cache
            theta = in_one(steps)
            yield from self._row()
        else:
            theta = yield from self._rows(steps)
        if by_least_squares:
            u, restart = self.latest
            rows = regressors(theta, r.law, u, restart=restart, y=self._y[-SAMPLED:])
            yield from self._row()
            theta = yield from self._rows(least_squares_steps(theta, r.law, rows, self._y[-SAMPLED:]))
        return theta

    def _row(self) -> Generator[None, None, None]:
        """End a piece of work that uses up the budget of one row."""
        self.work.at[BUDGET] -= WHOLE_ROW
        yield

    def _rows(self, steps: Generator[None, None, Array]) -> Generator[None, None, Array]:
        """Do ``steps``; each piece uses up the budget of its row."""
        while True:
            try:
                next(steps)
            except StopIteration as end:
                yield from self._row()
                return end.value
            yield from self._row()

    def _fresh(self, bounded: bool) -> int:
        """Largest number of fresh starts drawn in addition to the models of earlier re-runs."""
        r = self.settings
        if self.state["blocks"] or 2 * self.size > r.memory:
            return 0
        return r.n_starts // (FRESH_IN_STREAM if bounded else 1)

    def _kept(self) -> int:
        """Number of models that continue: half as many at each re-run; a page keeps all models that reached it."""
        r = self.settings
        if self.state["blocks"]:
            return r.n_starts
        if self.size >= r.memory:
            return 1
        return max(1, int(KEPT_SHARE * r.n_starts * (r.first_rerun / self.size) ** 0.8))

    def _scales(self, rng: np.random.Generator) -> Generator[None, None, Array]:
        """`term_scales` in parts."""
        u, restart = self.latest
        y = self._y[-SAMPLED:]
        sizes = []
        for _ in range(9):
            size = yield from self._rows(term_sizes_steps(self.settings.law, u, restart, rng))
            sizes.append(size)
            yield
        return scales_from(sizes, y)

    def _set_prior(self, scales: Array) -> None:
        """Turn P0 into information, relative to what each parameter can contribute to the output."""
        r = self.settings
        n1 = r.dims[0] - 1 + r.dims[1]
        power = np.mean(self._y**2)  # not the variance, which is zero for a constant output
        information = np.full(r.size, power / r.p0)
        information[n1 : n1 + r.dims[4]] = power / scales**2 / r.p0
        self.given["prior_information"] = np.diag(information)[None]
        self.given["prior_theta"] = np.zeros((1, r.size))

    def refine(self, parent: int, theta: Array, steps: list[float]) -> Steps:
        """Sharpen one model rung by rung; the result is the rung with the least error under the true sign.

        A search of the staircase itself, sample by sample, was tried.  It lowers the error on the
        record and raises it on others (on 50 random systems by a factor of 1.6, against 1.2 for the rungs).
        """
        state, r, work = self.state, self.settings, self.work
        theta = theta.copy()
        work.at[BUDGET] -= COST_OF_BEGIN
        n, n_state = r.size, state["before"].shape[1]
        n1 = int(r.dims[0] - 1 + r.dims[1])
        left = self.left
        memory = memory_of(state, r, self.size, self.weights, self.given["origin"][parent], tail=r.p)
        prior = Prior(self.given["prior_theta"][parent], self.given["prior_information"][parent] * left)
        scarce = bool(np.isfinite(self.limit))  # then short work is done together with the reading of the memory
        if not scarce:
            yield
        if self._is_first and work.at[BUDGET] < WHOLE_ROW:  # not in a cache: one segment is enough for a row
            work.at[BUDGET] = 1.0
        self._is_first = False

        def refined(kappa: float, iterations: int, information: Array, before: Array) -> Generator[None, None, float]:
            if work.at[BUDGET] <= 0.0 and not self._is_hurried:
                yield  # because one segment is read in any case
            work.at[AT] = work.at[PHASE] = 0
            while not refine_part(theta, r.law, kappa, memory, prior, iterations, information, before, work):
                yield
            return float(work.at[COST])

        best = None
        for relative in steps:
            if work.at[SPENT] >= self.limit:
                break
            kappa = relative / max(increment_rms(theta, r.dims, *self.latest), 1e-12)
            work.at[BUDGET] -= COST_OF_RUNG if self._is_hurried else COST_OF_RARE_RUNG
            information, before = np.zeros((n, n)), np.zeros(n_state)
            yield from refined(kappa, self.iterations, information, before)
            cost = yield from refined(np.inf, 0, np.zeros((n, n)), before)
            if not scarce:
                yield
            if np.isfinite(cost) and np.isfinite(information).all() and (best is None or cost < best.cost):
                best = _Candidate(cost, theta.copy(), information, before, kappa, parent)
            if not scarce:
                yield
        if best is None:
            return None
        yield
        moves = max(increment_rms(best.theta, r.dims, *self.latest), 1e-12)
        theta = best.theta.copy()
        if not state["blocks"] and self.size < r.memory:
            yield from refined(INFERENCE / moves, 0, best.information, np.empty(n_state))
            return best
        # On a record this long the bias that tanh() near zero adds to the weights is noticeable.  So they are fitted
        # with the error of the true sign; only the slopes are those of a smooth one.  L1 stays on the step it found.
        for step in range(3):
            information, before = np.zeros((n, n)), np.zeros(n_state)
            cost = yield from refined(-LONG_INFERENCE / moves, 0, information, before)
            if not np.isfinite(information).all() or (step and not cost < SLACK * best.cost):
                break
            best = _Candidate(cost, theta.copy(), information, before, best.sharpness, parent)
            yield
            factors = factors_of_inverse(np.ascontiguousarray(information[n1:, n1:]))
            yield
            theta[n1:] += times(factors, work.slope[n1:])
            yield
        return best


def consolidate(state: State, r: Settings) -> None:
    """Re-run all samples in memory for every model and for fresh starts; the best replace the old ones in place."""
    if not state["fill"]:
        return
    work = new_work(r.dims, r.n_inputs)
    work.at[BUDGET] = UNBOUNDED
    refit = Refit(state, r, state["fill"], work)
    in_one(refit.prepare())
    chosen = in_one(refit.search(state["theta"]))
    if chosen:
        parents = [c.parent for c in chosen]
        state.update({name: value[parents].copy() for name, value in refit.given.items()})
        state.update(in_one(adopted(chosen, refit.count, float(state["known"][0]))))
        state["page_theta"] = state["theta"].copy()


def climb_to(sharpest: float) -> list[float]:
    """The rungs of the ladder up to ``sharpest``, without rungs so close that the second would add nothing."""
    return [k for k in LADDER if 1.5 * k < sharpest] + [sharpest]


def long_strides(climb: list[float]) -> list[float]:
    """The first rung, one in between and the last, for starts that are tried while a stream runs.

    On 128 to 256 samples of Example 5.1 such starts reach the right minimum four times in 100,000 samples re-run;
    starts that take every rung reach it 2.6 times.
    """
    return climb[:1] + climb[2:-1][:1] + climb[-1:]


def reached(found: list[_Candidate | None], carried: int) -> int:
    """How many candidates behind the first ``carried`` are in the best minimum of all."""
    costs = [np.inf if c is None else c.cost for c in found]
    bound = SLACK * min(costs, default=np.inf)
    return sum(cost <= bound < np.inf for cost in costs[carried:])


def best_first(found: list[_Candidate | None]) -> list[_Candidate]:
    """Candidates in order of cost, without those that ended in the same minimum as a better one."""
    kept: list[_Candidate] = []
    for c in sorted((c for c in found if c is not None), key=lambda c: c.cost):
        if not kept or c.cost - kept[-1].cost > 1e-4 * kept[-1].cost:  # the last one kept is the closest in cost
            kept.append(c)
    return kept


def memory_of(state: State, r: Settings, size: int, weights: Array, origin: Array, tail: int) -> Memory:
    """The first ``size`` samples in memory, in the form that the kernels take."""
    return Memory(origin, state["memory_u"], state["memory_y"], state["memory_restart"], size, r.history, tail, weights)


def weights_of(state: State, fill: int) -> Array:
    """Weights of the first ``fill`` samples of the memory: the weight after forgetting, times the user's weight."""
    return left_of(state, fill) * state["memory_weight"][:fill]


def left_of(state: State, fill: int) -> Array:
    """Weight after forgetting of each of the first ``fill`` samples of the memory; zero for samples at standstill.

    The forgetting factors are those in use when the samples arrived, so a re-run forgets as much as the recursion did.
    """
    return in_one(left_steps(state, fill))


def left_steps(state: State, fill: int) -> Generator[None, None, Array]:
    """`left_of` in parts."""
    left: Array = np.ones(fill)
    left[:-1] = state["memory_kept"][1:fill]
    yield
    _multiply_back(left)
    yield
    left[state["memory_still"][:fill]] = 0.0
    return left


@njit(error_model="numpy")
def _multiply_back(left):
    """Set each entry to the product from it to the last one; ``cumprod`` takes 50 us to start if rarely called."""
    for t in range(left.size - 2, -1, -1):
        left[t] *= left[t + 1]


def count_of(state: State, fill: int) -> float:
    """Number of samples, whatever their weight; those with weight zero and those at standstill do not count."""
    return _number(left_of(state, fill), state["memory_weight"][:fill])


def _number(left: Array, weight: Array) -> float:
    return float(left[weight > 0.0].sum())


def inference_sharpness(theta: Array, r: Settings, u: Array, restart: NDArray[np.bool_]) -> float:
    """Sharpness at which the information of a long record is taken: error of the true sign, slope of a smooth one."""
    return -LONG_INFERENCE / max(float(increment_rms(theta, r.dims, u, restart)), 1e-12)


def left_of_prior(state: State, fill: int) -> float:
    """Weight after forgetting of the information from before the memory, bounded below so that P stays bounded."""
    return max(float(np.prod(state["memory_kept"][:fill])), LEAST)


def adopted(chosen: list[_Candidate], count: float, known: float) -> Generator[None, None, State]:
    """State entries of the chosen models at the end of the samples on which they were re-run.

    Models that wait for the next re-run have no P of their own and are never chosen for the answer.
    """
    live = []
    for c in chosen[:LIVE]:
        live.append(factors_of_inverse(c.information))
        yield
    ud = np.array([live[min(i, len(live) - 1)] for i in range(len(chosen))])
    # far from where it was learnt the linearised model is wrong, so P must not be too large after an idle period
    ceiling = float(max(REOPENING, known / FEWEST) * ud.diagonal(axis1=1, axis2=2).max())
    yield
    models = {"theta": np.array([c.theta for c in chosen]), "before": np.array([c.before for c in chosen])}
    yield
    return models | {
        "sharpness": np.array([c.sharpness for c in chosen]),
        "loss": np.array([[c.cost if i < LIVE else HUGE, max(count, 1.0)] for i, c in enumerate(chosen)]),
        "motion": np.zeros((len(chosen), 2)),
        "ud": ud,
        "ceiling": ceiling,
    }
