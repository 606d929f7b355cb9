"""The measured motion for the columns of effects, and every shape of an effect that is worth trying.

The error is a missing torque over J, integrated twice, plus the response of friction, springs and controller to it.  So
e'' is regressed on e, e' and the motion (the simulator's own numbers may be wrong) and on one effect at a time, along
the measured motion; this takes no simulation for any number of shapes.  A law with few shapes is also tried by
simulation, one run per shape, because a constant shows in no derivative of a closed loop and not every simulator is a
free mass.  A simulator's own records are exact, so their residual is noise with the spectrum of its error and random
phases.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from itertools import product
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from whsklearn.effects import ContactStop, Coulomb, Effect, Scales, Viscous, effect_names, get_effect
from whsklearn.effects.base import rms
from whsklearn.filtering.records import CUTOFF_SIGMA, HIGHEST_CUTOFF, decimation, filtered, gaussian_derivatives
from whsklearn.gap.calibration import N_NULL, coloured, n_effective, smoothed_power
from whsklearn.gap.nameless import nameless
from whsklearn.gap.plants.servo_candidates import UNSEEN
from whsklearn.gap.plants.variant import EffectVariant
from whsklearn.gap.record import LEAST_WHITE, Array, noise_level
from whsklearn.gap.search import HALF
from whsklearn.gap.tangent import AT_ONCE, Family, Look, Tangent, strongest_lines
from whsklearn.logs.check import lattice

HIGHEST = 25.0  # Hz; above it, a second derivative contains only encoder noise
DEPTHS = np.array([0.003, 0.01, 0.03, 0.08])  # by which a stop may yield, as a share of half the travel
RELAXATIONS = (0.005, 0.02, 0.06)  # s, of a contact's damping


@dataclass(frozen=True)
class FollowedMotion:
    """The measured motion for the columns of effects, and the signals on which the error is regressed."""

    signals: Any
    kernels: tuple[Array, Array, Array]
    every: int
    usable: NDArray[np.bool_]
    _columns: dict[Effect, Array] = field(default_factory=dict, repr=False, compare=False)

    def seen(self, x: Array, derivative: int = 0) -> Array:
        """A signal, shape (n,) or (n, k), filtered by the Gaussian or its derivative and decimated."""
        return filtered(x, self.kernels[derivative], self.every)

    def seen_effect(self, effect: Effect) -> Array:
        """An effect's columns, differentiated twice if they add to the reading; computed once."""
        if effect not in self._columns:
            columns = columns_of(effect, self.signals)
            self._columns[effect] = self.seen(columns, 2 if effect.port == "output" else 0)
        return self._columns[effect]


def followed_motion(record: Any) -> FollowedMotion:
    """Smooth position, velocity and acceleration of a record; ``usable`` are the decimated samples away from edges."""
    from scipy.signal import fftconvolve

    cutoff = min(HIGHEST, HIGHEST_CUTOFF / record.dt)
    kernels = gaussian_derivatives(CUTOFF_SIGMA / (2 * np.pi * cutoff), record.dt)
    half = kernels[0].size // 2

    def smooth(x: Array) -> tuple[Array, ...]:
        padded = np.pad(x, half, mode="edge")
        return tuple(fftconvolve(padded, k, mode="valid") for k in kernels)

    q, v, a = record.by_piece(smooth, record.position)
    still = 3.0 * noise_level(record.position) / (CUTOFF_SIGMA / (2 * np.pi * cutoff))
    signals = SimpleNamespace(
        time=record.time - record.time[0], position=q, velocity=v, acceleration=a, drive=record.drive,
        kappa=1.0 / max(still, 0.01 * rms(v), 1e-12),
    )  # fmt: skip
    every = decimation(cutoff, record.dt)
    at = np.arange(0, len(record), every)
    edge = half // every + 1
    usable = (at >= edge * every) & (at < (at.size - edge) * every)
    for first in record.starts:
        usable &= np.abs(at - first) >= edge * every
    return FollowedMotion(signals, kernels, every, usable)


def acceleration(m: FollowedMotion, record: Any) -> float:
    """Rms acceleration of the motion."""
    return rms(m.seen(record.position, 2)[m.usable])


