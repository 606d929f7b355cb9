"""Every candidate of an axis as a family of torque columns behind the view's filters, for the look to scan."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from whsklearn.effects import codes as k
from whsklearn.filtering.gaussian import CUTOFF_SIGMA
from whsklearn.gap.plants import inverse_dynamics as ols
from whsklearn.gap.plants import servo_evidence as rules
from whsklearn.gap.plants import servo_stop as stop
from whsklearn.gap.plants import servo_swapped as swapped
from whsklearn.gap.plants import servo_two_mass as two_mass
from whsklearn.gap.plants.servo_candidates import TWO_MASS, Candidate
from whsklearn.gap.plants.servo_inverse import later, reaching
from whsklearn.gap.plants.servo_inverse_look import ANTIRESONANCES, CONTACTS, GAPS, HIGHEST, N_LIMITS, inverse_kinds
from whsklearn.gap.plants.servo_model import AxisModel, Term
from whsklearn.gap.plants.servo_nameless import generic_basis
from whsklearn.gap.plants.servo_own import Own
from whsklearn.gap.search import HALF
from whsklearn.gap.tangent import Family, Look, Tangent

Array = NDArray[Any]
AT_ONCE = 64  # shapes in one matrix product
N_AGES = 24
Blocks = Iterator[tuple[Any, Array, Array | float]]


class Scene:
    """One view under one model, with everything that all families share.

    The torque is the model's; if that is not good enough, it is the torque of ``beside``.
    """

    def __init__(self, view: Any, model: AxisModel, beside: AxisModel | None = None):
        self.view, self.model = view, model
        self.torque = view.torque(model)
        if self.torque is None and beside is not None:
            self.torque = view.torque(beside)
        s = view.motion if self.torque is None else view.motion._replace(drive=self.torque)
        self.signals, self.at = s, view.at
        self.angle, self.speed = (x[:: view.every][view.at] for x in (s.position, s.velocity))
        self.time = view.time[:: view.every][view.at]
        self.sigma = CUTOFF_SIGMA / (2 * np.pi * view.cutoff)

    def columns(self, term: Term) -> Array:
        """Columns of one term at its shape, shape (n, 1, k)."""
        return self.view.term_columns(self.model, term, self.torque)[self.at][:, None, :]

    def transformed(self, changed: Array) -> tuple[Array, float]:
        """The residual if ``changed`` reaches the axis, shape (n, 1, 1), and its share of the rms drive."""
        lost = self.view.blur(self.view.record.drive - changed)[self.at]
        before = self.view.drive[self.at]
        return lost[:, None, None], self.view.rms(before - lost) / max(self.view.rms(before), 1e-300)


def looks(view: Any, model: AxisModel, own: Own, beside: AxisModel | None = None) -> list[Look]:
    """Look at every candidate, and at nameless functions of the motion, beside the model's own columns.

    Effects that multiply the torque are tried too if only ``beside``, which has one more effect, predicts it well
    enough.
    """
    scene = Scene(view, model, beside)
    _, x, target, sizes, free = view.solved(model)
    x = stop.without_pushes(model, x)
    left = (target - x @ sizes)[view.at]
    away = stop.away(view, model)
    rate = ols.slope(x @ sizes, view.step)[view.at]
    numbers = x[view.at][:, free[: x.shape[1]]]
    timed = Tangent(left, own.null, np.column_stack([numbers, rate]), own.n_effective, away)
    other_way = swapped.tangent(view, model, np.random.default_rng(0))
    out = [
        better(timed.look(f), other_way.look(f) if of_place else None, other_way.n, view.rms(left))
        for f, of_place in families(scene)
    ]
    out += [timed.look(f) for f in nameless(scene, (x @ sizes)[view.at])]
    if view.age(model) > rules.LATEST * view.scene.dt:  # then the age is not a nuisance but a candidate
        plain = Tangent(left, own.null, numbers, own.n_effective, away)
        late = (kind for kind in inverse_kinds(model) if kind.delays)
        out += [plain.look(family(scene, kind)) for kind in late]
    struck = stop.regions(view, model)
    for kind in stop.usable(model):
        term = stop.start(kind, struck)
        if term is not None:
            g = min(stop.share_of(view, model, term), 1.0 - 1e-12)
            size = np.sqrt(g) * view.rms(left)
            gain = float(-own.n_effective * np.log1p(-g))
            out.append(Look(kind.name, gain, np.zeros(own.null.shape[0]), term, 4, size))
    return [look for look in out if look is not None]


def better(look: Look | None, other: Look | None, n: float, left: float) -> Look | None:
    """Of two looks at one family, by both regressions, the first, unless it misses more than half of the other's.

    Families are compared by what they explain of the drive's residual, of rms ``left``.  The size of a family found by
    the other regression is the same share of it as of the acceleration, with ``n`` independent samples.
    """
    if look is None or other is None:
        return look
    size = left * float(np.sqrt(-np.expm1(-other.gain / n)))
    return dataclasses.replace(other, size=size, swapped=True) if look.size**2 < HALF * size**2 else look


def families(scene: Scene) -> Iterator[tuple[Family, bool]]:
    """Families that have columns or limit the drive, each with whether it is a force of the position alone."""
    for kind in inverse_kinds(scene.model):
        if kind in stop.KINDS or kind.delays:
            continue
        if scene.torque is None and kind.driven and not kind.transforms:
            continue
        yield family(scene, kind), kind.of_place


def family(scene: Scene, kind: Candidate) -> Family:
    """One candidate."""
    n_numbers = kind.n_slots - len(kind.held)
    zeros = (0.0,) * kind.linear

    def term(shape: tuple[float, ...], _sizes: Array) -> Term:
        return Term(kind, (*zeros, *shape))

    def given(shape: Term, _sizes: Array) -> Term:
        return shape

    if kind.code in TWO_MASS:
        return Family(kind.name, lambda _: couplings(scene, kind), given, n_numbers + 1, positive=True)
    if kind.transforms:
        shown = ages if kind.delays else limits
        return Family(kind.name, lambda _: shown(scene, kind), term, n_numbers, offset=True)
    if kind.scanned == "position":
        return Family(kind.name, lambda _: orders(scene, kind), term, n_numbers)
    if kind.scanned == "time":
        return Family(kind.name, lambda t: tones(scene, kind, t), term, n_numbers)
    shapes: list[tuple[float, ...]]
    if kind.scanned == "step":
        low, high = kind.ranged(scene.view.scene)[0]
        shapes = [(float(t),) for t in np.linspace(low, high, 25)]
    else:
        shapes = kind.starts(scene.view.scene)
    return Family(
        kind.name, lambda _: (([s], scene.columns(Term(kind, (*zeros, *s))), 1.0) for s in shapes), term, n_numbers,
        positive=kind.positive,
    )  # fmt: skip


def couplings(scene: Scene, kind: Candidate) -> Blocks:
    """A load driven by the motor's motion, over antiresonances and widths of play."""
    play = kind.code == k.BACKLASH
    if kind.on_load:  # one column, because neither a frequency nor a width changes its shape
        hz = scene.view.scene.resonance
        term = two_mass.start(scene.model, kind, scene.view.scene.reach / 50.0, hz, 0.15 if play else 0.05)
        yield [term], scene.columns(term), 1.0
        return
    grid = [(g, f) for g in GAPS for f in CONTACTS] if play else [(0.0, f) for f in ANTIRESONANCES]
    for g, f in grid:
        if f < 0.2 / scene.view.scene.dt and g < scene.view.scene.reach:
            term = two_mass.start(scene.model, kind, g, f, 0.15 if play else 0.05)
            yield [term], scene.columns(term), 1.0


