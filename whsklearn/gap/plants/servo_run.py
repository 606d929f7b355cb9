"""A servo model that runs: held near the record by an observer, refitted along that run, and free from restarts.

The trajectory is the model's own, so the columns contain no encoder noise and small effects are measured accurately.
If much is missing, the innovation no longer shows it, because a wrong model carries the estimate along; so the inverse
view comes first.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from whsklearn.effects import Scales
from whsklearn.effects import codes as k
from whsklearn.effects.base import rms
from whsklearn.gap.filters import WHITENING, ResidualFilter, solve_whitening, whiten
from whsklearn.gap.least_squares import Minimum, gain_of, least_squares
from whsklearn.gap.plant import PAYS
from whsklearn.gap.plants.servo_candidates import Candidate
from whsklearn.gap.plants.servo_model import LONGEST_STEP, MODELS_KEPT, ServoHypothesis, ServoTerm
from whsklearn.gap.record import Array, ServoRecord, training_samples
from whsklearn.gap.search import HALF
from whsklearn.systems.servo import FEWEST_STEPS

STEP_ERROR = 0.01  # share of the tolerance by which a longer fine step may change the gap
LOST = 1e3  # times the travel or the speed of the record: a run beyond that has diverged
# s: the longest horizon, and those tried if it shows nothing.
LONGEST_RUN = 0.5
SHORTER_RUNS = (0.2, 0.1, 0.05, 0.02, 0.01, 0.005)
# Largest difference between a model's own motion and its smoothed version, as a share of the rms speed: impacts reach
# 0.1.
OWN_MOTION = 0.2
# Largest error on a model's own record due to the noise of the restarts, as a share of the path within a horizon.
OWN_ERROR = 0.1
# Runs of each of two searches for a play, some 3 s: enough for its nine numbers to reach the valley.
EVALUATIONS = 400
# Where they begin, in steps of a derivative: with 5 and 10, other ripples were found as often as the valley.
SPREAD = 2.0
# Largest deviation of a run due to a torque that is not worth naming, as a share of the path.
OFF_PATH = 0.05


@dataclass
class ObserverView:
    """One record under one residual filter."""

    record: ServoRecord
    filter: ResidualFilter
    scene: Scales
    noise: float  # standard deviation of the position noise
    start: tuple[Array, Array]
    train: NDArray[np.bool_]  # train, usable (n_decimated,): the samples that are fitted; those away from the edges
    usable: NDArray[np.bool_]
    tolerance: float  # torque below which nothing is worth naming, as a share of the rms drive
    quantum: float = 0.0
    step: float = LONGEST_STEP  # largest fine step of a run (s), see `coarsened`
    ar: Array = field(default_factory=lambda: np.array([1.0]))  # current whitening polynomial of the missing torque
    # where runs of the last models restart, which no horizon changes
    _starts: dict[Any, Any] = field(default_factory=dict, init=False, repr=False, compare=False)

    # --- looking ---------------------------------------------------------------------------
    @cached_property
    def smoothed(self) -> tuple[int, Array, Array]:
        """(width in samples, position, velocity) of the smoother that gives the start of every run."""
        r, dt = self.record, self.scene.dt
        width = smoothing_width([r.position[s] for s, _ in r.pieces], dt, self.noise)
        q, v = r.by_piece(lambda x: smoothed(x, dt, width), r.position)
        return width, q, v

    def held_near(self, model: ServoHypothesis) -> tuple[Array, Array, Array, Array]:
        """Prediction, angle and velocity of the model held near the record, and twist and its rate, shape (n, 2).

        A run that diverges is kept finite.
        """
        r = self.record
        out = model.follow(r.drive, r.position, self.filter.gains, start=self.start, pieces=r.pieces)
        far, fast = LOST * (self.scene.reach + abs(self.scene.centre)), LOST * self.scene.speed
        limits = (far, far, fast, fast)
        if all(-f < x.min() and x.max() < f for x, f in zip(out[:3], limits[:3], strict=True)):
            return out
        y_hat, angle, speed, twist = (np.clip(np.nan_to_num(x), -f, f) for x, f in zip(out, limits, strict=True))
        return y_hat, angle, speed, twist

    def starts(self, model: ServoHypothesis) -> tuple[tuple[Array, Array], Array]:
        """`restart_states` of the model, kept for runs over other horizons."""
        if (found := self._starts.get(model)) is None:
            if len(self._starts) >= MODELS_KEPT:
                self._starts = {}
            found = self._starts[model] = restart_states(self, model)
        return found  # type: ignore[no-any-return]

    def gap(self, model: ServoHypothesis) -> Array:
        """Torque that the model lacks, filtered; shape (n_decimated,)."""
        d = self.filter.torque(self.record.position - self.held_near(model)[0])
        return np.where(np.isfinite(d), np.clip(d, -1e6, 1e6), 1e6)

    def whitened(self, d: Array) -> Array:
        """All whitened samples."""
        return whiten(d, self.ar)[self.usable]

    def residual(self, model: ServoHypothesis) -> Array:
        """The residual that the fit minimises."""
        return whiten(self.gap(model), self.ar)[self.train & self.usable]

    @property
    def floor(self) -> float:
        """Rms of the missing torque due to position noise alone."""
        return self.filter.noise_gain * self.noise

    def rms(self, d: Array, *, fitted: bool = False) -> float:
        """Rms of the missing torque, of all samples or of those that are fitted."""
        return rms(d[self.train & self.usable if fitted else self.usable])

    def weigh(self, gap: float) -> None:
        """Set the whitening to position noise plus white torque of the rms ``gap``.

        Only the size of the gap is used, so no tone and no slow drift is whitened away.
        """
        taps, every = self.filter.taps, self.filter.every
        full = np.concatenate([taps, np.zeros(WHITENING * every)])
        r = np.array([taps @ full[i * every : i * every + taps.size] for i in range(WHITENING + 1)])
        white = max(gap, 0.5 * self.tolerance * self.scene.torque) ** 2
        self.ar = solve_whitening(self.noise**2 * r, white)

    def coarsened(self, model: ServoHypothesis) -> ObserverView:
        """The view with the longest fine step, at most a quarter of a sample, that does not change the gap.

        A record at 50 Hz does not need a step of a millisecond if its axis is slow (arm joints: 5 ms change the gap by
        5e-6 of the drive), but does if it is fast (a jaw with a mechanical time constant of 2 ms: 2e-3).
        """
        step, longest = LONGEST_STEP, self.scene.dt / FEWEST_STEPS
        if 2.0 * step > longest:
            return self
        gap = self.gap(dataclasses.replace(model, step=step))
        while 2.0 * step <= longest:
            other = self.gap(dataclasses.replace(model, step=2.0 * step))
            if self.rms(other - gap) > STEP_ERROR * self.tolerance * self.scene.torque:
                break
            step *= 2.0
        return dataclasses.replace(self, step=step)

    def fit(self, model: ServoHypothesis) -> ServoHypothesis:
        """The model refitted to the training part, weighted by the size of its own gap."""
        scene = dataclasses.replace(self.scene, inertia=model.scene.inertia)  # which the range of its own is around
        return _settle(self, dataclasses.replace(model, scene=scene, step=self.step))[0]

    # --- fitting ---------------------------------------------------------------------------
    def fitted(
        self, model: ServoHypothesis, *, max_iterations: int = 40, tolerance: float = 5e-4
    ) -> tuple[ServoHypothesis, Minimum]:
        """The model refitted to the training part, all free numbers together, under the current weights.

        ``max_iterations`` only ends a fit that crawls: in the valley of a Stribeck curve's three numbers twelve were
        not enough, and the residual was 2.7 times that at the minimum.
        """
        fit = least_squares(
            lambda x: self.residual(model.with_vector(x)),
            model.vector(),
            model.steps(),
            model.bounds(),
            max_iterations=max_iterations,
            tolerance=tolerance,
        )
        return model.with_vector(fit.x), fit


def with_load(view: ObserverView, model: ServoHypothesis, kind: Candidate) -> ServoHypothesis:
    """The model with a transmission seen from the load, fitted along the run; without it if no start shows a gain."""
    view.weigh(view.rms(view.gap(model)))
    model, fit = view.fitted(model, max_iterations=4)
    shape = _best_start(view, model, fit, kind)
    if not shape:
        return model
    tried = (view.fitted(model.with_term(ServoTerm(kind, q)), max_iterations=3) for q in _variants(view, shape))
    first, fit = min(tried, key=lambda f: f[1].cost)
    if _hopeless(view, model, fit):
        return first
    return _settle(view, first)[0]


def _best_start(view: ObserverView, model: ServoHypothesis, fit: Minimum, kind: Candidate) -> tuple[float, ...]:
    """The start whose signature promises the largest decrease beyond the model's own sensitivities; empty if none.

    The signature is the change of the residual.  A number of the model at a bound explains nothing.
    """
    low, high = model.bounds()
    own = fit.jacobian[:, (fit.x > low + 1e-6) & (fit.x < high - 1e-6)]
    best: tuple[float, tuple[float, ...]] = (0.0, ())
    for shape in kind.starts(view.scene):
        signature = (view.residual(model.with_term(ServoTerm(kind, shape))) - fit.residual)[:, None]
        if np.all(np.isfinite(signature)) and np.any(signature):
            drop, c = gain_of(fit.residual, own, signature)
            best = max(best, (drop if c[0] > 0.0 else 0.0, shape))
    return best[1]


def _hopeless(view: Any, model: ServoHypothesis, fit: Minimum) -> bool:
    """Whether no first step from any start gains enough to justify the numbers of the transmission.

    Settling takes ten times as long, and took most of the time for a record in which nothing is named in the end.
    """
    r = view.residual(model)
    numbers = fit.x.size - model.vector().size
    return bool(r.size * np.log(float(r @ r) / max(fit.cost, 1e-300)) < PAYS * numbers)


def _settle(view: Any, model: ServoHypothesis) -> tuple[ServoHypothesis, Minimum]:
    """Repeated fits, each weighted for the gap of the previous one: the weights of a large gap hide a small one."""
    gap = view.rms(view.gap(model))
    for _ in range(3):
        view.weigh(gap)
        model, fit = view.fitted(model)
        before, gap = gap, view.rms(view.gap(model))
        if gap > 0.8 * before:
            break
    return model, fit


def evolved(view: ObserverView, model: ServoHypothesis) -> ServoHypothesis:
    """The model after a search around its numbers, and one around them with the usual damping, fitted again.

    The cost of a play is a valley with ripples, one for every impact that comes a sample earlier or later, and a fit by
    derivatives ends in one of them: with five plays drawn by `benchmarks.blind`, it left 10 to 78 times the noise, and
    one search 1.3 to 25 times.  Two short ones find the valley more often than a long one.
    """
    view.weigh(view.rms(view.gap(model)))
    rng = np.random.default_rng(0)
    found = [_searched(view, start, rng) for start in (model, _softly(model))]
    return min((model, *(_settle(view, m)[0] for m in found)), key=lambda m: view.rms(view.gap(m), fitted=True))


def _searched(view: ObserverView, model: ServoHypothesis, rng: np.random.Generator) -> ServoHypothesis:
    """The best model that CMA-ES finds; Nelder and Mead's simplex and differential evolution ended in ripples.

    References
    ----------
    Hansen 2016, The CMA Evolution Strategy: A Tutorial, arXiv:1604.00772.
    """
    import cma

    x, scale = np.clip(model.vector(), *model.bounds()), SPREAD * model.steps()

    def at(z: Any) -> ServoHypothesis:
        return model.with_vector(x + scale * np.asarray(z))

    def cost(z: Any) -> float:
        left = view.residual(at(z))
        return float(np.log(left @ left))

    options = {
        "bounds": [(limit - x) / scale for limit in model.bounds()], "maxfevals": EVALUATIONS, "verbose": -9,
        "seed": np.nan, "randn": lambda *shape: rng.standard_normal(shape),  # without NumPy's global generator
    }  # fmt: skip
    return at(cma.CMAEvolutionStrategy(np.zeros(x.size), 1.0, options).optimize(cost).result.xbest)


def _softly(model: ServoHypothesis) -> ServoHypothesis:
    """The model with the usual damping of its play; a strong one stands for impacts that come at wrong times."""
    i = next(i for i, t in enumerate(model.terms) if t.kind.code == k.BACKLASH)
    term = model.terms[i]
    slot = term.kind.fields.index("damping_ratio")
    usual = term.with_slot(slot, term.kind.starts(model.scene)[0][slot - term.kind.linear])
    return model.replaced(i, usual)


def _variants(view: ObserverView, q: tuple[float, ...]) -> list[tuple[float, ...]]:
    """Starts with other load shares (and contact frequencies), because the two trade off against each other."""
    if len(q) == 4:  # compliance, share, damping, dry friction of the load
        return [(q[0], share, *q[2:]) for share in (0.25, 0.45, 0.7)]
    top = view.scene.resonance
    loads = ((0.3, 0.7 * top), (0.5, 0.9 * top))
    # within a factor of 1.4 of the gap the fit ends in it; from 1 and 2 alone, rounding decided
    return [(q[0] * g, share, hz, *q[3:]) for g in (0.5, 0.7, 1.0, 1.4, 2.0) for share, hz in loads]


WINDOWS = (0.08, 0.04, 0.02, 0.01, 0.005)  # s, of the smoother that gives the start of a run


def smoothed(position: Array, dt: float, width: int) -> tuple[Array, Array]:
    """Position and velocity by local polynomials of degree 4 over ``width`` samples (Savitzky, Golay 1964)."""
    from scipy.signal import savgol_filter

    return savgol_filter(position, width, 4), savgol_filter(position, width, 4, deriv=1, delta=dt)


def smoothing_width(positions: Sequence[Array], dt: float, noise: float) -> int:
    """The widest window, in samples, that changes the velocity by no more than noise does.

    The velocity of a narrow window differs from that of a wide one by its own noise, known from the window's weights,
    and by the motion that the wide one smooths away.  The wide one is used while noise is most of it (Lepski's
    rule of 1991 for choosing a bandwidth).  Otherwise, with a motor that cogs at 70 Hz under a stiff loop, every run
    would start with an error of a radian per second.
    """
    from scipy.signal import savgol_coeffs

    widths = sorted({max(7, 2 * round(w / 2 / dt) + 1) for w in WINDOWS}, reverse=True)
    shortest = min(q.size for q in positions)
    for wide, narrow in pairwise([w for w in widths if 2 * w < shortest] + widths[-1:]):
        # each segment by itself: a jump over a hole is motion that every window smooths away
        both = ((smoothed(q, dt, wide)[1], smoothed(q, dt, narrow)[1]) for q in positions)
        apart = np.concatenate([(a - b)[wide:-wide] for a, b in both])
        own = noise * float(np.linalg.norm(savgol_coeffs(narrow, 4, deriv=1, delta=dt)))
        if HALF * float(np.mean(apart**2)) < own**2:
            return wide
    return widths[-1]


def restart_states(view: Any, model: ServoHypothesis) -> tuple[tuple[Array, Array], Array]:
    """((angle, velocity), twist of the coupling with its rate) from which a run starts, at every sample.

    The state is the smoothed measurement plus whatever sensor and smoothing remove from the model's own motion while
    it is held near the record, because the impacts of play are faster than any smoother that suppresses the noise.  A
    model that cannot be held near the record does not affect its start.
    """
    dt = view.scene.dt
    width, q, v = view.smoothed
    y_hat, angle, speed, twist = view.held_near(model)
    folded = any(t.kind.name == "sensor_rectification" for t in model.terms)  # unfolded at the restart
    if folded or not (np.all(np.isfinite(y_hat)) and np.all(np.isfinite(twist))):
        return (q, v), np.zeros((0, 2))
    own_q, own_v = view.record.by_piece(lambda x: smoothed(x, dt, width), y_hat)
    if model.load_side:
        angle, speed = angle - twist[:, 0], speed - twist[:, 1]
    if rms(speed - own_v) > OWN_MOTION * view.scene.speed:
        return (q, v), np.zeros((0, 2))
    return (q + angle - own_q, v + speed - own_v), twist


def horizon_of(model: ServoHypothesis, scene: Any, tolerance: float) -> float:
    """The longest horizon in s, at most 0.5, over which a torque not worth naming keeps a run near the path.

    ``tolerance`` of the rms drive displaces an axis by tau h^2 / (2 J) or, if viscous friction dominates, by tau h /
    B; the path over h has the length v h.  The friction of a motor is never known better, so a longer run shows only
    drift.
    """
    viscous = sum(t.q[0] for t in model.terms if t.name == "viscous")
    error = tolerance * scene.torque
    if error <= OFF_PATH * viscous * scene.speed:
        return LONGEST_RUN
    longest = 2.0 * OFF_PATH * scene.speed * model.inertia / error
    digits = 10.0 ** np.floor(np.log10(longest))
    return float(np.clip(round(longest / digits) * digits, 10 * scene.dt, LONGEST_RUN))


def horizons_around(headline: float) -> tuple[float, ...]:
    """The horizons of a proof: the headline one, a fifth of it and four times it."""
    return headline / 5.0, headline, 4.0 * headline


def predictable(surrogate: Any, model: ServoHypothesis, longest: float) -> float:
    """The longest horizon up to ``longest`` (s) over which the model predicts a record that it simulated itself.

    If a motion passes unstable positions (a motor that cogs under a soft drive tips from tooth to tooth), the noise
    of a restart grows until a run shows nothing, whatever the model.
    """
    horizons = [longest, *(h for h in SHORTER_RUNS if 10 * model.scene.dt <= h < longest)]
    held = held_out(surrogate)
    for h in horizons:
        e = (surrogate.record.position - restarted_run(surrogate, model, h))[held]
        if np.all(np.isfinite(e)) and rms(e) < OWN_ERROR * h * model.scene.speed:
            return h
    return longest


def restarted_run(view: Any, model: ServoHypothesis, horizon: float) -> Array:
    """Simulated position, restarted every ``horizon`` seconds; shape (n,)."""
    every = max(1, round(horizon / view.scene.dt))
    start, twist = view.starts(model)
    return model.follow(
        view.record.drive, view.record.position, (0.0, 0.0), start=start, reset_every=every, twist=twist,
        pieces=view.record.pieces,
    )[0]  # fmt: skip


def held_out(view: Any, *, fitted: bool = False) -> NDArray[np.bool_]:
    """Held-out samples of the log, shape (n,), or with ``fitted`` all others, without the edges.

    The state at an edge is poorly known: neither the smoother nor the memory of a drive's lag reaches beyond it.
    """
    n = len(view.record)
    mask = training_samples(view.record.position) == fitted
    edge = int(0.5 / view.scene.dt)
    mask[:edge] = False
    mask[n - view.filter.half_width :] = False
    return mask & ~view.record.near_a_hole(view.filter.half_width, edge)


def misfit(view: Any, model: ServoHypothesis) -> float:
    """Mean square of the innovation; finite even for a model that diverges."""
    e = view.record.position - view.held_near(model)[0]
    return float(np.mean(np.clip(np.nan_to_num(e, nan=1e6), -1e6, 1e6) ** 2))


def train_error(view: Any, model: ServoHypothesis, horizon: float) -> float:
    """Rms error of the free run over the samples that are not held out, at most that of no model.

    A run that leaves the path farther than a constant would says nothing about its model.
    """
    y = view.record.position[fitted := held_out(view, fitted=True)]
    e = y - restarted_run(view, model, horizon)[fitted]
    return min(rms(e), float(np.std(y))) if np.all(np.isfinite(e)) else float("inf")
