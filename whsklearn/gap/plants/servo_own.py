"""An axis's own records: what the fitted model would have logged in the same experiment, and their residuals.

The model runs in the experiment again, with the logged drive minus its unexplained part and a soft loop around the
measured path, so that it passes the same positions at the same speeds and turns where the axis turned.  Filters,
quantization and timing leave the same traces in both records (two records of one model have a correlation of 0.99
behind the filters).  Their mean is therefore subtracted, and the residual of the real record is what the model lacks:
in a log of 30 s with nothing missing, 2.2 % of the drive before and 0.2 % after, of which 0.19 % is encoder noise.
"""

from __future__ import annotations

import dataclasses
from typing import Any, NamedTuple

import numpy as np
from scipy.stats import norm

from whsklearn.effects.base import rms
from whsklearn.gap.calibration import N_DRAWS, N_OWN, independent, null_rows
from whsklearn.gap.diagnosis import ALPHA
from whsklearn.gap.plants.servo_candidates import ColumnSignals as Motion
from whsklearn.gap.plants.servo_model import HOLD, ServoHypothesis
from whsklearn.gap.record import Array, white_noise
from whsklearn.gap.search import HALF
from whsklearn.identification.drive_lead import LATEST, OLDEST, earlier
from whsklearn.systems._servo_kernel import DELAY, DRIVE, MEASURED, N_SIGNALS, RESOLUTION, How, PassInputs, run
from whsklearn.systems.servo import FEWEST_STEPS

# Hz, of the soft loop: with a Stribeck curve in the model, 5 Hz leaves half as much as 2 and 15 Hz (a slower loop lets
# the axis stick longer than it did, a stiffer one replaces the model's drive)
LOOP = 5.0
# Largest lag, in rad, of an old drive at the loop's natural frequency: the loop crosses over at 1.5 times that
# frequency with a phase margin of 65 degrees.
STEADY = 0.4


class Own(NamedTuple):
    """Residuals of a model on its own records, behind the filters of a view."""

    mean: Array  # (n,): the artefacts
    # (m, n): residuals by chance of records in which nothing is missing; weighted, they have the colour of the rest
    null: Array
    floor: float  # rms of the weighted residual due to encoder noise
    n_effective: float
    apart: Array  # (k, n): how the own records differ: the part of the weighted residual that is encoder noise
    weight: Array  # (n,): of the samples, see `weights`
    late: float  # s: what the same fit adds to the age of the drive: the hold over a sample, and what filters blur


def needed(view: Any, model: ServoHypothesis) -> Array:
    """Drive that the model takes along the measured path, shape (n,)."""
    record, path, speed = view.record, view.motion.position, view.motion.velocity
    motion = Motion(record.clock, path, speed, np.gradient(speed, record.dt), record.drive)
    torques = (t for t in model.terms if t.effect.port in ("torque", "input"))
    asked = (t.effect.contribution(model.reversing(t, motion)) for t in torques)
    return np.asarray(model.inertia * motion.acceleration + sum(asked))


def own_record(
    view: Any, model: ServoHypothesis, rng: np.random.Generator, feed: Array, delay: float, ideal: Array, *,
    held: bool = False
) -> Any:  # fmt: skip
    """The record that the model makes in the experiment of ``view``.

    ``feed`` (n,): drive to which the loop adds. ``delay``: age in s at which the drive begins to act; it is negative if
    the drive was logged late. ``ideal`` (n,): `needed`. ``held``: whether the axis is held on the measured path by it.
    """
    record, dt = view.record, view.scene.dt
    of_model = sum(float(t.q[0]) for t in model.terms if t.kind.delays)
    old, early = abs(delay) + of_model, HOLD + (delay + of_model) / dt
    # what the path asks for is logged before it acts: a drive is held over the sample, which is on average half of one
    ideal = record.by_piece(lambda u: np.interp(np.arange(u.size) + early, np.arange(u.size), u), ideal)
    w = min(2 * np.pi * min(LOOP, 0.03 / dt), STEADY / max(old, dt))
    sigma = float(white_noise(view.noise, view.quantum))
    plant = model.plant()
    # a drive that was logged late acts before it is written: the loop runs ahead of the log
    late = int(np.ceil(max(-delay, 0.0) / dt))
    plant.parts[DELAY] = delay + late * dt
    feed = record.by_piece(lambda u: earlier(u, late), feed)
    plant.parts[RESOLUTION] = view.quantum
    path, speed = view.motion.position, view.motion.velocity
    white = rng.standard_normal(len(record))
    noise = record.by_piece(np.cumsum, record.speed_noise * dt * white) if record.speed_noise else sigma * white
    if held:
        return dataclasses.replace(record, drive=ideal, position=path + noise)
    soft = (model.inertia * w * w, 0.0, 1.4 * model.inertia * w, 0.0, 1.0, np.inf, 0.0, 0.1 / w)
    how = How(dt, max(FEWEST_STEPS, int(np.ceil(dt / model.longest_step))), closed=True)
    out = run_by_piece(record, plant, soft, how, (path, speed, feed), noise)
    drive, position = np.roll(out[DRIVE], late), out[MEASURED]
    same = np.all(np.isfinite(position)) and np.abs(position - path).max() <= view.scene.reach
    # half the travel away it is a different experiment, and so it is with a drive that neither the log nor the path has
    if not (same and rms(drive) <= rms(record.drive) + rms(ideal)):
        drive, position = ideal, path + noise
    return dataclasses.replace(record, drive=drive, position=position)