def limits(scene: Scene, kind: Candidate) -> Blocks:
    """What a limit or a dead zone removes from the drive; enough must remain to fit the axis."""
    u, signals = scene.view.record.drive, scene.view.motion
    for width in np.geomspace(*kind.ranged(scene.view.scene)[0], N_LIMITS):
        changed = reaching(Term(kind, (float(width),)), u, signals, scene.view.scene.dt)
        flat = np.abs(np.diff(changed)) <= 1e-9 * np.abs(np.diff(u))
        if scene.view.n_effective * (1.0 - np.mean(flat)) < scene.model.vector().size + 1:
            continue
        columns, share = scene.transformed(changed)
        yield [(float(width),)], columns, share


def ages(scene: Scene, kind: Candidate) -> Blocks:
    """The drive delayed by every age beyond bookkeeping."""
    dt, u = scene.view.scene.dt, scene.view.record.drive
    book, _ = scene.transformed(later(k.INPUT_DELAY, u, rules.LATEST * dt, dt))
    for age in np.geomspace(rules.LATEST * dt, max(rules.OLDEST, 10 * rules.LATEST * dt), N_AGES):
        columns, share = scene.transformed(later(kind.code, u, age, dt))
        yield [(float(age),)], columns - book, share


def orders(scene: Scene, kind: Candidate) -> Blocks:
    """Whole orders, then all orders; the Gaussian damps a wave by exp(-(k v s)^2 / 2)."""
    view = scene.view
    low = kind.ranged(view.scene)[0][0]
    speed = max(float(np.median(np.abs(view.motion.velocity))), 1e-9)
    high = float(np.clip(2 * np.pi * 1.5 * view.cutoff / speed, 4.0 * max(low, 1.0), HIGHEST))
    step = max(0.2 * np.pi / view.scene.reach, high / 300)
    values = np.union1d(np.arange(np.ceil(low), high + 1), np.arange(low, max(high, low + step), step))
    values = values[values > 0.0]
    if not kind.paired:
        for order in values:
            yield [(float(order),)], scene.columns(Term(kind, (0.0, float(order)))), 1.0
        return
    size = view.blur(kind.unit_columns((0.0,), scene.signals)[:, 0])[view.at]
    for i in range(0, values.size, AT_ONCE):
        part = values[None, i : i + AT_ONCE]
        damped = size[:, None] * np.exp(-0.5 * (scene.speed[:, None] * part * scene.sigma) ** 2)
        phase = scene.angle[:, None] * part
        if kind.cls.port == "output":
            term = [scene.columns(Term(kind, (0.0, 0.0, float(o))))[:, 0, :] for o in part[0]]
            yield [(float(o),) for o in part[0]], np.stack(term, axis=1), 1.0
        else:
            columns = np.stack([damped * np.cos(phase), damped * np.sin(phase)], axis=2)
            yield [(float(o),) for o in part[0]], columns, 1.0


