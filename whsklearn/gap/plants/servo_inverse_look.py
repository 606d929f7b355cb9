"""Candidates in the inverse view: the best start of each, the polish of its shape, further orders of a family."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any

import numpy as np
from numpy.typing import NDArray

from whsklearn.effects import codes as k
from whsklearn.effects.quantity import ONE_PERIOD
from whsklearn.filtering.gaussian import CUTOFF_SIGMA
from whsklearn.gap.least_squares import least_squares
from whsklearn.gap.plants import servo_evidence as rules
from whsklearn.gap.plants import servo_stop as stop
from whsklearn.gap.plants.servo_candidates import TWO_MASS, Candidate, usable
from whsklearn.gap.plants.servo_model import AxisModel, Term

Array = NDArray[Any]
GAPS = (0.002, 0.004, 0.009, 0.018, 0.037, 0.075, 0.15)  # rad
CONTACTS = (6.0, 12.0, 25.0, 60.0)  # Hz, of the antiresonance in contact
ANTIRESONANCES = np.geomspace(0.8, 65.0, 20)  # Hz
N_LIMITS = 40  # of the drive over the plausible range, an eighth apart
# Rounds over the shape numbers.  The step shrinks by 0.55 in each, to a tenth of the spacing of the starts, and a
# parabola goes through the last three: a spring of twice the drive, off by a tenth, leaves more than its neighbours
# explain.
POLISH = 4
HIGHEST = 160.0  # periods per turn


class ProjectedBase:
    """The residual with the model's own columns projected out."""

    def __init__(self, view: Any, model: AxisModel, beside: AxisModel | None = None):
        self.model = model
        self.torque = view.torque(model)
        if self.torque is None and beside is not None:
            self.torque = view.torque(beside)
        _, x, target, sizes, free = view.solved(model)
        self.away = stop.away(view, model)
        used = self.open(x[view.at][:, free])
        self.q, _ = np.linalg.qr(used / (np.linalg.norm(used, axis=0) + 1e-300))
        left = self.open((target - x @ sizes)[view.at])
        self.left = left - self.q @ (self.q.T @ left)
        self.power = float(self.left @ self.left)

    def open(self, x: Array) -> Array:
        """Set samples to zero at which a stop of the model is in contact."""
        if self.away is None:
            return x
        return x * (self.away if x.ndim == 1 else self.away[:, None])

    def gain(self, columns: Array) -> float:
        """Share of the residual that the columns explain in addition to the model's own."""
        columns = self.open(columns)
        z = columns - self.q @ (self.q.T @ columns)
        norm = np.linalg.norm(z, axis=0)
        seen = norm > 1e-4 * (np.linalg.norm(columns, axis=0) + 1e-300)
        if not seen.any() or not np.all(np.isfinite(z)):
            return 0.0
        c, *_ = np.linalg.lstsq(z[:, seen] / norm[seen], self.left, rcond=1e-6)
        explained = z[:, seen] / norm[seen] @ c
        return float(1.0 - np.sum((self.left - explained) ** 2) / max(self.power, 1e-300))


def inverse_kinds(model: AxisModel) -> tuple[Candidate, ...]:
    """Candidates with a form in this view."""
    return tuple(c for c in (*usable([t.kind for t in model.terms]), *stop.usable(model)) if has_form(c))


def has_form(c: Candidate) -> bool:
    """Whether inverse dynamics of the motor side shows a candidate."""
    return c.linear > 0 or c.transforms or c.code in TWO_MASS


def term_gain(view: Any, base: ProjectedBase, term: Term) -> float:
    """Gain of one term at its shape."""
    return base.gain(view.term_columns(base.model, term, base.torque)[view.at])


