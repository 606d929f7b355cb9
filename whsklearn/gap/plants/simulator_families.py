"""Columns of the effects that a simulator may lack, for its error's second derivative and for the simulation itself.

The error is a missing torque over J, integrated twice, plus the response of friction, springs and controller to it.  So
e'' is regressed on e, e' and the motion (the simulator's own numbers may be wrong) and on one effect at a time, along
the measured motion; this takes no simulation for any number of shapes.  A law with few shapes is also tried by
simulation, one run per shape, because a constant shows in no derivative of a closed loop and not every simulator is a
free mass.  A simulator's own records are exact, so their residual is noise with the spectrum of its error and random
phases.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from whsklearn.effects import Coulomb, Effect, Viscous
from whsklearn.gap.calibration import coloured, n_effective, smoothed_power
from whsklearn.gap.plants.simulator_look import Motion, acceleration, columns_of, motion
from whsklearn.gap.plants.simulator_model import SimulatorModel
from whsklearn.gap.plants.simulator_refine import smallest
from whsklearn.gap.tangent import Family, Look, Tangent

Array = NDArray[np.float64]

N_NULL = 15  # own records; they give the moments of a Gumbel law to within a quarter
STANDING_OUT = 2.0  # multiple of the noise's power up to which a line of the error counts as noise
FEW_SHAPES = 8  # of an effect that is also tried by simulation, one run each
BLOCK = 64  # shapes whose columns are held at once
BUMPS = 15  # hills of a nameless function of the position, and of the speed
WAVES = 8  # of the position in its own unit, in addition to them


@dataclass(frozen=True)
class Seen:
    """The error of a model and those of its own records, in the form that looks take."""

    model: SimulatorModel
    error: Array
    null: Array
    motion: Motion

    @classmethod
    def of(cls, plant: Any, model: SimulatorModel, rng: np.random.Generator) -> Seen:
        """The errors of a fitted model."""
        power = smoothed_power(model.error)
        null = [coloured(power, model.error.size, rng) for _ in range(N_NULL)]
        noise = plant.record.by_piece(lambda e: noise_of(e, plant.noise), model.error)
        position = plant.record.position - noise
        followed = motion(dataclasses.replace(plant.record, position=position))
        return cls(model, model.error, np.array(null), followed)


def noise_of(error: Array, noise: float) -> Array:
    """The part of a simulation's error that is noise of this rms: all lines that do not exceed it (Wiener filter).

    Signals of a motion that contain the same noise as the error would explain it, like a sign at every reversal.
    """
    there_and_back = np.concatenate([error, error[::-1]])  # no jump at the junction
    share = STANDING_OUT * noise**2 * there_and_back.size / np.maximum(smoothed_power(there_and_back), 1e-300)
    lines = np.fft.rfft(there_and_back) * np.minimum(share, 1.0)
    return np.asarray(np.fft.irfft(lines, there_and_back.size)[: error.size])


def accelerations(plant: Any, seen: Seen) -> Iterator[Look]:
    """Look at every effect at all shapes, and at nameless functions of the motion, in the error's second derivative."""
    m = seen.motion
    s, at = m.signals, m.usable
    mask = plant.train[:: m.every][at]
    own = m.seen(np.column_stack([s.acceleration, Viscous(1.0).columns(s), Coulomb(1.0).columns(s)]))[at][mask]

    def parts(e: Array) -> tuple[Array, Array]:
        return m.seen(e, 2)[at][mask], np.column_stack([m.seen(e), m.seen(e, 1)])[at][mask]

    left, answers = parts(seen.error)
    # the responses of an own record are its own
    null = [free(target, np.column_stack([own, z])) for target, z in map(parts, seen.null)]
    plane = np.column_stack([own, answers])
    rest = free(left, plane)
    tangent = Tangent(left, np.array(null), plane, n_effective(rest))
    # a signal that repeats in time passes any loop unchanged, and the error that it causes would explain it
    timed = Tangent(left, np.array([parts(e)[0] for e in seen.null]), own, n_effective(free(left, own)))
    share = plant.scale / max(acceleration(m, plant.record), 1e-300)

    def column(effect: Effect) -> Array:
        return m.seen_effect(effect)[at][mask]

    for name, shapes in plant.shapes.items():
        known = [e for e in shapes if columns_of(e, s).size]
        scanned = shapes[0].scanned()
        by_time = bool(scanned) and shapes[0].quantities[scanned].scan == "time"
        look = (timed if by_time else tangent).look(_scanned(name, known, column)) if known else None
        if look is not None:
            yield dataclasses.replace(look, size=look.size * share)
    for f in nameless(s):
        columns = m.seen(f)[at][mask]
        columns = columns / np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
        look = tangent.look(Family("", _one(None, columns), lambda *_: None, columns.shape[1]))
        if look is not None:
            yield dataclasses.replace(look, size=look.size * share)


