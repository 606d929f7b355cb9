"""Re-run the memory in parts while the next samples arrive, so that no sample has to wait.

While the memory fills, re-runs begin at instants that grow geometrically, and each is finished by the
next instant (`schedule`).  A full memory is a page, which is re-run during the half page that follows.
A few hundred stored samples are read for each new one.  The models that result then catch up with the
samples that arrived meanwhile and take over at a fixed sample.  They depend only on the samples up to
that point.  How the work was divided makes no difference, and it can be restarted at any time, so it is
not part of the state.  The work is bounded by the number of samples re-run, not by time.

What this buys, over 14,000 rows of Example 5.1 on a loaded machine (least of four runs): the longest row takes 0.16 ms,
where a whole re-run in one row takes 29.  It costs a fifth more CPU in all, and the numbers are the same to the bit.
"""

from __future__ import annotations

import functools
import itertools
from collections.abc import Generator
from typing import TypeVar

import numpy as np

from whsklearn.effects.base import Array
from whsklearn.recursion.memory import refit
from whsklearn.recursion.memory.blocks import increment_rms
from whsklearn.recursion.memory.gauss_newton import (
    AT,
    BUDGET,
    COST,
    PHASE,
    SPENT,
    UNBOUNDED,
    Memory,
    Prior,
    Work,
    new_work,
    refine_part,
)
from whsklearn.recursion.memory.linearised import (
    Linearisation,
    Signs,
    curvature,
    filtered,
    flattened,
    has_posterior,
    linearisation,
    stored,
    unpacked,
    with_past,
)
from whsklearn.recursion.memory.predictor_block import new_segment
from whsklearn.recursion.memory.settings import Settings, State
from whsklearn.recursion.memory.sign_posterior import Gaussian, frozen
from whsklearn.recursion.memory.starts import (
    N_SIZES,
    exchanged,
    least_squares_start,
    random_start,
    regressors,
    scales_from,
    solved,
    term_sizes,
    with_solution,
)
from whsklearn.recursion.rows.covariance import factors_of_inverse, times
from whsklearn.recursion.rows.predictor import LEAST_MOTION
from whsklearn.recursion.rows.subinnovations import STILL, Models, Samples, Schedule, relative_sharpness, run_windows

# Samples re-run for each new one while the memory fills, which takes about 25 us.  All starts are tried on the first
# samples, and later as many fresh ones as the remaining passes allow.  With 400 only half of them were tried, and 27 of
# 800 streams of Example 5.1 were in a wrong minimum at row 1,000; with 700 none of 8,000 is (benchmarks/accuracy.py
# --section minima, from seed 1000).
FILLING = 700
PAGE = 128  # the same for each model after that; a page is then read and caught up with after a third of the half page
COST_OF_WINDOW = 24  # cost of one sample of the recursion, in samples re-run
RESERVED = 60  # passes over the whole record that are reserved for the work after the search
PIECES = 110  # pieces of work other than passes over samples, besides those for each start; each sample does one
PIECES_A_MODEL = 16  # of a page, which begins with all models kept while the memory filled: 19 of 32 in 512 samples
BATCH = 4  # samples that the new models take at once; starting costs as much as two, and no result is needed sooner
PIECE = 1024  # samples whose signs are judged between two rows
NOTED = 64  # at most one row in this many does no work here: the row in which the estimator saves its state
FIRST_SPAN = 3.75  # the first re-run has to try every start; it takes over at five times its samples
SPAN = 2.0  # ratio of the instants after that
SAMPLED = 128  # latest samples from which a start and the scale of dx are computed; there is no time for more
WHOLE_ROW = 1e6  # samples re-run: more than the budget of any row
COST_OF_BEGIN = 300  # cost of the work before the first pass of a model, in samples re-run
COST_OF_RUNG = 150  # the same for the other work on a rung, while the many starts of a stream are tried
COST_OF_RARE_RUNG = 350  # the same later, when less of the code is cached and there is time to spare
COST_OF_START = 900  # the same for drawing a start, which takes as long as two or three samples