def scan_orders(view: Any, base: ProjectedBase, kind: Candidate, without: Collection[float] = ()) -> list[float]:
    """The best whole order except those ``without``, and the best of all orders, on the decimated motion.

    A wave is damped by exp(-(k v s)^2 / 2).
    """
    low = kind.ranged(view.scene)[0][0]
    speed = max(float(np.median(np.abs(view.motion.velocity))), 1e-9)
    high = float(np.clip(2 * np.pi * 1.5 * view.cutoff / speed, 4.0 * max(low, 1.0), HIGHEST))
    whole = np.array([o for o in np.arange(np.ceil(low), high + 1) if o not in without])
    step = max(0.2 * np.pi / view.scene.reach, high / 300)
    grid = np.arange(low, high, step)
    gains = {}
    for values in (whole, grid):
        if values.size:
            g = wave_gains(view, base, kind, values)
            i = int(np.argmax(g))
            gains[float(values[i])] = float(g[i])
    best = max(gains, key=gains.__getitem__)
    first = float(next(iter(gains)))
    return [first] if gains[best] < rules.WHOLE_ORDER * gains[first] else [best, first]


def wave_gains(view: Any, base: ProjectedBase, kind: Candidate, values: Array) -> Array:
    """Share of the residual that a wave of each order explains in addition to the model.

    The factor of the wave (the sign of the velocity, the torque) is the effect's own column at order zero.
    """
    if not kind.paired:
        return np.array([term_gain(view, base, Term(kind, (0.0, order))) for order in values])
    s = view.motion if base.torque is None else view.motion._replace(drive=base.torque)
    angle, speed = s.position[:: view.every][view.at], s.velocity[:: view.every][view.at]
    size = view.blur(kind.unit_columns((0.0,), s)[:, 0])[view.at]
    sigma = CUTOFF_SIGMA / (2 * np.pi * view.cutoff)
    out = np.zeros(values.size)
    for i in range(0, values.size, 64):
        part = values[None, i : i + 64]
        damped = size[:, None] * np.exp(-0.5 * (speed[:, None] * part * sigma) ** 2)
        phase = angle[:, None] * part
        out[i : i + 64] = pair_gains(base, damped * np.cos(phase), damped * np.sin(phase))
    return out


def pair_gains(base: ProjectedBase, c: Array, s: Array) -> Array:
    """Gain of every pair of columns (c_i, s_i) over the base."""
    c, s = base.open(c), base.open(s)
    c = c - base.q @ (base.q.T @ c)
    s = s - base.q @ (base.q.T @ s)
    cc, ss, cs = np.sum(c * c, 0), np.sum(s * s, 0), np.sum(c * s, 0)
    rc, rs = c.T @ base.left, s.T @ base.left
    ridge = 1e-5 * (cc + ss) + 1e-300
    cc, ss = cc + ridge, ss + ridge
    return (ss * rc**2 - 2 * cs * rc * rs + cc * rs**2) / np.maximum(cc * ss - cs**2, 1e-300) / max(base.power, 1e-300)


def polished(view: Any, model: AxisModel, term: Term) -> AxisModel:
    """The model with the term; its free shape numbers are moved downhill one at a time and the sizes solved for."""
    if term.kind in stop.KINDS:
        return stop.settled(view, model, term)
    grown = downhill(view, view.fit(model.with_term(term)), len(model.terms))
    return jointly(view, grown, len(model.terms)) if term.kind.later else grown


def settled(view: Any, model: AxisModel) -> AxisModel:
    """The model with the shapes of its effects polished again beside the last one.

    Without that one, the rest position of a spring compensates for whatever was missing.
    """
    for i in range(model.n_base, len(model.terms)):
        kind = model.terms[i].kind
        if kind.scanned != "step" and kind.code not in TWO_MASS and kind not in stop.KINDS:
            model = downhill(view, model, i)
    return model