def slopes(plant: Any, seen: Seen) -> Iterator[Look]:
    """Look at laws with few shapes and effects without a column, by how a little of each changes the simulation."""
    train = plant.train
    plane = plant.fits.tangent(seen.model)[train]
    left = seen.error[train]
    tangent = Tangent(left, seen.null[:, train], plane, n_effective(free(left, plane)))
    for name, shapes in plant.shapes.items():
        if len(shapes) > FEW_SHAPES and columns_of(shapes[0], plant.motion.signals).size:
            continue
        columns = []
        for start in shapes[:FEW_SHAPES]:
            try:
                columns.append(smallest(plant, seen.model, start)[0][train])
            except (ValueError, NotImplementedError, FloatingPointError) as error:
                plant.refused[name] = str(error)
                break
        if name not in plant.refused:
            look = tangent.look(_simulated(name, shapes, columns))
            if look is not None:
                yield look


def _simulated(name: str, shapes: list[Any], columns: list[Array]) -> Family:
    """One effect with its few shapes."""
    numbers = columns[0].shape[1] + (len(columns) > 1)
    block = [(shapes[: len(columns)], np.stack(columns, axis=1), 1.0)]
    return Family(name, lambda _: iter(block), lambda shape, _: (shape,), numbers)


def _one(shape: Any, columns: Array) -> Any:
    """The columns of one shape, in the form that a family returns."""
    return lambda _: iter([([shape], columns[:, None, :], 1.0)])


def _scanned(name: str, shapes: list[Any], column: Any) -> Family:
    """One effect with all its shapes."""

    def blocks(_: Tangent) -> Iterable[tuple[Any, Array, float]]:
        for i in range(0, len(shapes), BLOCK):
            some = shapes[i : i + BLOCK]
            yield some, np.stack([column(e) for e in some], axis=1), 1.0

    e = shapes[0]
    numbers = len(e.coefficients) + len(e.shape_fields()) or 1
    return Family(name, blocks, lambda shape, _: (shape,), numbers)


def nameless(s: Any) -> Iterator[Array]:
    """Nameless functions of position, of speed and direction, and of the drive; shape (n, k) each."""
    q = (s.position - s.position.mean()) / (np.std(s.position) or 1.0)
    v = s.velocity / (2.0 * np.std(s.velocity) or 1.0)
    sign, u = np.tanh(s.kappa * s.velocity), s.drive / (np.std(s.drive) or 1.0)
    bumps = [np.exp(-0.5 * ((q - c) / 0.2) ** 2) for c in np.linspace(-2.0, 2.0, BUMPS)]
    yield np.column_stack([q, q**2, q**3, *bumps])
    yield np.column_stack([f(k * s.position) for k in range(1, WAVES + 1) for f in (np.cos, np.sin)])
    fast = [np.exp(-0.5 * ((v - c) / 0.15) ** 2) for c in np.linspace(-1.0, 1.0, BUMPS)]
    yield np.column_stack([np.abs(v), v * np.abs(v), *fast])
    yield np.column_stack([sign * q, sign * np.abs(u), u])


def free(target: Array, columns: Array) -> Array:
    """Residual of a target after least squares on the columns."""
    scale = np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
    q, _ = np.linalg.qr(columns / scale)
    return np.asarray(target - q @ (q.T @ target))