def gone(m: FollowedMotion, before: Array, after: Array, record: Any) -> float:
    """Rms change of the error's second derivative between two errors, as a share of the acceleration."""
    first, last = (rms(m.seen(e, 2)[m.usable]) for e in (before, after))
    return float(np.sqrt(max(first**2 - last**2, 0.0)) / max(acceleration(m, record), 1e-300))


def sized_by_drive(m: FollowedMotion, effect: Effect, train: NDArray[np.bool_]) -> Effect:
    """An effect at the size that fits the drive along the measured motion, beside inertia, friction and a constant.

    A large effect that acts only for instants, such as a stop, moves a simulation so far that its derivatives are
    meaningless.
    """
    s, at = m.signals, m.usable
    mask = train[:: m.every][at]
    own = [s.acceleration, *(e.columns(s)[:, 0] for e in (Viscous(1.0), Coulomb(1.0))), np.ones_like(s.velocity)]
    x = np.column_stack([m.seen(np.column_stack(own)), m.seen_effect(effect)])[at][mask]
    scale = np.linalg.norm(x, axis=0) + 1e-300
    sizes = np.linalg.lstsq(x / scale, m.seen(s.drive)[at][mask], rcond=1e-9)[0] / scale
    shape = {k: v for k, v in {**effect.shape, **effect.options}.items() if not (effect.phased and k == "phase")}
    return type(effect).from_coefficients(sizes[len(own) :], **shape)


def columns_of(effect: Effect, signals: Any) -> Array:
    """An effect's columns; an effect that is not a column times a weight gives one column at its size."""
    if effect.column_kind == "exact" and effect.size not in ("step",):
        return np.asarray(effect.resized(1.0).columns(signals), dtype=float)
    return np.asarray(effect.contribution(signals), dtype=float).reshape(-1, 1)


def scales_of(record: Any, signals: Any) -> Scales:
    """Scales of the record; the inertia is not known here."""
    return Scales(
        torque=rms(record.drive) or 1.0, peak=float(np.max(np.abs(record.drive))),
        speed=rms(signals.velocity) or 1.0, reach=0.5 * float(np.ptp(signals.position)) or 1.0,
        centre=0.5 * float(signals.position.min() + signals.position.max()), duration=float(signals.time[-1]),
        dt=record.dt,
    )  # fmt: skip


def catalogue(record: Any, signals: Any, further: tuple[type[Effect], ...] = ()) -> dict[str, list[Effect]]:
    """Every effect of the catalogue with columns, at every shape worth trying, and ``further`` shapes."""
    torque, out = rms(record.drive) or 1.0, dict[str, list[Effect]]()
    scales = scales_of(record, signals)
    effects = (get_effect(n) for n in effect_names() if n not in UNSEEN)
    slides = record.units[1] == "m"
    named = [cls for cls in effects if cls.column_kind != "none" and not (slides and cls.rotary)]
    for kind in (kind for cls in (*named, *further) for kind in EffectVariant.of(cls)):
        size = (0.1 * torque, 0.0)[: kind.linear]
        grid = kind.grid(scales, min(HIGHEST, 0.4 / record.dt)) or kind.cls.starts(scales)[:1]
        shapes = [kind.effect((*size, *shape)) for shape in grid]
        # numbers that other plants hold in a first look are fitted here, from anywhere in their range
        held = [] if kind.cls in further else kind.cls.later
        free = [dataclasses.replace(kind.cls.quantities[f], starts=()).grid(scales, n=3) for f in held]
        shapes += [
            dataclasses.replace(e, **dict(zip(held, row, strict=True)))
            for e in shapes
            if held
            for row in product(*free)
        ]
        out.setdefault(kind.name, []).extend([] if issubclass(kind.cls, ContactStop) else shapes)
    if any(issubclass(cls, ContactStop) for cls in further):
        out["end_stop"] += stops(record, signals)
    return out


def whole(shapes: list[Effect], fields: tuple[str, ...]) -> list[Effect]:
    """The shapes with these fields rounded to whole numbers, each once.

    >>> from whsklearn.effects import Cogging
    >>> [e.order for e in whole([Cogging(0.1, 5.8), Cogging(0.1, 6.1), Cogging(0.1, 6.6)], ("order",))]
    [6.0, 7.0]
    """
    out = []
    for e in shapes:
        there = {f: max(1.0, float(round(getattr(e, f)))) for f in fields if f in e.shape}
        out.append(dataclasses.replace(e, **there) if there else e)
    return list(dict.fromkeys(out))


