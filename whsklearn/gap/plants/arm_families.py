"""Every candidate of an arm as a family of columns on the rows of its joint, and how its shape is polished."""

from __future__ import annotations

import copy
from collections.abc import Iterable, Iterator
from functools import partial
from itertools import product
from typing import Any

import numpy as np
from scipy.optimize import minimize, minimize_scalar

from whsklearn.effects import ContactStop
from whsklearn.gap.nameless import nameless
from whsklearn.gap.plants.arm_terms import AtJoint, JointTerm, Load
from whsklearn.gap.plants.arm_view import LATEST, ArmState, ArmView, fewer
from whsklearn.gap.plants.variant import WAVE_STEP
from whsklearn.gap.record import Array
from whsklearn.gap.tangent import AT_ONCE, Blocks, Family, Look, Tangent, lines
from whsklearn.identification.drive_lead import OLDEST
from whsklearn.identification.payload import place_of, point_load

N_LIMITS, N_AGES = 24, 16
# Plays that are looked at: widths as shares of the reach, shares of the inertia and of the dry friction behind it, and
# the contact (Hz, damping ratio), which the filter hides.
GAPS, SHARES, BEHIND, CONTACT = (0.002, 0.005, 0.012, 0.03), (0.5, 0.75, 0.9), (0.0, 1.0), (30.0, 0.4)
STIFFER = (1.0, 1.0), (1.4, 2.0)  # ratios of width and contact frequency at which a polish starts, too
HIGHEST = 60.0  # order of a wave over a joint's angle
FEWEST = 4  # rows per column of a nameless family
# Of the cost while a shape is polished, for each simplex; a play has five numbers, which trade
EVALUATIONS, OF_A_PLAY = 80, 200
FINE = 0.01  # where it ends: of the first step, and of chi-squared, in which a difference of one is by chance
# Simplices in turn if there are several numbers, each spread where the last one ended (Kelley 1999, SIAM J. Optim.
# 10(1), 43-55): one that begins on a bound may collapse onto it.  The relaxation of a stop so stayed at zero, and the
# damper was named as a delay.
SPREADS = 2
OUTER = np.array([0.7, 0.8, 0.86, 0.9, 0.93, 0.96, 0.98, 0.99])  # quantiles of a joint's path at which a stop may be


def families(view: ArmView, kinds: Iterable[AtJoint]) -> Iterator[Family]:
    """The families of all candidates that the log can show."""
    for kind in kinds:
        yield Family(
            kind.name, partial(_blocks, view, kind), partial(_start, kind), kind.n_numbers,
            (kind.grows or kind.splits) and kind.cls is not Load, kind.transforms, kind.rows, kind.place,
        )  # fmt: skip


def _start(kind: AtJoint, shape: tuple[float, ...], _: Array) -> JointTerm:
    if kind.cls is Load:
        return JointTerm(kind, (1.0, 0.0, 0.0, 0.0))
    return JointTerm(kind, (*((0.0,) * kind.linear), *shape))


def _blocks(view: ArmView, kind: AtJoint, tangent: Tangent) -> Blocks:
    """Shapes and columns of one candidate."""
    c = kind.catalogued
    if kind.cls is Load:
        body = view.body(kind)
        scale = np.linalg.norm(body, axis=0)
        scale = np.where(scale > 1e-9 * scale.max(), scale, np.inf)
        yield [tuple(scale)], (body / scale)[:, None, :], 1.0
    elif c is None:
        yield [()], view.columns(kind, ())[:, None, :], 1.0
    elif kind.delays:
        yield from _delayed(view, kind)
    elif kind.splits:
        dry = float(view._rigid(view.moved)[2][kind.index])
        for gap, share, part in product(GAPS, SHARES, BEHIND):
            wide = (gap * view.scene(kind).reach, share, *CONTACT, part * dry)
            yield [wide], view.columns(kind, wide)[:, None, :], 1.0
    elif c.cls is ContactStop:  # in the outer fifth of the path, on one side
        place = np.quantile(view.position[:, kind.index], (OUTER if c.options["side"] == "upper" else 1.0 - OUTER))
        for angle in place:
            shape: tuple[float, ...] = (float(angle), 0.0, 0.0)
            yield [shape], view.columns(kind, shape)[:, None, :], 1.0
    elif c.scanned == "position" and c.linear == 2:
        yield from _orders(view, kind)
    elif c.scanned == "time":
        yield from _tones(view, kind, tangent)
    else:
        scene = view.scene(kind)
        for shape in c.starts(scene) if c.scanned == "position" else c.grid(scene, np.inf):
            yield [shape], view.columns(kind, shape)[:, None, :], 1.0