Answer = TypeVar("Answer")
Steps = Generator[None, None, Answer]  # work with an answer, which yields where the next row may interrupt it


def schedule(r: Settings, filling: bool) -> list[tuple[int, int]]:
    """Samples in memory at which re-runs begin and take over."""
    page = (r.memory, r.page_end)
    return [*_filling(r.first_rerun, r.memory), page] if filling else [page]


@functools.cache
def _filling(first: int, memory: int) -> list[tuple[int, int]]:
    """The schedule while the memory fills.

    A re-run that has no time for its starts would end them all: of 25 streams of Example 5.1, 15 with a memory of 200
    or 256 were then in a wrong minimum.  So a memory shorter than the first span is re-run when it is full.
    """
    instants, at = [], float(first)
    if first * FIRST_SPAN > memory:
        return []
    while at * 1.5 < memory:
        instants.append(int(at))
        at *= SPAN if len(instants) > 1 else FIRST_SPAN
    return list(itertools.pairwise([*instants, memory]))


def under_way(state: State, r: Settings) -> tuple[int, int] | None:
    """Where the current re-run began and where it takes over; None if there is none."""
    for begin, end in schedule(r, not state["blocks"]):
        if begin < state["fill"] <= end:
            return begin, end
    return None


MEMORY = (
    "memory_u", "memory_y", "memory_restart", "memory_still", "memory_idle", "memory_kept", "memory_weight",
)  # fmt: skip


class NextMemory:
    """The memory without its oldest ``n`` samples, except for the history that the next memory needs.

    It is kept in new arrays, because an array that only grows need not be copied before every call that might be
    interrupted.  Allocating all of them takes as long as two samples, and filling them at once as long as another.
    """

    def __init__(self, state: State, r: Settings, n: int):
        self._state, self._n, self._done = state, n, 0
        self._before = {name: r.history if name in ("memory_u", "memory_y") else 0 for name in MEMORY}
        self._arrays: dict[str, Array] = {}

    def make_room(self) -> Steps[None]:
        """Allocate the arrays, in parts."""
        for name, h in self._before.items():
            old = self._state[name]
            new = np.full_like(old, name in ("memory_kept", "memory_weight"))
            new[:h] = old[self._n : self._n + h]
            self._arrays[name] = new
            yield

    def go_on(self) -> None:
        """Copy the samples that have arrived since the last call."""
        n, done, rest = self._n, self._done, self._state["fill"] - self._n
        for name, new in self._arrays.items():
            h = self._before[name]
            new[h + done : h + rest] = self._state[name][h + n + done : h + n + rest]
        self._done = rest

    def put(self) -> None:
        """Make this the memory of the state; a new block begins."""
        self.go_on()
        self._state.update(self._arrays)
        self._state["fill"] -= self._n
        self._state["blocks"] += 1