def stops(record: Any, signals: Any) -> Iterator[Effect]:
    """Contacts at either end of the travel, or at both: a stop is as far within the travel as it yields."""
    torque = rms(record.drive) or 1.0
    low, high = float(signals.position.min()), float(signals.position.max())
    for depth in DEPTHS * 0.5 * (high - low):
        for relaxation in RELAXATIONS:
            size, upper, lower = 0.1 * torque / depth, high - depth, low + depth
            yield ContactStop(size, upper, relaxation=relaxation, side="upper")
            yield ContactStop(size, lower, relaxation=relaxation, side="lower")
            middle, half = 0.5 * (upper + lower), 0.5 * (upper - lower)
            yield ContactStop(size, half, relaxation=relaxation, centre=middle, side="both")


def smallest(plant: Any, model: Any, start: Any) -> tuple[Any, dict[str, Any]]:
    """(derivatives of the error by the sizes of a small effect, shape (n, 1 or 2); its other numbers)."""
    torque = rms(plant.record.drive) or 1.0
    shape = {k: v for k, v in {**start.shape, **start.options}.items() if not (start.phased and k == "phase")}
    if start.column_kind != "exact":  # it has no small size, so its own size is used
        return (plant.fits.error(model.simulator.with_effect(start)) - model.error)[:, None], shape
    unit = float(np.sqrt(np.mean(np.square(columns_of(start, plant.motion.signals))))) or 1.0
    small = (0.01 * torque if start.port != "output" else 10.0 * plant.noise) / unit
    weights = np.eye(2) * small if start.phased else np.array([[small]])
    columns = []
    for w in weights:
        moved = model.simulator.with_effect(type(start).from_coefficients(w, **shape))
        columns.append((plant.fits.error(moved) - model.error) / small)
    return np.column_stack(columns), shape


# --- looks ----------------------------------------------------------------------------------------
@dataclass(frozen=True)
class Errors:
    """The error of a model and those of its own records, in the form that looks take."""

    model: Any
    error: Array
    null: Array
    motion: FollowedMotion

    @classmethod
    def of(cls, plant: Any, model: Any, rng: np.random.Generator) -> Errors:
        """The errors of a fitted model."""
        null = own_errors(plant, model, rng)
        noise = plant.record.by_piece(lambda e: noise_of(e, plant.noise), model.error)
        position = plant.record.position - noise
        followed = followed_motion(dataclasses.replace(plant.record, position=position))
        return cls(model, model.error, np.array(null), followed)


def own_errors(plant: Any, model: Any, rng: np.random.Generator) -> Array:
    """Errors of records that the model makes, shape (`N_NULL`, n): the encoder's steps, and noise of the other colour.

    An axis that rests has one error of rounding for as long, which follows its position.  In noise of the same spectrum
    it is nowhere, and a simulator that lacked nothing any more was said to lack something without a name.
    """
    step, n = lattice(plant.record.position), model.error.size
    made = plant.record.position - model.error
    rows = made + LEAST_WHITE * plant.noise * rng.standard_normal((N_NULL, n))
    rows = (step * np.round(rows / step) if step else rows) - made
    power = smoothed_power(model.error) - np.mean([smoothed_power(row) for row in rows], axis=0)
    return rows + coloured(np.maximum(power, 0.0), (N_NULL, n), rng)


def noise_of(error: Array, noise: float) -> Array:
    """The part of a simulation's error that is noise of this rms: all lines of which noise is most (Wiener filter).

    Signals of a motion that contain the same noise as the error would explain it, like a sign at every reversal.
    """
    there_and_back = np.concatenate([error, error[::-1]])  # no jump at the junction
    share = noise**2 * there_and_back.size / np.maximum(HALF * smoothed_power(there_and_back), 1e-300)
    lines = np.fft.rfft(there_and_back) * np.minimum(share, 1.0)
    return np.asarray(np.fft.irfft(lines, there_and_back.size)[: error.size])


