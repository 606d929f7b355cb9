"""The robust view of a servo axis: inverse dynamics on the measured motion.

torque = J a + sum of effects holds on the measured motion however much is missing, so it finds large effects that the
observer view no longer shows.  Every column is blurred like the drive: G tau(q, v), not tau(G q, G v).  Timing is
always a nuisance column, the derivative of the predicted torque.  Effects of the drive act on the torque that the
model predicts, or they would explain the drive by itself.  Effects that transform the whole drive (delay, lag, dead
zone) have no valid column and are left to the observer; a limit changes the target instead.
"""

from __future__ import annotations

import dataclasses
from copy import copy
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from whsklearn.effects import Scales, Surroundings, codes
from whsklearn.effects.base import rms
from whsklearn.filtering.records import CUTOFF_SIGMA, decimation, filtered, gaussian_derivatives
from whsklearn.gap import least_squares as ols
from whsklearn.gap.least_squares import jacobian
from whsklearn.gap.plant import Linearised
from whsklearn.gap.plants import servo_stop as stop
from whsklearn.gap.plants import servo_two_mass as two_mass
from whsklearn.gap.plants.servo_candidates import TWO_MASS, ColumnSignals
from whsklearn.gap.plants.servo_model import MODELS_KEPT, ServoHypothesis, ServoTerm
from whsklearn.gap.record import Array, ServoRecord
from whsklearn.gap.search import HALF
from whsklearn.identification.axis_inverse import KNOWN
from whsklearn.identification.drive_lead import LATEST, OLDEST
from whsklearn.logs.check import lattice, runs

KEPT = 40  # columns cached, because a polish moves one shape and not the others
# An axis rests below so many standard deviations of its velocity's noise; in records without noise, below this share of
# the rms velocity.
NOISY, SLOW = 3.0, 0.01
# Independent samples in motion for each number, below which no name is certain: the usual rule of regression (Harrell
# 2015, Regression Modeling Strategies, section 4.4). If there are not so many in all, rests are used too, which say
# little: dry friction holds against any drive, and a short log of a motor that stalls "lacked" a limit of its drive.
PER_NUMBER = 10


def reaching(t: ServoTerm, u: Array, motion: ColumnSignals, dt: float) -> Array:
    """The drive after an effect that transforms it: reduced at a limit or around zero, late by a delay or a lag."""
    if t.kind.cls.column_kind == "at_size":
        return u - np.asarray(t.effect.contribution(motion._replace(drive=u)))
    return later(t.kind.code, u, t.q[0], dt)


def later(code: int, u: Array, age: float, dt: float) -> Array:
    """A drive that reaches the axis late, delayed or through a first-order lag."""
    if code == codes.INPUT_DELAY:
        t = np.arange(u.size) * dt
        return np.interp(t - age, t, u)
    a = np.exp(-dt / max(age, 1e-9))
    return np.asarray(lfilter([1 - a], [1, -a], u, zi=[a * u[0]])[0])


def lag_of(model: ServoHypothesis) -> float:
    """Time constant of the actuator in a model, s; zero without one."""
    return float(sum(t.q[0] for t in model.terms if t.kind.code == codes.ACTUATOR_LAG))


def noise_behind(kernel: Array, record: ServoRecord, noise: float) -> float:
    """Standard deviation of the position's noise, ``noise``, behind a filter with the taps ``kernel``.

    The noise of a logged velocity is white, and that of its integral is a sum of it.
    """
    if not record.speed_noise:
        return noise * float(np.linalg.norm(kernel))
    return record.speed_noise * record.dt * float(np.linalg.norm(np.cumsum(kernel)))