class MultistartSearch:
    """A search over the first ``size`` samples in memory: a generator that yields where the next sample may come.

    Its pieces take at most as long as a row may wait, and its result does not depend on where it was interrupted.
    It does not change the ``state`` of the stream; its steps yield when the budget of ``work`` is spent, and after
    ``limit`` samples re-run no further start or rung is begun.
    """

    def __init__(self, state: State, r: Settings, size: int, work: Work, limit: float = np.inf):
        self.state, self.settings, self.size, self.work, self.limit = state, r, size, work, limit
        h = r.history
        self.latest = state["memory_u"][h : h + size][-SAMPLED:], state["memory_restart"][max(size - SAMPLED, 0) : size]
        self.is_last = False  # no sample waits for it, as where `fit` ends: exchanged blocks are tried too
        self._is_first = True
        self._is_hurried = False
        self._is_scarce = bool(np.isfinite(limit))  # then short work is done together with the reading of the memory
        self.iterations = refit.EARLY_ITERATIONS if self._is_scarce else refit.ITERATIONS
        self._y = state["memory_y"][h : h + size]
        self.given = {name: state[name] for name in ("origin", "prior_theta", "prior_information")}

    def _prepare(self) -> Steps[None]:
        """Compute what needs the whole memory once: the weights and their sum, the prior's weight, and any motion.

        Everything after this is done in small pieces too.  Code that runs once per page is no longer cached, and
        work that takes 20 us in a loop takes 100 us here.
        """
        state, size = self.state, self.size
        left = refit.left_of(state, size)
        yield
        self.weights = left * state["memory_weight"][:size]
        self.count = refit.number_of(left, state["memory_weight"][:size])
        yield
        self.kept = refit.left_of_prior(state, size)
        self.left = self.kept if state["blocks"] else 1.0
        yield
        self.moved = bool(size and np.ptp(self._y) > 0.0) and not state["memory_idle"][:size].all()

    def run(self, thetas: Array) -> Steps[list[refit.Refined]]:
        """Refine the models ``thetas`` and fresh ones; return the best ones, best first.

        There is no search on an axis at rest.
        """
        yield from self._prepare()
        yield
        if not self.moved:
            return []
        r, work = self.settings, self.work
        first_page = not self.state["blocks"]
        seen = self.state["seen"] - self.state["fill"] + self.size
        climb = refit.climb_to(relative_sharpness(seen, refit.LADDER[-1]))
        begins = first_page and not self.state["prior_information"].any()
        yield
        bounded = self._is_scarce
        self._is_hurried = bounded and begins  # every start must be tried, and there is no time to spare
        count = r.n_starts if begins else refit.fresh_starts(self.state, r, self.size, bounded=bounded)
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
        found: list[refit.Refined | None] = []
        if begins:
            assert scales is not None  # there are always starts at the beginning of a stream
            self.given.update(refit.prior_of(scales, r, self._y))
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
            if work.at[SPENT] >= self.limit or not (
                bounded or begins or refit.reached(found, carried) < refit.CONFIRMED
            ):
                break
            yield
            # two kinds in turn: all random, and least squares given a random L1; on 320 samples or more the latter
            # do not end in the right minimum more often, and a stream has no time to spare for them
            theta = yield from self._drawn(rng, scales, i % 2 == 0 and (begins or not bounded))
            work.at[SPENT] += COST_OF_START
            found.append((yield from self.refine(0, theta, refit.long_strides(climb) if bounded else climb)))
        if first_page and self.is_last and any(found):
            found += yield from self._exchanged(refit.best_first(found)[0], climb)
        yield
        return refit.best_first(found)[: refit.survivors(self.state, r, self.size)]

    def _exchanged(self, best: refit.Refined, climb: list[float]) -> Steps[list[refit.Refined]]:
        """What is clearly better of models that divide the poles of the best one otherwise between the blocks."""
        law, h = self.settings.law, self.settings.history
        u, restart = self.state["memory_u"][h : h + self.size], self.state["memory_restart"][: self.size]
        found = []
        for start in exchanged(best.theta, tuple(self.settings.dims.tolist())):
            theta = least_squares_start(start, law, regressors(start, law, u, self._y, restart), self._y)
            found.append((yield from self.refine(0, theta, climb)))
        return [c for c in found if c is not None and refit.SLACK * c.cost < best.cost]

    def _drawn(self, rng: np.random.Generator, scales: Array | None, by_least_squares: bool) -> Steps[Array]:
        """Draw a fresh start."""
        r, y = self.settings, self._y[-SAMPLED:]
        theta = random_start(tuple(r.dims), rng, scales)
        if by_least_squares:
            yield from self._row()
            rows = regressors(theta, r.law, self.latest[0], y, self.latest[1])
            yield from self._row()
            solution = solved(rows, y)
            yield from self._row()
            theta = with_solution(theta, r.law, solution, rows)
        yield from self._row()
        return theta

    def _row(self) -> Steps[None]:
        """End a piece of work that uses up the budget of one row."""
        self.work.at[BUDGET] -= WHOLE_ROW
        yield

    def _scales(self, rng: np.random.Generator) -> Steps[Array]:
        """`term_scales`, one random L1 a row."""
        sizes = []
        for _ in range(N_SIZES):
            start = random_start(tuple(self.settings.dims), rng)
            yield from self._row()
            sizes.append(term_sizes(self.settings.law, start, *self.latest))
            yield from self._row()
        return scales_from(sizes, self._y[-SAMPLED:])

    def refine(self, parent: int, theta: Array, steps: list[float]) -> Steps[refit.Refined | None]:
        """Take one model to its minimum, and its weights too where the record is long (`_with_true_sign`)."""
        state, r, work = self.state, self.settings, self.work
        work.at[BUDGET] -= COST_OF_BEGIN
        memory = refit.memory_of(state, r, self.size, self.weights, self.given["origin"][parent], tail=r.p)
        prior = Prior(self.given["prior_theta"][parent], self.given["prior_information"][parent] * self.left)
        if not self._is_scarce:
            yield
        if self._is_first and work.at[BUDGET] < WHOLE_ROW:  # not in a cache: one segment is enough for a row
            work.at[BUDGET] = 1.0
        self._is_first = False
        best = yield from self._climbed(parent, theta.copy(), (memory, prior), steps)
        if best is None:
            return None
        yield
        moves = self.moves(best.theta)
        if state["blocks"] or self.size >= r.memory:
            return (yield from self._with_true_sign(best, (memory, prior), moves))
        _, information, _ = yield from self.rerun(best.theta.copy(), (memory, prior), refit.INFERENCE / moves)
        return best._replace(information=information)

    def moves(self, theta: Array) -> float:
        """Root mean square of dx, to which every sharpness is relative."""
        return max(increment_rms(theta, self.settings.dims, *self.latest), LEAST_MOTION)

    def _climbed(
        self, parent: int, theta: Array, record: tuple[Memory, Prior], steps: list[float]
    ) -> Steps[refit.Refined | None]:
        """Sharpen ``theta``, in place, rung by rung; the result is the rung with the least error under the true sign.

        A search of the staircase itself, sample by sample, was tried.  It lowers the error on the
        record and raises it on others (on 50 random systems by a factor of 1.6, against 1.2 for the rungs).
        """
        work, best = self.work, None
        for relative in steps:
            if work.at[SPENT] >= self.limit:
                break
            kappa = relative / self.moves(theta)
            work.at[BUDGET] -= COST_OF_RUNG if self._is_hurried else COST_OF_RARE_RUNG
            _, information, _ = yield from self.rerun(theta, record, kappa, self.iterations)
            cost, _, before = yield from self.rerun(theta, record, np.inf)
            if not self._is_scarce:
                yield
            if np.isfinite(cost) and np.isfinite(information).all() and (best is None or cost < best.cost):
                best = refit.Refined(cost, theta.copy(), information, before, kappa, parent)
            if not self._is_scarce:
                yield
        return best

    def _with_true_sign(self, best: refit.Refined, record: tuple[Memory, Prior], moves: float) -> Steps[refit.Refined]:
        """The model with its weights fitted by the error of the true sign; only the slopes are those of a smooth one.

        On a long record the bias that tanh() near zero adds to the weights is noticeable.  L1 stays on the step that it
        found.
        """
        r, theta = self.settings, best.theta.copy()
        n1 = int(r.dims[0] - 1 + r.dims[1])
        for step in range(3):
            cost, information, before = yield from self.rerun(theta, record, -refit.LONG_INFERENCE / moves)
            if not np.isfinite(information).all() or (step and not cost < refit.SLACK * best.cost):
                break
            best = refit.Refined(cost, theta.copy(), information, before, best.sharpness, best.parent)
            yield
            factors = factors_of_inverse(np.ascontiguousarray(information[n1:, n1:]))
            theta[n1:] += times(factors, self.work.slope[n1:])
            yield
        return best

    def rerun(
        self, theta: Array, record: tuple[Memory, Prior], kappa: float, iterations: int = 0
    ) -> Steps[tuple[float, Array, Array]]:
        """`refine_part` to its end, ``theta`` in place: the cost, its Gauss-Newton matrix and the state at the end."""
        work, law = self.work, self.settings.law
        information, end = np.zeros((theta.size, theta.size)), np.zeros(self.state["before"].shape[1])
        if work.at[BUDGET] <= 0.0 and not self._is_hurried:
            yield  # because one segment is read in any case
        work.at[AT] = work.at[PHASE] = 0
        while not refine_part(theta, law, kappa, *record, iterations, information, end, work):
            yield
        return float(work.at[COST]), information, end