def downhill(view: Any, grown: AxisModel, i: int) -> AxisModel:
    """The model with the free shape numbers of term ``i`` moved downhill one at a time and the sizes solved for."""
    term = grown.terms[i]
    free = [(j, log) for of, j, log in grown.free() if of == i and j >= term.kind.linear]
    if term.kind.scanned == "position" and float(term.q[2]).is_integer():
        free = []
    if not free:
        return grown
    cost = view.rms(view.gap(grown))
    widths = dict.fromkeys((j for j, _ in free), 0.0)
    for j, log in free:
        widths[j] = 0.35 if log else 0.3 * view.scene.reach
        if term.kind.code == k.SATURATION:
            widths[j] = 0.12  # the spacing of limits; one that is 0.1 % too low leaves a trace of its own
        elif term.kind.scanned == "position":
            widths[j] = np.log1p(0.2 / (view.scene.reach * term.q[j]))
        elif term.kind.scanned == "time":
            widths[j] = np.log1p(0.2 / (view.scene.duration * term.q[j]))
        elif term.kind.scanned == "step":
            widths[j] = 0.02 * view.scene.duration
    low, high = grown.bounds()
    limits = {j: (a, b) for (of, j, _), a, b in zip(grown.free(), low[2:], high[2:], strict=True) if of == i}

    def at(j: int, log: bool, x: float) -> tuple[float, AxisModel]:
        moved = float(np.clip(x, *limits[j]))
        t = grown.terms[i].with_slot(j, float(np.exp(moved)) if log else moved)
        other = view.fit(grown.with_terms((*grown.terms[:i], t, *grown.terms[i + 1 :])))
        return view.rms(view.gap(other)), other

    for _ in range(POLISH * (3 if term.kind.code == k.SATURATION else 1)):
        for j, log in free:
            value, width = grown.terms[i].q[j], widths[j]
            x = float(np.log(max(value, 1e-300))) if log else value
            sides = []
            for move in (-width, width):
                c, other = at(j, log, x + move)
                sides.append(c)
                if c < cost:
                    grown, cost = other, c
                    widths[j] *= 1.6
                    break
            else:  # between the two, at the vertex of the parabola through the three powers
                below, above = (c**2 - cost**2 for c in sides)
                if below + above > 0.0:
                    c, other = at(j, log, x + 0.5 * width * (below - above) / (below + above))
                    if c < cost:
                        grown, cost = other, c
            widths[j] *= 0.55
    return grown


def jointly(view: Any, grown: AxisModel, i: int) -> AxisModel:
    """The model with the free shape numbers of term ``i`` fitted together; the sizes are solved for at each step.

    Distance and damping of bristles trade against each other; moved one at a time, they stop halfway down.
    """
    first = grown.terms[i].kind.linear
    free = [(n, j, log) for n, (of, j, log) in enumerate(grown.free(), 2) if of == i and j >= first]
    at = [n for n, _, _ in free]
    (low, high), steps = grown.bounds(), grown.steps()

    def moved(x: Array) -> AxisModel:
        term = grown.terms[i]
        for (_, j, log), value in zip(free, x, strict=True):
            term = term.with_slot(j, float(np.exp(value)) if log else float(value))
        return view.fit(grown.with_terms((*grown.terms[:i], term, *grown.terms[i + 1 :])))

    fit = least_squares(
        lambda x: view.gap(moved(x)), grown.vector()[at], 3.0 * steps[at], (low[at], high[at]), tolerance=1e-3
    )
    best = moved(fit.x)
    return best if view.rms(view.gap(best)) < view.rms(view.gap(grown)) else grown


def widened(view: Any, model: AxisModel) -> AxisModel | None:
    """The last term with its later numbers freed, from the best of their starts."""
    last = model.terms[-1]
    rows = last.kind.opened(last.q, view.scene)
    if not rows:
        return None
    tried = [view.fit(model.with_terms((*model.terms[:-1], Term(*row)))) for row in rows]
    return jointly(view, min(tried, key=lambda m: view.rms(view.gap(m))), len(model.terms) - 1)


def next_order(view: Any, model: AxisModel, kind: Candidate) -> AxisModel | None:
    """The model with the best further order of a family; only whole orders can join whole ones."""
    base = ProjectedBase(view, model)
    present = {round(t.q[2], 2) for t in model.terms if t.kind == kind}
    whole = all(o.is_integer() for o in present)
    apart = ONE_PERIOD / view.scene.reach  # closer orders are one wave with an envelope
    orders = [
        o for o in scan_orders(view, base, kind, present)
        if (o.is_integer() or not whole) and all(abs(o - p) > apart for p in present)
    ]  # fmt: skip
    if not orders:
        return None
    best = max(orders, key=lambda o: term_gain(view, base, Term(kind, (0.0, 0.0, o))))
    return polished(view, model, Term(kind, (0.0, 0.0, best)))