class InverseView:
    """One record filtered by one Gaussian of the ``cutoff`` (Hz).

    ``start``: smoothed position and velocity from which a surrogate starts. ``noise``: standard deviation of the
    position's.
    """

    def __init__(self, record: ServoRecord, scene: Scales, cutoff: float, start: tuple[Array, Array], noise: float):
        self.record, self.scene, self.cutoff, self.start, self.noise = record, scene, cutoff, start, noise
        dt, y, u = scene.dt, record.position, record.drive
        # Resampled readings are on no grid any more, but their errors are still constant where the axis turns. A grid
        # on which readings hardly repeat counts if it makes most of the noise.
        fine_grid = record.quantum or lattice(y, distinct=1.0)
        self.quantum = lattice(y) or (fine_grid if fine_grid**2 / 12.0 >= HALF * noise**2 else 0.0)
        sigma = CUTOFF_SIGMA / (2 * np.pi * cutoff)
        self.g, _, g2 = gaussian_derivatives(sigma, dt)
        self.every = decimation(cutoff, dt)
        narrow = CUTOFF_SIGMA / (2 * np.pi * min(2 * cutoff, 0.1 / dt))
        fine = gaussian_derivatives(narrow, dt)
        centre = float(np.mean(y))
        q, v, a = record.smoothed(
            lambda x: tuple(filtered(x, kernel, 1) for kernel in fine), y - centre, fine[0].size // 2
        )
        self.time = record.clock
        self.motion = ColumnSignals(self.time, q + centre, v, a, u)
        self.slowest = max(NOISY * noise_behind(fine[1], record, noise), SLOW * scene.speed)
        # below it the sign of the velocity is not known: it is in the noise, or friction's kink is smoothed here
        # (`kappa`), or the filter sees less than one step of the grid
        self.unknown = max(self.slowest, self.quantum / (2.0 * narrow))
        self.motion = self.motion._replace(kappa=2.0 / self.slowest)
        self.acceleration = filtered(y - centre, g2, self.every)
        self.acceleration_noise = noise_behind(g2, record, noise)
        self.drive = self.blur(u)
        self.moving, whole = self._moving(sigma)
        enough = self.moving.sum() >= PER_NUMBER
        self.usable = self.moving if enough else whole
        self.at = np.flatnonzero(self.usable)
        self.step = self.every * dt
        self.n_effective = self.at.size * min(1.0, 2 * cutoff * self.step)
        self.own: Any = None  # what a model's own records show of this view (`servo_own.Own`)
        self._columns: dict[Any, Array] = {}
        self._solutions: dict[Any, Any] = {}  # of the last models, each with the own records that it was solved with

    def _moving(self, sigma: float) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """Decimated samples away from the ends and from rests longer than two sigma, where friction is undetermined.

        The second mask includes the rests and the ends.
        """
        dt, n = self.scene.dt, len(self.record)
        still = np.abs(self.motion.velocity) < self.slowest
        keep = np.ones(n, dtype=bool)
        for a, b in zip(*runs(still), strict=True):
            if (b - a) * dt > 2 * sigma:
                keep[a:b] = False
        half = self.g.size // 2
        keep[:half] = keep[n - half :] = False
        keep &= ~(holes := self.record.near_a_hole(2 * half, 2 * half))
        return keep[:: self.every], ~holes[:: self.every]

    def undirected(self, model: ServoHypothesis) -> Array:
        """Share of the filter's window in which the direction of dry friction is unknown, at the judged samples.

        That is where the sign of the velocity is, and between an early reversal of friction and that of the velocity.
        """
        speed = self.motion.velocity
        still = np.abs(speed) < self.unknown
        if model.early:
            still |= speed * (speed + model.early.lead * self.motion.acceleration) < 0.0
        return self.blur(still.astype(float))[self.at] / self.g.sum()

    @property
    def artefact(self) -> Array | None:
        """Residual of a model's own records in this view, at the judged samples; None if they are not known."""
        return None if self.own is None else self.own.mean

    def told(self, model: ServoHypothesis) -> Array | None:
        """Weights of the judged samples, shape (n,): what each tells of what is missing; None if all count in full.

        Next to nothing where the axis all but rests (`servo_own.weights`), and nothing at all in contact with a stop.
        """
        away = stop.away(self, model)
        if self.own is None:
            return away
        return np.asarray(self.own.weight if away is None else away * self.own.weight)

    def rms(self, gap: Array) -> float:
        """Rms over the judged samples."""
        return rms(gap)

    def drive_noise(self, gap: Array) -> float:
        """Standard deviation of the white noise that the drive's reading may have: no more than all of a ``gap``."""
        return min(self.record.drive_noise, self.rms(gap) / float(np.linalg.norm(self.g)))

    def bare(self) -> InverseView:
        """The view without subtracting the artefacts."""
        if self.own is None:
            return self
        other = copy(self)
        other.own, other._columns = None, {}
        return other

    def beside(self, record: ServoRecord) -> InverseView:
        """The same view of another record of the same experiment, judged at the same samples."""
        other = InverseView(record, self.scene, self.cutoff, self.start, self.noise)
        other.usable, other.at, other.n_effective = self.usable, self.at, self.n_effective
        other.unknown, other.slowest = self.unknown, self.slowest
        other.motion = other.motion._replace(kappa=self.motion.kappa)
        return other

    def spread(self, left: Array) -> Array:
        """Spread the residual at the judged samples to all samples of the record; zero where nothing is judged."""
        whole = np.zeros(self.usable.size)
        whole[self.at] = left
        return np.interp(self.time, self.time[:: self.every], whole)

    def age(self, model: ServoHypothesis) -> float:
        """Age of the drive (s), without limit: the size of the timing column."""
        x, _ = self.columns(model, self.torque(model) if self._driven(model) else None)
        target, share = self.target(model)
        rate = ols.slope(x @ self.sizes(model), self.step)
        c, *_ = np.linalg.lstsq(np.column_stack([x, rate])[self.at], target[self.at] * share, rcond=1e-10)
        return float(c[-1])

    # --- columns ---------------------------------------------------------------------------
    def blur(self, x: Array) -> Array:
        """The signal filtered by the Gaussian."""
        return filtered(x, self.g, self.every)

    def columns(self, model: ServoHypothesis, torque: Array | None = None) -> tuple[Array, NDArray[np.bool_]]:
        """(columns of inertia and of every linear number of the terms, mask of those that must be positive)."""
        x, positive = self._of_the_axis(model, torque)
        return self.before_lag(model, x), positive

    def _of_the_axis(self, model: ServoHypothesis, torque: Array | None) -> tuple[Array, NDArray[np.bool_]]:
        """The same columns behind any lag of the actuator."""
        parts, positive = [self.acceleration], [True]
        for t in model.terms:
            c = self.term_columns(model, t, torque)
            parts += list(c.T)
            positive += [t.kind.positive] * c.shape[1]
        return np.column_stack(parts), np.array(positive)

    def before_lag(self, model: ServoHypothesis, x: Array) -> Array:
        """The drive that an actuator with the model's lag must be given for the torques ``x`` (n, ...): m + T m'.

        A lagged drive is smaller the faster it is, and so is every residual behind it, whatever the model lacks: under
        a speed controller the fit ended without inertia, at a lag that took its place.  Models are therefore compared
        by the drive before the lag.
        """
        lag = lag_of(model)
        return x + lag * ols.slope(x, self.step) if lag else x

    def term_columns(self, model: ServoHypothesis, t: ServoTerm, torque: Array | None) -> Array:
        """Columns of one term, shape (n, number of its linear numbers)."""
        if t.kind.code in TWO_MASS:
            return two_mass.columns(self, model, t, torque)
        if t.kind.linear == 0:
            return np.empty((self.acceleration.size, 0))
        if self._depends(t):
            return self._new_columns(model, t, torque)
        key = (t.kind.label, t.q[t.kind.linear :], model.early, model.creep)
        columns = self._columns.get(key)
        if columns is None:
            if len(self._columns) > KEPT:  # all at once, because two threads may compute derivatives in parallel
                self._columns = {}
            columns = self._columns[key] = self._new_columns(model, t, torque)
        return columns

    def _new_columns(self, model: ServoHypothesis, t: ServoTerm, torque: Array | None) -> Array:
        if t.kind.cls.port == "output":  # J a and B v are computed from a reading that is ahead by the error
            waves = t.kind.unit_columns(t.q[t.kind.linear :], self.motion)
            _, _, g2 = gaussian_derivatives(CUTOFF_SIGMA / (2 * np.pi * self.cutoff), self.scene.dt)
            return -model.inertia * filtered(waves, g2, self.every)
        s = self.motion if torque is None else self.motion._replace(drive=torque)
        return self.blur(t.kind.unit_columns(t.q[t.kind.linear :], model.reversing(t, s)))

    # --- the protocol ------------------------------------------------------------------------
    def solved(self, model: ServoHypothesis) -> tuple[ServoHypothesis, Array, Array, Array, NDArray[np.bool_]]:
        """(model with its sizes, columns with timing last, target, sizes, mask of columns used), at its shapes.

        A gap is asked for again and again, so the last solutions are kept; they are not to be changed.
        """
        key = id(self.own), model
        if (kept := self._solutions.get(key)) is None:
            if len(self._solutions) >= MODELS_KEPT:  # all at once, as with the columns
                self._solutions = {}
            kept = self._solutions[key] = self._solve(model), self.own
        return kept[0]  # type: ignore[no-any-return]

    def _solve(self, model: ServoHypothesis) -> tuple[ServoHypothesis, Array, Array, Array, NDArray[np.bool_]]:
        torque = self.torque(model) if self._driven(model) else None
        x, positive = self.columns(model, torque)
        target, share = self.target(model)
        away, target, x = stop.away(self, model), share * target, share * x
        if self.artefact is not None:
            target[self.at] -= self.artefact
        open_x = stop.without_pushes(model, x)
        sizes, free = self._sizes(open_x, target, positive, away)
        rate = ols.slope(open_x @ sizes, self.step)
        sizes, free = self._sizes(np.column_stack([open_x, rate]), target, np.append(positive, False), away)
        timing = self._plausible_age(model, float(sizes[-1]))
        # u(t - T) = m means u = m + T m' + T^2 m'' / 2; without the second order a lag looks like a delay
        target = target - 0.5 * timing**2 * ols.slope(rate, self.step)
        if timing == sizes[-1]:
            columns = np.column_stack([x, rate])
            sizes, free = self._sizes(np.column_stack([open_x, rate]), target, np.append(positive, False), away)
        else:
            columns, target = x, target - timing * rate
            sizes, free = self._sizes(open_x, target, positive, away)
        if away is not None:
            sizes = sizes + stop.stiffness(model, columns[self.at], (target - columns @ sizes)[self.at])
        return self.with_sizes(model, np.append(sizes[: x.shape[1]], timing)), columns, target, sizes, free

    def _plausible_age(self, model: ServoHypothesis, age: float) -> float:
        """The age of a drive (s) within its limits; an age beyond bookkeeping is a delay, which is an effect.

        Beside a delay or a lag an age is bookkeeping: one logged late would have been moved, and the two would cancel.
        """
        latest = LATEST * self.scene.dt
        earliest = latest if any(t.kind.delays for t in model.terms) else OLDEST
        return min(max(age, -earliest), latest)

    def target(self, model: ServoHypothesis) -> tuple[Array, float]:
        """(drive that reaches the axis or its lag, rms of the logged drive over that of this drive).

        A limit has no column: it removes the peaks of the drive and with them the residual of the model at the peaks.
        Residuals are therefore compared as shares of the drive that reaches the axis.
        """
        u = self.reaching(model)
        # a dead zone of nearly all of the drive leaves what anything explains; behind a limit the axis still moves
        idle = any(t.kind.code == codes.DEAD_ZONE for t in model.terms)
        if u is self.record.drive or (idle and not self.varies(u, model.vector().size)):
            return self.drive.copy(), 1.0
        reaches = self.before_lag(model, self.blur(u))
        return reaches, self.rms(self.drive[self.at]) / max(self.rms(reaches[self.at]), 1e-300)

    def reaching(self, model: ServoHypothesis) -> Array:
        """The logged drive behind the model's limits, dead zones and delays, at full rate."""
        u = self.record.drive
        for t in model.terms:
            if t.kind.transforms:
                u = reaching(t, u, self.motion, self.scene.dt)
        return u

    def varies(self, u: Array, numbers: int) -> bool:
        """Whether what reaches the axis, at full rate, changes at more independent judged samples than ``numbers``."""
        flat = np.abs(np.diff(u, append=np.inf)) <= 1e-9 * np.abs(np.diff(self.record.drive, append=np.inf))
        return bool(self.n_effective * (1.0 - np.mean(flat[:: self.every][self.at])) > numbers)

    def _sizes(
        self, x: Array, target: Array, positive: NDArray[np.bool_], away: Array | None
    ) -> tuple[Array, NDArray[np.bool_]]:
        """Least squares on the judged samples without contact at a stop."""
        x, target = x[self.at], target[self.at]
        if away is not None:
            x, target = x * away[:, None], target * away
        return ols.solve(x, target, positive)

    def with_sizes(self, model: ServoHypothesis, sizes: Array) -> ServoHypothesis:
        """The model with the solved inertia, linear numbers and timing."""
        if any(t.kind.code in TWO_MASS for t in model.terms):
            return two_mass.with_sizes(self, model, sizes)
        terms, i = [], 1
        for t in model.terms:
            terms.append(dataclasses.replace(t, q=(*map(float, sizes[i : i + t.kind.linear]), *t.q[t.kind.linear :])))
            i += t.kind.linear
        inertia = max(float(sizes[0]), 1e-3 * self.scene.inertia)
        timing = float(np.clip(sizes[-1] / self.scene.dt, -1.0, 1.0))
        return dataclasses.replace(model, inertia=inertia, timing=timing, terms=tuple(terms))

    def torque(self, model: ServoHypothesis) -> Array | None:
        """Torque that the model predicts, at full rate; None if its residual is too large to replace the drive."""
        predicted = self._of_the_axis(model, self.record.drive)[0] @ self.sizes(model)
        left = self.rms((self.target(model)[0] - self.before_lag(model, predicted))[self.at])
        if left > KNOWN * self.scene.torque:
            return None
        return np.interp(self.time, self.time[:: self.every], predicted)

    def sizes(self, model: ServoHypothesis) -> Array:
        """Inertia and linear numbers in the order of `columns`."""
        if any(t.kind.code in TWO_MASS for t in model.terms):
            return two_mass.sizes(model)
        return np.array([model.inertia, *(n for t in model.terms for n in t.q[: t.kind.linear])])

    def fit(self, model: ServoHypothesis) -> ServoHypothesis:
        """The model with its sizes solved for at its shapes."""
        once = self.solved(model)[0]
        return self.solved(once)[0] if self._driven(model) else once

    def of_differences(self, model: ServoHypothesis) -> list[ServoHypothesis]:
        """The model with the inertia of the first differences, its other sizes solved for at this inertia.

        Empty if the differences give no positive inertia, because noise outweighs the acceleration in them (SO-101,
        whose drive is the following error).
        """
        x, positive = self.columns(model, self.torque(model) if self._driven(model) else None)
        target, _ = self.target(model)
        inertia = float(ols.of_differences(x[self.at], target[self.at])[0])
        if not inertia > 0.0:
            return []
        rest = np.column_stack([np.zeros(target.size), x[:, 1:]])
        sizes, _ = self._sizes(rest, target - inertia * x[:, 0], positive, stop.away(self, model))
        solved = self.with_sizes(model, np.append(sizes, 0.0))
        return [dataclasses.replace(solved, inertia=inertia, timing=model.timing)]

    def _driven(self, model: ServoHypothesis) -> bool:
        """Whether any columns depend on the model's own numbers."""
        return any(self._depends(t) for t in model.terms)

    @staticmethod
    def _depends(t: ServoTerm) -> bool:
        """Whether a term's columns contain the predicted torque, or the inertia (an error of the reading)."""
        return t.kind.driven or t.kind.cls.port == "output" or t.kind.on_load

    def gap(self, model: ServoHypothesis) -> Array:
        """Drive that the model leaves unexplained at the judged samples."""
        return self._solved_gap(model)[1]

    def fit_with_gap(self, model: ServoHypothesis) -> tuple[ServoHypothesis, Array]:
        """`fit` and the `gap` that it leaves; one solution gives both unless columns depend on the model's numbers."""
        if not self._driven(model):
            return self._solved_gap(model)
        model = self.fit(model)
        return model, self.gap(model)

    def _solved_gap(self, model: ServoHypothesis) -> tuple[ServoHypothesis, Array]:
        solved, x, target, sizes, _ = self.solved(model)
        left = (target - stop.without_pushes(model, x) @ sizes)[self.at]
        return solved, weighted(left, self.told(model))

    def taken_off(self, model: ServoHypothesis) -> float:
        """Rms of the drive over that of what terms leave of it which multiply it (see `target`).

        They multiply the torque of the model; where it does not predict one, the drive, and with that they take away
        whatever else is missing: half of the drive was called a change of the gain, in place of an arm's gravity.
        """
        multiplies = [t.kind.driven for t in model.terms for _ in range(t.kind.linear)]
        if not any(multiplies) or self.torque(model) is not None:
            return 1.0
        _, x, target, sizes, _ = self.solved(model)
        i = 1 + np.flatnonzero(multiplies)
        reaches = target - x[:, i] @ sizes[i]
        return self.rms(target[self.at]) / max(self.rms(reaches[self.at]), 1e-300)

    def left(self, model: ServoHypothesis, torque: Array | None = None) -> Array:
        """Drive that the model leaves unexplained at its own numbers, which are not solved for."""
        x, _ = self.columns(model, self.torque(model) if torque is None else torque)
        predicted = x @ self.sizes(model)
        rate = ols.slope(predicted, self.step)
        return (self.target(model)[0] - predicted - model.timing * self.scene.dt * rate)[self.at]

    def as_learned(self, model: ServoHypothesis) -> Array:
        """Drive that the model leaves unexplained at its own numbers; only the age of the drive is fitted.

        An age with the best free run differs by the hold from that of inverse dynamics.
        """
        target, share = self.target(model)
        predicted = share * self.columns(model, self.torque(model))[0] @ self.sizes(model)
        rate = ols.slope(predicted, self.step)[self.at]
        left = (share * target - predicted)[self.at] - (0.0 if self.artefact is None else self.artefact)
        left -= self._plausible_age(model, float(rate @ left) / (float(rate @ rate) + 1e-300)) * rate
        return weighted(left, self.told(model))

    def linearised(self, model: ServoHypothesis) -> Linearised:
        """Residual and derivatives by all free numbers, scaled to the number of independent samples.

        The residual is linear in the sizes, so their derivatives are the columns.  Differences would cost a new set of
        columns each, and learned curves have dozens of sizes.
        """
        factor = np.sqrt(self.n_effective / self.at.size)

        def residual(x: Array) -> Array:
            return factor * (self.left(model.with_vector(x), torque) - artefact)

        # as a gap, it is a share of the drive as logged, and what is left here one of the drive behind any limit
        artefact = 0.0 if self.artefact is None else self.artefact / self.target(model)[1]
        torque = self.torque(model)
        columns = self.columns(model, torque)[0]
        x, (low, high) = model.vector(), model.bounds()
        r = residual(x)
        sizes, first = np.zeros(x.size, dtype=np.intp), 1 + np.cumsum([0, *(t.kind.linear for t in model.terms)])
        if not any(t.kind.code in TWO_MASS for t in model.terms):  # they split the inertia and are not linear
            sizes[2:] = [first[i] + j if j < model.terms[i].kind.linear else 0 for i, j, _ in model.free()]
        rest = np.flatnonzero(sizes == 0)

        def moved(part: Array) -> Array:
            whole = x.copy()
            whole[rest] = part
            return residual(whole)

        slopes = -factor * columns[self.at][:, sizes]
        slopes[:, rest] = jacobian(moved, x[rest], r, model.steps()[rest], high[rest])
        # a number that is held, as the age of the drive beside a delay, takes no share in the errors of the others
        slopes[:, high - low < model.steps()] = 0.0
        return Linearised(x, low, high, r, slopes, model.with_vector)