def refit_now(state: State, r: Settings) -> None:
    """Re-run all samples in memory for every model and for fresh starts; the best replace the old ones in place."""
    if not state["fill"]:
        return
    work = new_work(r.dims, r.n_inputs)
    work.at[BUDGET] = UNBOUNDED
    search = MultistartSearch(state, r, state["fill"], work)
    search.is_last = True
    chosen = in_one(search.run(state["theta"]))
    if chosen:
        parents = [c.parent for c in chosen]
        state.update({name: value[parents].copy() for name, value in search.given.items()})
        state.update(refit.adopted(chosen, refit.factors_of(chosen), search.count, float(state["known"][0])))
        state["page_theta"] = state["theta"].copy()


def in_one(steps: Steps[Answer]) -> Answer:
    """Do all steps at once and return the result."""
    while True:
        try:
            next(steps)
        except StopIteration as end:
            return end.value


def joined(
    page: Linearisation, state: State, r: Settings, s: int, left: float, count: float, about: Gaussian | None = None
) -> Steps[tuple[Array, Signs, float]]:
    """M, the signs in doubt and the number of samples, for the past of model ``s`` and ``page`` together.

    ``left`` is the weight of the past after forgetting, ``count`` the number of samples of the page.  Whether a sign is
    in doubt is judged by the covariance ``about``, or else by that with the signs frozen.
    """
    law, record, first = page.law, page.record, state["seen"] - state["fill"]
    matrix, count = with_past(page, state, s, left, count)
    yield
    old = unpacked(state, r).weighted(left)
    yield
    old = old.shifted(page.theta - state["past_theta"])
    yield
    old = old.met(page.rows, record.restart[: record.fill], first)
    yield
    about = about or frozen(matrix, page.theta, count)
    yield
    covariance = about and np.ascontiguousarray(about.covariance[: page.n1, : page.n1])
    doubt = np.empty(record.fill)
    for begin in range(0, record.fill, PIECE):
        part = slice(begin, begin + PIECE)
        doubt[part] = page.doubt(covariance, part)
        yield
    kept, chosen = page.in_doubt(old.doubt(covariance), doubt)
    yield
    old = old.take(kept)
    yield
    experiment = np.cumsum(record.restart[: record.fill], dtype=np.int64)
    yield
    f = filtered(page.gradient, record.restart, law, page.theta)
    yield
    bent = curvature(f, experiment, law, chosen)
    yield
    height = page.heights(chosen)
    yield
    new = page.entries(chosen, experiment, bent, height, first)
    yield
    return matrix, old.joined(new), count


