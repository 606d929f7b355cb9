"""The start of a servo diagnosis: scales, the base model by inverse dynamics, and the observer view around it."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.optimize import minimize_scalar
from scipy.signal import fftconvolve
from scipy.stats import theilslopes

from whsklearn.effects import EarlyReversal, Scales
from whsklearn.effects.base import rms
from whsklearn.filtering.records import CUTOFF_SIGMA, HIGHEST_CUTOFF, gaussian_derivatives
from whsklearn.gap.diagnosis import ALPHA
from whsklearn.gap.filters import observer_gains, residual_filter
from whsklearn.gap.plant import DEFAULT_TOLERANCE, PAYS
from whsklearn.gap.plants.servo_candidates import candidate
from whsklearn.gap.plants.servo_inverse import NOISY, SLOW, InverseView, lag_of, noise_behind
from whsklearn.gap.plants.servo_model import FASTEST_COUPLING, HOLD, ServoHypothesis, ServoTerm
from whsklearn.gap.plants.servo_own import own
from whsklearn.gap.plants.servo_run import ObserverView
from whsklearn.gap.record import Array, ServoRecord, noise_level, training_samples
from whsklearn.gap.search import HALF
from whsklearn.identification.drive_lead import drive_lead, earlier
from whsklearn.logs.check import runs

LOWEST_CUTOFF = 2.0  # Hz, of the search for the filter
FIRST_CUTOFF = 8.0  # Hz, for the first guess of the inertia: above any reference, below most noise
# Largest noise as a share of the gap: cogging of order 72 needs a filter that passes it (LAAS).
OF_THE_GAP = 0.2
# Largest share of the time in motion during which noise hides the direction: friction is lost at each reversal.
BLIND_SHARE = 0.03
# Multiple of the noise of inertia times acceleration due to the encoder: the residual of surrogates is 0.0037 to 0.0047
# of the drive while this noise alone is 0.0015 to 0.0019, because the controller also puts the noise into the drive.
DRIVE_NOISE = 2.5
# s, leads of dry friction that are tried, at equal ratios, and the relative error of the one found. MuJoCo's default is
# 9.5 ms; its time constants reach from two of its steps, 4 ms, to some tens of ms.
EARLY, FINE = (0.002, 0.005, 0.0125, 0.03), 0.02
REFINED = 5  # trials of a lead in own records, which show it within a factor of 1.33 of the one found first
HELD = 0.8  # share of the dry friction at which an axis is at rest and does not slide slowly
FEWEST_RESTS = 8  # that tell whether an axis creeps at rest: a slope is known from three, and half may be none
DISSIPATED = ("viscous", "coulomb")  # friction that any axis may have


def filtered_motion(position: Array, dt: float, cutoff: float) -> tuple[Array, Array, Array]:
    """Position, velocity and acceleration of a segment behind one Gaussian of the cut-off (Hz), shape (n,) each."""
    g, g1, g2 = gaussian_derivatives(CUTOFF_SIGMA / (2 * np.pi * cutoff), dt)
    half = g.size // 2
    centre = float(np.mean(position))  # the rounding error of the kernels' sums would multiply a large angle
    padded = np.pad(position - centre, half, mode="edge")
    q, v, a = (fftconvolve(padded, k, mode="valid") for k in (g, g1, g2))
    return q + centre, v, a


def base_model(law: tuple[str, ...], scene: Scales) -> ServoHypothesis:
    """The structure of the base model, whose sizes have not been solved for yet."""
    kinds = [candidate(name) for name in law]
    terms = tuple(ServoTerm(c, (*([0.0] * c.linear), *c.starts(scene)[0])) for c in kinds)
    return ServoHypothesis(scene.inertia, 0.0, terms, scene, n_base=len(terms))


def best_view(view: InverseView, model: ServoHypothesis, goal: float, *, sharp: bool = False) -> InverseView:
    """The view with the highest cut-off at which noise is at most ``goal`` of the drive or a fifth of the gap.

    The gap is measured at the same cut-off: cogging of order 72 at one turn per second is at 72 Hz, and a gap seen
    below 10 Hz would not call for a filter that passes it.  If ``sharp``, noise may be so large that a wave of the size
    ``goal`` is only seen in all samples together: n of them see one of s in noise sigma with a gain of n (s / sigma)^2.
    """
    dt, scene = view.record.dt, model.scene
    noise = view.noise
    top = HIGHEST_CUTOFF / dt
    speed = np.abs(view.start[1])
    cutoffs = np.geomspace(top, min(LOWEST_CUTOFF, 0.5 * top), 14)
    for cutoff in cutoffs:
        *_, g2 = gaussian_derivatives(CUTOFF_SIGMA / (2 * np.pi * cutoff), dt)
        _, g1, _ = gaussian_derivatives(CUTOFF_SIGMA / (2 * np.pi * min(2 * cutoff, 0.1 / dt)), dt)
        slowest = NOISY * noise_behind(g1, view.record, noise)
        other = InverseView(view.record, scene, float(cutoff), view.start, noise)
        if np.mean((speed < slowest) & (speed > SLOW * scene.speed)) > BLIND_SHARE:
            continue
        fitted, left = other.fit_with_gap(model)
        before_lag = g2 + lag_of(fitted) * np.gradient(g2, dt)  # models with a lag are compared by the drive before it
        floor = DRIVE_NOISE * fitted.inertia * noise_behind(before_lag, view.record, noise)
        together = max(1.0, float(np.sqrt(other.n_effective / PAYS))) if sharp else 1.0
        if floor <= max(together * goal * scene.torque, OF_THE_GAP * other.rms(left)):
            break
    return other


def start_of(record: ServoRecord, law: tuple[str, ...], goal: float) -> tuple[InverseView, ServoHypothesis]:
    """The inverse view of a record and the base model fitted in it.

    The cut-off is chosen for the gap and the inertia of a first fit at a few hertz.
    """
    dt, y = record.dt, record.position
    first = min(FIRST_CUTOFF, 0.5 * HIGHEST_CUTOFF / dt)
    q, v, a = record.smoothed(lambda x: filtered_motion(x, dt, first), y, round(1.0 / (first * dt)))
    torque = rms(record.drive)
    scene = Scales(
        torque=torque,
        inertia=0.3 * torque / max(rms(a), 1e-12),
        speed=max(rms(v), 1e-12),
        reach=float(np.ptp(y) / 2),
        centre=float((y.max() + y.min()) / 2),
        duration=float(y.size * dt),
        dt=dt,
        peak=float(np.abs(record.drive).max()),
        resonance=min(FASTEST_COUPLING, 0.2 / dt),
    )
    view = InverseView(record, scene, first, (q, v), noise_level(y))
    model = view.fit(base_model(law, scene))
    view.noise = noise_level(unpredicted(record, model, view.start))
    scene = dataclasses.replace(scene, inertia=model.inertia)
    model = dataclasses.replace(model, scene=scene)
    view = best_view(view, model, goal)
    return view, view.fit(model)


def unpredicted(record: ServoRecord, model: ServoHypothesis, start: tuple[Array, Array]) -> Array:
    """What a slow observer does not predict of the position; the position itself if that is the quieter.

    The sixth differences of a path that the drive shakes at the sampling rate are not noise, and a model predicts them.
    """
    ready = dataclasses.replace(model, timing=model.timing - HOLD)
    gains = observer_gains(tracking(record.dt), record.dt)
    y_hat = ready.follow(record.drive, record.position, gains, start=start, pieces=record.pieces)[0]
    left = record.position - y_hat
    return min(record.position, left, key=noise_level) if np.all(np.isfinite(left)) else record.position


def tracking(dt: float) -> float:
    """Bandwidth (Hz) of the observer that holds a model near a record."""
    return float(np.clip(0.02 / dt, 0.2, 2.0))


def logged_late(view: InverseView, model: ServoHypothesis, *, either_way: bool = False) -> int:
    """Samples by which a drive was logged after it had acted, see `whsklearn.identification.drive_lead`.

    A drive that acts later than it was logged is a delay, which the search handles; with ``either_way`` it is told, as
    a negative number.  Friction that the law lacks is
    included, because it lags behind the acceleration, as a drive that is logged late: viscous friction of 16 % of the
    drive had moved it by 4 ms, and a delay was named that moved it back.
    """
    bare = view.bare()
    there = {t.name for t in model.terms}
    for name in (n for n in DISSIPATED if n not in there):  # in this order, so that a log has one result
        model = model.with_term(ServoTerm(candidate(name), (0.0,)))
    columns, target = bare.columns(model, bare.torque(model))[0][bare.at], bare.target(model)[0][bare.at]
    as_logged = bare.rms(target - columns @ np.linalg.lstsq(columns, target, rcond=1e-10)[0])

    def look(lead: int) -> tuple[float, float]:
        seen = bare.beside(with_earlier_drive(view.record, lead)) if lead else bare
        fitted, left = seen.fit_with_gap(model)
        return seen.age(fitted), seen.rms(left)

    return drive_lead(look, as_logged, view.scene.dt, either_way=either_way)


def reversing_early(view: InverseView, model: ServoHypothesis) -> ServoHypothesis:
    """The model whose dry friction reverses ahead of the velocity, if the axis creeps at rest as it would then.

    A log with few rests does not tell.  There it must explain `HALF` of the gap's power.  In the logs of a solver of
    contacts it explains half and more, unless something larger is missing; in those of 44 real axes 8 % at most.  The
    filters smooth a step of friction that comes with the velocity's sign, which looks like an early one, so the two are
    compared with the artefacts of their own records taken off, and the lead is found in the same way: in rows of 10 ms
    the one that leaves least with the artefacts was 2 ms too long.  So compared, 12 logs of MuJoCo were left with 46 %
    at most, and 34 of axes that stick exactly with 64 % at least.
    """

    def led(lead: float) -> ServoHypothesis:
        law = EarlyReversal(lead)  # friction has its full size at the speed ``creep`` if v' = 0
        return dataclasses.replace(model, early=law, creep=max(creep_of(law, model) * dry, 0.5 * view.slowest))

    def power(some: ServoHypothesis) -> float:
        return view.rms(view.gap(some)) ** 2

    def unexplained(some: ServoHypothesis) -> float:
        bare = view.bare()
        fitted, left = bare.fit_with_gap(some)
        return bare.rms(left - own(bare, fitted, np.random.default_rng(0))[0].mean) ** 2

    def nearest(of: Callable[[ServoHypothesis], float], lead: float, wide: float, **options: float) -> Any:
        limits = lead / wide, lead * wide
        return minimize_scalar(lambda x: of(led(x)), bounds=limits, method="bounded", options=options)

    dry = sum(max(0.0, t.q[0]) for t in model.terms if t.name == "coulomb")
    abrupt = dataclasses.replace(model, early=None)
    if dry == 0.0:
        return abrupt
    if model.early:  # once shown, it needs no more records of its own: they cost as much as a round of looks
        return led(model.early.lead)
    apart = EARLY[1] / EARLY[0]
    best, least = min(EARLY, key=lambda lead: power(led(lead))), power(abrupt)
    if power(led(best)) >= least:
        return abrupt
    found = nearest(power, best, apart, xatol=FINE * best)
    seen = creeps(view, model, EarlyReversal(float(found.x)), dry)
    if seen is False or found.fun >= least or not (seen or found.fun <= HALF * least):
        return abrupt
    rest = unexplained(abrupt)
    if not seen and unexplained(led(float(found.x))) > rest / HALF:  # no lead near this one explains half
        return abrupt
    found = nearest(unexplained, float(found.x), apart**0.5, maxiter=REFINED)
    return led(float(found.x)) if seen or found.fun <= HALF * rest else abrupt


def creep_of(law: EarlyReversal, model: ServoHypothesis) -> float:
    """Speed per torque (rad/s per Nm) at which an axis creeps while such friction holds it, T (1 / d - 1) / J."""
    return float(law.lead * (1.0 / law.impedance - 1.0) / model.inertia)


def creeps(view: InverseView, model: ServoHypothesis, law: EarlyReversal, dry: float) -> bool | None:
    """Whether the axis creeps at rest in proportion to the drive, as an early reversal has it.

    None if the log does not tell.  ``dry``: dry friction, Nm.  A rest is a time longer than twice the lead in which the
    axis, slower than twice the fastest creep or than its reading shows, goes no further than one and a half times what
    that would take it, which must be two steps of the grid, and in which the drive stays below `HELD` of the friction,
    at which an axis may slide as slowly.  Of 82 axes that stick exactly none was told to creep and 21 not to, of 28 in
    MuJoCo seven to and none not to.  The slope over the rests is that of Theil and Sen
    (Sen 1968, JASA 63(324), 1379-1389), since a slow passage may pass for a rest; it allows for a steady load.
    """
    s, dt, u = view.motion, view.scene.dt, view.record.drive
    expected = creep_of(law, model)
    fastest, trim = expected * dry, int(np.ceil(2.0 * law.lead / dt)) + 1
    slow = np.abs(s.velocity) < 2.0 * fastest + view.unknown
    first, behind = runs(slow)
    drives, speeds = [], []
    for a, b in zip(first + trim, behind - trim, strict=True):
        time = (b - 1 - a) * dt
        if time < 2.0 * law.lead or fastest * time < 2.0 * view.quantum:
            continue
        if abs(u[a:b].mean()) < HELD * dry and np.ptp(s.position[a:b]) <= 1.5 * fastest * time:
            drives.append(u[a:b].mean())
            speeds.append((s.position[b - 1] - s.position[a]) / time)
    if len(speeds) < FEWEST_RESTS:
        return None
    slope, _, low, high = (x / expected for x in theilslopes(speeds, drives, 1.0 - ALPHA))
    if low > 0.0 and HALF < slope < 1.0 / HALF:
        return True
    return False if high < HALF else None


def with_earlier_drive(record: ServoRecord, samples: int) -> ServoRecord:
    """The record with its drive moved earlier by so many samples; the last value of every segment is held."""
    return dataclasses.replace(record, drive=record.by_piece(lambda u: earlier(u, samples), record.drive))


def observer_view(view: InverseView, scene: Scales, *, tolerance: float = DEFAULT_TOLERANCE) -> ObserverView:
    """The observer view of the record of an inverse view.

    ``scene``: scales with the inertia of the first fit. ``tolerance``: smallest rms torque worth naming, as a share of
    the rms drive.
    """
    record = view.record
    dt, n = record.dt, len(record)
    slow = tracking(dt)
    chosen = residual_filter(dt, scene.inertia, view.noise, scene.torque, tracking=slow, goal=tolerance)
    train = training_samples(record.position)
    guard = chosen.half_width
    edge = np.zeros(n, dtype=bool)
    change = np.flatnonzero(np.diff(train))
    between = min(guard, n // 50)  # a held-out block is 8 % of the record, and half of it must remain for judging
    for c in change:
        edge[max(0, c - between) : c + between] = True
    usable = np.ones(n, dtype=bool)
    settle = int(max(1.0, 3 / (2 * np.pi * slow)) / dt) + guard
    usable[:settle] = False
    usable[n - guard :] = False
    usable &= ~record.near_a_hole(guard, settle)
    return ObserverView(
        record, chosen, scene, view.noise, view.start,
        (train & ~edge)[:: chosen.every], usable[:: chosen.every], tolerance, view.quantum,
    )  # fmt: skip