def run_by_piece(
    record: Any, plant: Any, controller: tuple[float, ...], how: How, reference: tuple[Array, ...], noise: Array
) -> Array:
    """Results of the kernel for every segment of a record, each started on the reference's path; shape (7, n)."""
    out = np.zeros((N_SIGNALS, len(record)))
    for s, t in record.pieces:
        part, path = np.zeros((N_SIGNALS, s.stop - s.start)), np.array([x[s] for x in reference])
        q, v = path[:2, 0]
        signals = PassInputs(path, noise[s], np.zeros(0), np.zeros((2, 1)))
        run(part, plant, controller, signals, how._replace(start=t), np.array([q, v, q, v]))
        out[:, s] = part
    return out


def own(view: Any, model: ServoHypothesis, rng: np.random.Generator) -> tuple[Own, ServoHypothesis]:
    """The residuals on the model's own records, and the model corrected by the bias of the same fit on them.

    The correction is that of indirect inference (Gourieroux, Monfort and Renault 1993, J. Applied Econometrics 8,
    S85-S118): if a fit behind filters finds an inertia that is 1 % too large in the model's own record, it does so in
    the log too.

    Subtracting the mean of the records helps if more than half of it is in the log's residual.  If the log tells that
    less is, the records are of another experiment, and the axis is held on the measured path instead: where friction
    falls with the speed, a loop that is softer than the real one lets the axis stick and slip.
    """
    return _own(view, model, rng, held=False) or _own(view, model, rng, held=True)  # type: ignore[return-value]


def weights(view: Any, model: ServoHypothesis, rest: Array) -> Array:
    """Weights of the judged samples, shape (n,): what each is worth where the sign of the velocity is not known.

    ``rest``: residual without artefacts, shape (n,).

    There dry friction F may be anything between -F and F, as far as anybody knows uniformly, with a variance of
    F^2 / 3.  Behind the filter, which sees that for a share r of its window, it is (r F)^2 / 3 on top of the variance
    of the residual elsewhere.  How long an axis rests, and how slowly it creeps to a stop, depends on its controller,
    which own records only resemble: of 23 axes in which nothing was missing seven were said to lack something, and one
    to lack presliding friction.  Beside the noise of the encoder alone, slow samples would be worth next to nothing
    while something larger is missing: half of a pendulum's swings had been left out, and with them its gravity.
    """
    dry = sum(max(0.0, t.q[0]) for t in model.terms if t.name == "coulomb")
    unknown, noise = (view.undirected(model) * dry) ** 2 / 3.0, (model.inertia * view.acceleration_noise + 1e-300) ** 2
    told = np.sqrt(noise / (noise + unknown))
    columns, _ = np.linalg.qr(told[:, None] * view.linearised(model).jacobian)
    left = told * rest
    left -= columns @ (columns.T @ left)
    elsewhere = float(left @ left / (told @ told - np.sum((columns * told[:, None]) ** 2)))
    elsewhere = max(noise, elsewhere)
    return np.asarray(np.sqrt(elsewhere / (elsewhere + unknown)))


def contradicted(mean: Array, left: Array, most: float) -> bool:
    """Whether artefacts, shape (n,), are not in a residual of at most ``most`` independent samples: see `own`.

    >>> mean, noise = np.random.default_rng(0).standard_normal((2, 1000))
    >>> [contradicted(mean, size * mean + 0.3 * noise, 1000.0) for size in (0.0, 1.0)]
    [True, False]
    >>> contradicted(0.01 * mean, noise, 1000.0)  # too small to tell
    False
    """
    power = float(mean @ mean) + 1e-300
    share, n = float(left @ mean) / power, independent(left, most)
    error = np.sqrt(np.mean((left - share * mean) ** 2) * mean.size / (n * power))
    return bool(share + norm.isf(ALPHA) * error < HALF)


def _own(
    view: Any, model: ServoHypothesis, rng: np.random.Generator, *, held: bool
) -> tuple[Own, ServoHypothesis] | None:
    """`own` by simulation, None if the log contradicts it, or with the axis held on the path."""
    bare = view.bare()
    here, left = bare.fit_with_gap(model)
    asked = here.vector()
    age, dt = bare.age(here), view.scene.dt
    latest = (LATEST - HOLD) * dt  # beyond that it is a delay, which this model lacks
    # from the logged drive: the first residual contains the artefacts of the filters, which the first own record shows
    corrected, delay, feed = model, min(age - HOLD * dt, latest), view.record.drive
    for _ in range(2):  # with more passes they diverge if the drive has a limit, above which more drive changes nothing
        made = bare.beside(own_record(view, corrected, rng, feed, delay, needed(view, corrected), held=held))
        fitted, seen = made.fit_with_gap(model)
        corrected = model.with_vector(np.clip(corrected.vector() + asked - fitted.vector(), *model.bounds()))
        late = made.age(fitted) - delay
        delay = float(np.clip(age - late, -OLDEST, latest))
        feed = view.record.drive - bare.spread(left - seen)
    gaps, ideal = [], needed(view, corrected)
    for _ in range(N_OWN):
        made = bare.beside(own_record(view, corrected, rng, feed, delay, ideal, held=held))
        gaps.append(made.fit_with_gap(model)[1])
    rows = np.array(gaps)
    mean = rows.mean(axis=0)
    apart = (rows - mean) * np.sqrt(N_OWN / (N_OWN - 1.0))
    if contradicted(mean, left, view.n_effective):
        if not held:
            return None
        mean = np.zeros_like(mean)
    weight = weights(view, here, left - mean)
    rest, apart = weight * (left - mean), weight * apart
    n, null = independent(rest, view.n_effective), null_rows(rest, apart, N_DRAWS, rng) / weight
    return Own(mean, null, float(np.sqrt(np.mean(apart**2))), n, apart, weight, late), corrected