class BackgroundRefit:
    """The re-run in progress of the first ``size`` samples in memory; with ``end`` of them the new models take over.

    The ``state`` of the stream does not change before `take_over`.
    """

    def __init__(self, state: State, r: Settings, size: int, end: int):
        self.state, self.settings, self.size, self.end = state, r, size, end
        self.is_page = size == r.memory
        self.block = state["blocks"]
        self._work: Work
        self._begun = False
        self._searched = False
        self._put_off = False
        self._steps = self._rerun()
        self._ends: list[tuple[Array, Array]] = []
        self._models: State = {}
        self._parents: list[int] = []
        self._caught_up = 0
        self._others: State = {}  # entries besides those of the models: what they are given, and the past
        self._next_memory = NextMemory(state, r, size) if self.is_page else None
        self._known = float(state["page_known"])
        pieces = 4 * PIECES + self.is_page * PIECES_A_MODEL * len(state["page_theta"])
        self._pace = 1 + pieces // (end - size)  # per sample; a short page has hardly more samples than pieces

    def is_of(self, state: State, size: int) -> bool:
        """Whether this re-run reads the first ``size`` samples of the memory that the state holds now."""
        return self.state is state and self.block == state["blocks"] and self.size == size

    def advance(self, n_samples: int) -> None:
        """Do as much work as ``n_samples`` new samples allow."""
        put_off, self._put_off = self._put_off, False
        if put_off and n_samples == 1:
            return
        pieces = self._pace * n_samples
        while pieces and not self._begun:  # the first pieces allocate its arrays
            next(self._steps)
            pieces -= 1
        if not pieces:
            return
        rate = PAGE * len(self.state["page_theta"]) if self.is_page else FILLING
        if self._searched and self._models:
            behind, left = self.state["fill"] - self.size - self._caught_up, self.end - self.state["fill"]
            rate = min(rate, self._cost_of_sample * max(2 * BATCH, 2 * behind // left))  # no faster than necessary
        self._work.at[BUDGET] = rate * n_samples
        for _ in range(self._pace):
            self._go_on()
            if self._work.at[BUDGET] <= 0.0:
                break

    def put_off(self) -> None:
        """Do no work at the next sample, which has waited long enough; a call with several samples is not exempt."""
        self._put_off = True

    def take_over(self) -> None:
        """Finish the re-run and replace the old models with the new ones; a page is turned."""
        while not self._begun:
            next(self._steps)
        self._work.at[BUDGET] = UNBOUNDED
        for _ in self._steps:
            pass
        if self._models:
            self._catch_up()
        s = self.state
        s.update(self._models)
        s.update(self._others)
        if self._next_memory:
            self._next_memory.put()
        s["page_theta"] = s["theta"].copy()

    def _go_on(self) -> None:
        """Spend the budget on samples to re-run, or do one piece of other work."""
        if self._searched:
            came, left = self.state["fill"] - self.size, self.end - self.state["fill"]
            if came - self._caught_up >= BATCH or left <= BATCH:
                if self._models:
                    self._catch_up()
                if self._next_memory and self._work.at[BUDGET] > 0.0:
                    self._next_memory.go_on()
        elif next(self._steps, "done") == "done":
            self._searched = True  # its last piece is enough for a row

    def _rerun(self) -> Steps[None]:
        """Refine each model, then compute for each what a page adds and its final state; yield when out of budget."""
        state, r, size = self.state, self.settings, self.size
        yield  # the row that ends a page already has to wait for the new arrays
        segment = new_segment(r.dims, r.n_inputs)
        yield
        self._work = new_work(r.dims, r.n_inputs, segment)
        self._begun = True
        yield
        limit = np.inf
        if not self.is_page:
            rows = (self.end - size) * (1.0 - 1.0 / NOTED) - PIECES
            limit = (FILLING - refit.LIVE * COST_OF_WINDOW) * rows - RESERVED * size
        search = MultistartSearch(state, r, size, self._work, limit)
        yield
        thetas, self._parents = state["page_theta"], list(range(len(state["page_theta"])))
        chosen = yield from search.run(thetas)
        if chosen:
            yield
            factors = refit.factors_of(chosen)
            yield
            self._models = refit.adopted(chosen, factors, search.count, self._known)
            yield
            thetas = self._models["theta"]
            self._parents = [c.parent for c in chosen]
        if self.is_page:
            yield from self._end_of_page(thetas, search)
            yield
        yield from self._begin_catching_up(thetas)
        yield
        yield from self._gather(search)
        if self._next_memory:
            yield from self._next_memory.make_room()
            self._next_memory.go_on()

    def _end_of_page(self, thetas: Array, search: MultistartSearch) -> Steps[None]:
        """The information of the page and the state at its end, one pair for each model."""
        state, r, m = self.state, self.settings, self.size
        nothing = np.zeros((r.size, r.size))
        for theta, parent in zip(thetas, self._parents, strict=True):
            kappa = -refit.LONG_INFERENCE / search.moves(theta)
            memory = refit.memory_of(state, r, m, search.weights, state["origin"][parent], tail=1)
            yield
            _, information, end = yield from search.rerun(theta, (memory, Prior(theta, nothing)), kappa)
            yield
            self._ends.append((information * search.moved, end))
        if has_posterior(r) and not search.moved:
            self._others["past_origin"] = self._ends[0][1]  # at rest, where nothing depends on the parameters
        elif has_posterior(r):
            yield
            page = linearisation(state, r, thetas[0], search.weights, self._work)
            yield
            while page.done < m:
                for piece in (page.read_segment, page.add_segment):
                    piece()  # takes as long as the work that one sample allows for one model
                    self._work.at[BUDGET] -= PAGE
                    yield
            # the summary of the page for later ones
            matrix, signs, count = yield from joined(page, state, r, self._parents[0], search.kept, search.count)
            yield
            rows = flattened(signs)
            yield
            self._others |= stored(rows, signs.at, state)
            yield
            self._others |= {"past_matrix": matrix, "past_theta": page.theta.copy(), "past_count": np.array([count])}
            self._others["past_origin"] = page.end.copy()

    def _gather(self, search: MultistartSearch) -> Steps[None]:
        """Collect the information that the surviving models receive, and add that of the page."""
        for name, value in search.given.items():
            self._others[name] = value[self._parents].copy()
            yield
        for i, (information, end) in enumerate(self._ends):
            if information.any():  # a page at rest holds no information, and nothing is forgotten in it
                prior = self._others["prior_information"]
                prior[i] = information + search.kept * prior[i]
                self._others["prior_theta"][i] = self._page_theta[i]
            self._others["origin"][i] = end
            yield

    def _begin_catching_up(self, thetas: Array) -> Steps[None]:
        """Place the new models at the end of the re-run samples."""
        state, r, n = self.state, self.settings, self.size
        h, k = r.history, state["recent_y"].size
        self._page_theta = thetas.copy()
        if not self._models:
            return
        new = self._models
        self._running = Models(*(new[name][: refit.LIVE] for name in Models._fields))
        self._cost_of_sample = COST_OF_WINDOW * len(self._running.theta)
        yield
        begun = np.flatnonzero(state["memory_restart"][:n])
        self._since = n - int(begun[-1]) if begun.size else n + h
        yield
        recent_u, recent_y, weight = np.zeros((k, r.n_inputs)), np.zeros(k), np.ones(k)
        known = min(self._since, k, n + h)
        recent_u[:known] = state["memory_u"][h + n - known : h + n][::-1]
        recent_y[:known] = state["memory_y"][h + n - known : h + n][::-1]
        weighted = min(known, n)  # the samples before the memory are before every window
        weight[:weighted] = state["memory_weight"][n - weighted : n][::-1]
        self._recent = Samples(recent_u.ravel(), recent_y, weight)

    def _catch_up(self) -> None:
        """Run the new models through the samples that have arrived since."""
        state, r, n = self.state, self.settings, self.size
        h = r.history
        rest = state["fill"] - n
        restart, kept = state["memory_restart"][n : n + rest], state["memory_kept"][n : n + rest]
        cost = self._cost_of_sample
        if not self._caught_up:  # the code of the first call is not cached, and reading takes twice as long
            self._work.at[BUDGET] *= 0.25
        while self._caught_up < rest and self._work.at[BUDGET] > 0:
            at = self._caught_up
            if restart[at]:
                self._since = 0
                for past in (self._running.before, self._recent.u, self._recent.y):
                    past[:] = 0.0
            stop = min(at + 1 + int(min(self._work.at[BUDGET] / cost, rest)), rest)
            if stop > at + 1:
                begun = np.flatnonzero(restart[at + 1 : stop] | (kept[at + 1 : stop] != kept[at : stop - 1]))
                stop = at + 1 + int(begun[0]) if begun.size else stop
            piece = slice(h + n + at, h + n + stop)
            samples = Samples(
                state["memory_u"][piece], state["memory_y"][piece], state["memory_weight"][n + at : n + stop]
            )
            schedule = Schedule(np.full(3, kept[at]), self._models["ceiling"], 0.0)
            still = state["memory_still"][n + at : n + stop].view(np.uint8) * np.uint8(STILL)  # else MOVING, which is 0
            self._since = run_windows(
                self._running, self._recent, self._since, 0, schedule, r.law, r.p, r.frozen, samples, still
            )
            self._work.at[BUDGET] -= (stop - at) * cost
            self._caught_up = stop