def _delayed(view: ArmView, kind: AtJoint) -> Blocks:
    """Ages of a drive beyond those that bookkeeping explains."""
    book = view.columns(kind, (LATEST * view.dt,))
    for value in np.geomspace(LATEST * view.dt, max(OLDEST, 10 * LATEST * view.dt), N_AGES):
        yield [(float(value),)], (view.columns(kind, (float(value),)) - book)[:, None, :], 1.0


def look_at_limit(view: ArmView, kind: AtJoint, tangent: Tangent) -> Look | None:
    """Look at a limit or a dead zone of several widths; each removes part of the drive of every record.

    A drive contains everything that is not explained, so a limit just below its peaks always explains some of it.
    """
    c, j = kind.catalogued, kind.index
    assert j is not None
    weight = view.flat_weight()[kind.rows]
    left = np.where(weight > 0.0, tangent.rows[kind.rows].T / np.where(weight > 0.0, weight, 1.0), 0.0)
    drives = view.target[:, j] - left[0] + left  # (records, m): each record's own drive
    best, shape = np.zeros(len(left)), None
    low, high = c.ranged(view.scene(kind))[0]
    for value in np.geomspace(low, high, N_LIMITS):
        lost = c.effect(np.array([value])).value(drive=drives)
        if not _varies(tangent, drives[0], lost[0], weight):
            continue
        power = _gone(tangent, kind.rows, drives, lost, weight)
        if shape is None or power[0] > best[0]:
            shape = (float(value),)
        best = np.maximum(best, power)
    if shape is None:
        return None
    gains = -tangent.n * np.log1p(-np.clip(best / np.maximum(tangent.power, 1e-300), 0.0, 1.0 - 1e-12))
    size = float(np.sqrt(best[0] / weight.size / view.n_joints))
    return Look(kind.name, float(gains[0]), gains[1:], JointTerm(kind, shape), 1, size, place=kind.place)


def limited(view: ArmView, tangent: Tangent, model: ArmState, term: JointTerm) -> ArmState:
    """The fitted model with a limit or a dead zone of the width that leaves the least share of what reaches its joint.

    Every width is fitted: without the limit the drives have other ages, and beside those the best one was 25 times as
    large as the limit of a controller that winds up.
    """
    kind, at, weight = term.kind, term.kind.rows, view.flat_weight()
    kept, y = view.keep[:, kind.index], view.target[:, kind.index]

    def fitted(x: float) -> ArmState:
        return view.fit(model.with_term(JointTerm(kind, (float(np.exp(x)),))))

    def cost(x: float, *, polish: bool = False) -> float:
        grown = fitted(x)
        lost = view.columns(kind, grown.terms[-1].shape)[:, 0]
        if not _varies(tangent, y, lost, weight[at]):
            return np.inf
        left = view.left(grown).ravel() * weight
        rest = float(left @ left - left[at] @ left[at])
        return rest + float(left[at] @ left[at]) * float(fewer(y[kept], (y - lost)[kept], polish=polish))

    low, high = np.log(kind.catalogued.ranged(view.scene(kind))[0])
    grid = np.linspace(low, high, N_LIMITS)
    best, step, polish = min(grid, key=cost), grid[1] - grid[0], partial(cost, polish=True)
    found = minimize_scalar(polish, bounds=(best - step, best + step), method="bounded", options={"xatol": FINE * step})
    return fitted(found.x if found.fun < polish(best) else best)