def accelerations(plant: Any, seen: Errors) -> Iterator[Look]:
    """Look at every effect at all shapes, and at nameless functions of the motion, in the error's second derivative."""
    m = seen.motion
    s, at = m.signals, m.usable
    mask = plant.train[:: m.every][at]
    own = m.seen(np.column_stack([s.acceleration, Viscous(1.0).columns(s), Coulomb(1.0).columns(s)]))[at][mask]

    def parts(e: Array) -> tuple[Array, Array]:
        return m.seen(e, 2)[at][mask], np.column_stack([m.seen(e), m.seen(e, 1)])[at][mask]

    left, answers = parts(seen.error)
    # every own record has its own responses
    null = [free(target, np.column_stack([own, z])) for target, z in map(parts, seen.null)]
    plane = np.column_stack([own, answers])
    rest = free(left, plane)
    tangent = Tangent(left, np.array(null), plane, n_effective(rest))
    # a signal that repeats in time passes any loop unchanged, and the error that it causes would explain it
    timed = Tangent(left, np.array([parts(e)[0] for e in seen.null]), own, n_effective(free(left, own)))
    share = plant.scale / max(acceleration(m, plant.record), 1e-300)

    def column(effect: Effect) -> Array:
        return m.seen_effect(effect)[at][mask]

    judged = at.copy()
    judged[at] = mask
    for name, shapes in addable(plant, seen.model):
        known, chosen = [e for e in shapes if columns_of(e, s).size], tangent
        scanned = shapes[0].scanned()
        if known and scanned and shapes[0].quantities[scanned].scan == "time":
            low, high = shapes[0].quantities[scanned].bounds(scales_of(plant.record, s))
            lines = strongest_lines(timed.rows, judged, m.every * plant.record.dt, low, min(high, HIGHEST))
            known, chosen = [*known, *(dataclasses.replace(shapes[0], **{scanned: f}) for f in lines)], timed
        look = chosen.look(one_effect(name, known, column)) if known else None
        if look is not None:
            yield dataclasses.replace(look, size=look.size * share)
    signals = (x[:: m.every][at][mask] for x in (s.position, s.velocity, s.drive))
    for family in nameless(scales_of(plant.record, s), *signals):
        look = tangent.look(family)
        if look is not None:
            yield dataclasses.replace(look, size=look.size * share)


def slopes(plant: Any, seen: Errors) -> Iterator[Look]:
    """Look at effects without a scan, some of which have no column, by how a small size changes the simulation."""
    train = plant.train
    plane = plant.fits.tangent(seen.model)[train]
    left = seen.error[train]
    tangent = Tangent(left, seen.null[:, train], plane, n_effective(free(left, plane)))

    def column(effect: Effect) -> Array:
        return np.asarray(smallest(plant, seen.model, effect)[0][train])

    for name, shapes in addable(plant, seen.model):
        # one run each: only shapes that differ in one number, of which there are few
        few = [e for e in shapes if not e.scanned() and (len(e.searched()) < 2 or len(shapes) == 1)]
        try:
            look = tangent.look(one_effect(name, few, column)) if few else None
        except (ValueError, NotImplementedError, FloatingPointError) as error:
            plant.refused[name] = str(error)
            continue
        if look is not None:
            yield look


def addable(plant: Any, model: Any) -> list[tuple[str, list[Any]]]:
    """Names and shapes that may be added to a model: an effect occurs once unless it repeats, as waves do.

    A second Stribeck curve would mend the shape of the first; four of them took two minutes to find.
    """
    there = {t.name for t in model.terms}
    return [(name, shapes) for name, shapes in plant.shapes.items() if name not in there or shapes[0].repeats]


def one_effect(name: str, shapes: list[Any], column: Callable[[Effect], Array]) -> Family:
    """One effect with all its shapes; ``column`` gives the columns of one."""

    def blocks(_: Tangent) -> Iterator[tuple[Any, Array, float]]:
        for i in range(0, len(shapes), AT_ONCE):
            some = shapes[i : i + AT_ONCE]
            yield some, np.stack([column(e) for e in some], axis=1), 1.0

    numbers = len(shapes[0].coefficients) + len(shapes[0].shape_fields()) or 1
    return Family(name, blocks, lambda shape, _: (shape,), numbers)


def free(target: Array, columns: Array) -> Array:
    """Residual of a target after least squares on the columns."""
    scale = np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
    q, _ = np.linalg.qr(columns / scale)
    return np.asarray(target - q @ (q.T @ target))