def tones(scene: Scene, kind: Candidate, tangent: Tangent) -> Blocks:
    """The strongest line of the record and of every null row, from their spectra (rests are filled with zeros)."""
    view = scene.view
    low = kind.ranged(view.scene)[0][0]
    rows = np.zeros((tangent.rows.shape[1], view.drive.size))
    rows[:, view.at] = tangent.rows.T
    n = 4 * view.drive.size
    frequency = np.fft.rfftfreq(n, view.step)
    inside = np.flatnonzero((frequency >= low) & (frequency <= 1.5 * view.cutoff))
    if inside.size == 0:
        return
    power = np.abs(np.fft.rfft(rows, n)[:, inside]) ** 2
    best = np.unique(frequency[inside[np.argmax(power, axis=1)]])
    phase = 2 * np.pi * scene.time[:, None] * best
    yield [(float(f),) for f in best], np.stack([np.cos(phase), np.sin(phase)], axis=2), 1.0


def nameless(scene: Scene, torque: Array) -> Iterator[Family]:
    """Functions of position, speed, time and the model's torque; each kind is a family without a name."""

    def all_at_once(columns: Array) -> Family:
        return Family("", lambda _: iter([([()], columns, 1.0)]), lambda *_: None, columns.shape[2])

    for block in generic_basis(scene.view.scene, scene.angle, scene.speed, torque):
        yield all_at_once((block / (block.std(axis=0) + 1e-12))[:, None, :])