def _gone(tangent: Tangent, rows: slice, drives: Array, lost: Array, weight: Array, *, polish: bool = False) -> Array:
    """The power that goes where a joint's drives, shape (records, m), lose a part before they reach it, (records,).

    What is left at the joint counts as a share of the drive that reaches it: a limit removes the peaks of a drive, and
    with them what any model leaves there.
    """
    z, plane, before, kept = (lost * weight).T, tangent.plane[rows], tangent.rows[rows], weight > 0.0
    through = plane.T @ z
    left = before - z + plane @ through
    gone = 2.0 * np.sum(z * before, axis=0) - np.sum(z**2, axis=0) + np.sum(through**2, axis=0)
    more = fewer(drives[:, kept], (drives - lost)[:, kept], polish=polish) - 1.0
    return np.asarray(gone - more * np.sum(left**2, axis=0))


def _varies(tangent: Tangent, drive: Array, lost: Array, weight: Array) -> bool:
    """Whether what reaches a joint changes at more independent samples than there are numbers to fit.

    A controller that winds up may ask for a hundred times what the motor gives.
    """
    flat = np.abs(np.diff(drive - lost)) <= 1e-9 * np.abs(np.diff(drive))
    judged = flat[weight[1:] > 0.0]  # none of a joint that stands still
    return bool(judged.size and tangent.n * (1.0 - np.mean(judged)) > tangent.plane.shape[1])


def _orders(view: ArmView, kind: AtJoint) -> Blocks:
    """Waves over the angle; the filter damps each by its frequency at the speed of the instant."""
    assert kind.index is not None
    c, scene, j = kind.catalogued, view.scene(kind), kind.index
    q, v = (x[view.kept, j] for x in view.moved[:2])
    low = c.ranged(scene)[0][0]
    speed = max(float(np.median(np.abs(v))), 1e-9)
    high = float(np.clip(2 * np.pi * 1.5 * view.lags.cutoff_ / speed, 4.0 * max(low, 1.0), HIGHEST))
    step = max(WAVE_STEP / scene.reach, high / 300)
    values = np.union1d(np.arange(np.ceil(low), high + 1), np.arange(low, max(high, low + step), step))
    values = values[values > 0.0]
    size = view.blur(c.unit_columns((0.0,), view.signals(kind.direction))[:, :1])
    for i in range(0, values.size, AT_ONCE):
        part = values[None, i : i + AT_ONCE]
        damped = size / (1.0 + (np.abs(v)[:, None] * part / (2 * np.pi * view.lags.cutoff_)) ** 8)
        phase = q[:, None] * part
        yield [(float(o),) for o in part[0]], np.stack([damped * np.cos(phase), damped * np.sin(phase)], axis=2), 1.0


def _tones(view: ArmView, kind: AtJoint, tangent: Tangent) -> Blocks:
    """The strongest line of the record at a joint and of every null row, from their spectra (holes are zeros)."""
    low = kind.catalogued.ranged(view.scene(kind))[0][0]
    time = view.time[view.kept]
    # by whole steps from row to row: half steps since the start of the record would be rounded to the same places
    at = np.cumsum(np.maximum(np.rint(np.diff(time, prepend=time[0] - view.step) / view.step), 1.0)).astype(int)
    kept = np.zeros(at[-1] + 1, dtype=bool)
    kept[at] = True
    high = min(1.5 * view.lags.cutoff_, 0.5 / view.step)
    return lines(tangent.rows[kind.rows], kept, view.step, low, high, time)


def nameless_at(view: ArmView) -> Iterator[Family]:
    """Functions of each joint's position, speed, torque and time; each kind is a family without a name."""
    for j, (joint, row) in enumerate(zip(view.arm.joints, np.eye(view.n_joints), strict=True)):
        if not view.keep[:, j].any():
            continue
        kind = AtJoint(object, joint, tuple(row))  # type: ignore[arg-type]
        q, v = (x[view.kept, j] for x in view.moved[:2])
        where: dict[str, Any] = {"rows": slice(j, None, view.n_joints), "place": frozenset([joint])}
        for family in nameless(view.scene(kind), q, v, view.torque[view.kept, j], **where):
            if FEWEST * family.n_numbers < view.keep[:, j].sum():
                yield family


def starts_of(term: JointTerm) -> list[JointTerm]:
    """Starts of a polish: a play has a minimum for each share of the load and contact, which trade with its width."""
    if not term.kind.splits:
        return [term]
    gap, _, hertz, *rest = term.q
    return [JointTerm(term.kind, (m * gap, share, n * hertz, *rest)) for share in SHARES for m, n in STIFFER]