def weighted(left: Array, weight: Array | None) -> Array:
    """The residual times the weights, if there are any."""
    return left if weight is None else left * weight


def unphysical(view: InverseView, model: ServoHypothesis, index: int, *, silent: bool = False) -> str:
    """The physical objection to the numbers of a term, beside which a model is ``silent``; empty if there is none."""
    term = model.terms[index]
    if term.kind.positive and term.q[0] <= 0:
        return f"its size would be {term.q[0]:.3g}, but a physical one is positive"
    return (
        model.at_the_end(index)
        or term.effect.implausible(surroundings(view, model)._replace(silent=silent))
        or too_large(term)
        or always_limited(view, model, index)
    )


def surroundings(view: InverseView, model: ServoHypothesis) -> Surroundings:
    """The record and the model, as effects judge by them whether they can be there."""
    sizes: dict[str, float] = {}
    for t in model.terms:
        sizes[t.name] = sizes.get(t.name, 0.0) + float(t.q[0])
    record = view.record
    limits = [t.q[0] for t in model.terms if t.kind.code == codes.SATURATION]
    carried = any(t.effect.place in ("position", "time") for t in model.terms)
    return Surroundings(
        record.position, view.motion.velocity, record.drive, model.inertia, sizes, min(limits, default=np.inf), carried,
        view.quantum, record.dt, record.units[1] == "rad", record.reference if record.is_following_error else None,
    )  # fmt: skip