def polished(view: ArmView, tangent: Tangent, term: JointTerm) -> JointTerm:
    """The term at the shape for which its columns explain most of the residual."""
    kind, c = term.kind, term.kind.catalogued
    if kind.cls is Load:
        return _placed(view, tangent, term)
    free = [i for i in range(len(term.shape)) if c is not None and i not in c.held]
    if not free:
        return term
    scene = view.scene(kind)
    ranges = [c.ranged(scene)[i] for i in free]
    logs = [
        c.ratios(c.linear + i) and low > 0.0 and term.shape[i] > 0.0 for i, (low, _) in zip(free, ranges, strict=True)
    ]
    family = Family(kind.name, lambda _: iter(()), lambda *_: None, positive=kind.grows, offset=kind.sizeless,
                    rows=kind.rows)  # fmt: skip
    record = copy.copy(tangent)  # without its null records
    record.rows, record.power = tangent.rows[:, :1], tangent.power[:1]

    def shape_at(x: Array) -> tuple[float, ...]:
        shape = list(term.shape)
        for i, value, logarithm in zip(free, x, logs, strict=True):
            shape[i] = float(np.exp(value) if logarithm else value)
        return tuple(shape)

    book = view.columns(kind, (LATEST * view.dt,)) if kind.delays else 0.0
    weight = view.flat_weight()[kind.rows]

    def cost(x: Array) -> float:
        columns = view.columns_at(kind, shape_at(x)) - book
        if kind.transforms and kind.index is not None and not kind.delays:
            drive, lost = view.target[:, kind.index], columns[:, 0]
            if not _varies(record, drive, lost, weight):
                return 0.0
            return -float(_gone(record, kind.rows, drive[None], lost[None], weight, polish=True)[0])
        if kind.splits:  # as it is, be it worse than nothing: on the way to a play lie many that are
            z = record._weighted(columns)[:, 0]
            rest = z - record.plane @ (record.plane.T @ z)
            return float(rest @ rest - 2.0 * rest @ record.rows[:, 0])
        return -float(record.taken(family, columns[:, None, :])[0][0, 0])

    x = np.array([np.log(term.shape[i]) if g else term.shape[i] for i, g in zip(free, logs, strict=True)])
    bounds = [(np.log(a), np.log(b)) if g else (a, b) for (a, b), g in zip(ranges, logs, strict=True)]
    widths = np.array([_width(view, kind, g, b) for g, b in zip(logs, bounds, strict=True)])
    low, high = np.transpose(bounds) / widths
    x = start = x / widths
    for _ in range(SPREADS if len(free) > 1 else 1):
        inwards = np.where(x + 1.0 > high, -1.0, 1.0)
        simplex = np.clip(np.vstack([x, x + np.diag(inwards)]), low, high)
        found = minimize(
            lambda z: cost(z * widths), x, method="Nelder-Mead", bounds=list(zip(low, high, strict=True)),
            options={"maxfev": OF_A_PLAY if kind.splits else EVALUATIONS, "initial_simplex": simplex, "xatol": FINE,
                     "fatol": FINE},
        )  # fmt: skip
        x = found.x
    if cost(start * widths) - found.fun < FINE:  # such as a spring's centre beside the offset of its joint
        x = start
    return JointTerm(kind, (*term.q[: kind.linear], *shape_at(x * widths)))


def _placed(view: ArmView, tangent: Tangent, term: JointTerm) -> JointTerm:
    """A mass at the place where it explains most of the residual."""
    body = tangent._weighted(view.body(term.kind))
    inside = tangent.plane.T @ body
    numbers = point_load(body.T @ body - inside.T @ inside, body.T @ tangent.rows[:, 0])
    return JointTerm(term.kind, (term.q[0], *map(float, place_of(numbers))))


def _width(view: ArmView, kind: AtJoint, logarithm: bool, bounds: tuple[float, float]) -> float:
    """First step of a polish: a fifth in ratios, a fiftieth of the range, a part of a wave's period."""
    c, scene = kind.catalogued, view.scene(kind)
    if c.scanned == "position":
        return float(0.1 / scene.reach)
    if c.scanned == "time":
        return 0.1 / scene.duration
    return 0.2 if logarithm else 0.02 * (bounds[1] - bounds[0])