def too_large(term: ServoTerm) -> str:
    """The objection that an effect takes so much of the drive that it replaces the drive; empty if it does not."""
    size = term.kind.cls.quantities[term.kind.cls.size]
    share = float(np.linalg.norm(term.q[:2])) if term.kind.linear == 2 else abs(float(term.q[0]))
    if not term.kind.driven or size.unit != "1" or share <= size.high:
        return ""
    return f"it would take {100 * share:.0f} % of the drive, which no motor or gear does"


def beside_its_sign(limit: float, drive: Array) -> Array:
    """What a limit leaves of a drive beside mean and sign, shape (n,)."""
    plain, left = np.column_stack([np.ones_like(drive), np.sign(drive)]), np.clip(drive, -limit, limit)
    return np.asarray(left - plain @ np.linalg.lstsq(plain, left, rcond=None)[0])


def unexplained(view: InverseView, model: ServoHypothesis, limit: float) -> float:
    """What a model with a limit lacks, over what the limit leaves of the drive beside its mean and sign."""
    rest = view.rms(view.blur(beside_its_sign(limit, view.record.drive))[view.at])
    missing = view.rms(view.gap(model)) / view.target(model)[1]  # a gap is a share of the drive as logged
    return float(missing / max(rest, 1e-300))


def always_limited(view: InverseView, model: ServoHypothesis, index: int) -> str:
    """The objection that the model explains nothing of what a limit leaves of the drive beside its mean and sign.

    Friction, or a constant speed, explains a mean and a sign, whatever is missing: of a wrist of SO-101 the gap is two
    to four times what a limit leaves, in logs of MuJoCo that are at their limit for most of the time a third of it.
    """
    term = model.terms[index]
    if term.kind.code != codes.SATURATION or term.q[0] <= 0.0 or unexplained(view, model, term.q[0]) < 1.0:
        return ""
    return "what it leaves of the drive beside its sign is less than what is missing"
