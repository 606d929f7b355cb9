"""Two masses in inverse dynamics, seen from either side.

Encoder on the motor: the measured motion drives the load, a_L = w^2 dz_gap(q_M - q_L) + 2 zeta w (v_M - v_L), and the
drive supplies J_M a_M + J_L a_L: least squares splits the inertia.

Encoder on the load: the motor is ahead by the twist, J_L a_L / k, and needs J_M times its second derivative in
addition.  Play is crossed when the transmitted torque m changes its sign, which takes J_M gap / 2 times the second
derivative of that sign.  Inertia and share trade off against each other; the share is half until a run of the model
is fitted.
"""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np
from numba import njit

from whsklearn.effects import codes as k
from whsklearn.filtering.records import CUTOFF_SIGMA, filtered, gaussian_derivatives
from whsklearn.gap.plants.servo_candidates import TWO_MASS
from whsklearn.gap.plants.servo_model import INSIDE, ServoHypothesis, ServoTerm
from whsklearn.gap.record import Array

STEPS = 8  # per period of the load on its spring; twice the damping ratio times as many, or the damper makes it diverge
TURNS = (
    0.1  # of the rms drive, over which a transmitted torque changes sign: 0.06 to 0.15 in a prototype; not varied here
)


@njit(cache=True, nogil=True)
def pushed(position, velocity, pull, inertia, gap, stiffness, damping, viscous, dry, dt, substeps):
    """Push on a load that a measured motor drives through a spring with play, its position and velocity, shape (3, n).

    ``pull`` and ``inertia`` are those of the load, (n,); its friction is a viscous and a dry one.  A push is the mean
    over a sample, position and velocity are those at its beginning.
    """
    n = position.size
    out = np.empty((3, n))
    q, v = position[0] - (math.copysign(0.5 * gap, pull[0]) if pull[0] else 0.0), velocity[0]
    h = dt / substeps
    for i in range(n):
        j = min(i + 1, n - 1)
        mean = 0.0
        out[1, i], out[2, i] = q, v
        for s in range(substeps):
            f = (s + 0.5) / substeps
            twist = position[i] + f * (position[j] - position[i]) - q
            slip = velocity[i] + f * (velocity[j] - velocity[i]) - v
            over = abs(twist) - 0.5 * gap
            a = 0.0
            if gap <= 0.0:
                a = stiffness * twist + damping * slip
            elif over > 0.0:
                a = stiffness * math.copysign(over, twist) + damping * slip
                if a * twist < 0.0:
                    a = 0.0
            heavy = inertia[i] + f * (inertia[j] - inertia[i])
            v += h * (a - pull[i] - f * (pull[j] - pull[i])) / heavy
            v = math.copysign(max(abs(v) - h * dry / heavy, 0.0), v) / (1.0 + h * viscous / heavy)
            q += h * v
            mean += a
        out[0, i] = mean / substeps
    return out


def fine_steps(hertz: float, zeta: float, dt: float) -> int:
    """Steps per sample for a load on a spring: `STEPS` per period, more of them the stronger it is damped."""
    return max(1, math.ceil(hertz * dt * max(STEPS, 2 * STEPS * zeta)))


def contact(model: ServoHypothesis, t: ServoTerm) -> tuple[float, float, float, float]:
    """(play, antiresonance w in rad/s, its damping ratio) of a term: the load on its spring with the motor held.

    The fourth number is what dry friction takes from the load's speed (rad/s2).
    """
    if t.kind.code == k.BACKLASH:
        gap, share, hz, zeta, dry = t.q
        w = 2 * np.pi * hz * np.sqrt(1 - share)
        return gap, w, zeta * np.sqrt(1 - share), dry / (model.inertia * share)
    compliance, share, zeta, dry = t.q
    w = np.sqrt(1.0 / (compliance * model.inertia * share))
    return 0.0, w, zeta * np.sqrt(1 - share), dry / (model.inertia * share)


def from_load(view: Any, t: ServoTerm, torque: Array | None) -> Array:
    """Drive of a motor that is ahead of a measured load, per unit of J_M J_L / k or of J_M gap / 2; shape (n, 1)."""
    _, _, g2 = gaussian_derivatives(CUTOFF_SIGMA / (2 * np.pi * view.cutoff), view.scene.dt)
    if t.kind.code == k.BACKLASH:
        m = view.record.drive if torque is None else torque
        side = np.clip(m / (TURNS * view.scene.torque), -1.0, 1.0)
        return filtered(side, g2, view.every)[:, None]
    return filtered(view.motion.acceleration, g2, view.every)[:, None]


def columns(view: Any, model: ServoHypothesis, t: ServoTerm, torque: Array | None = None) -> Array:
    """Acceleration of the load behind the view's Gaussian, shape (n, 1)."""
    if t.kind.on_load:
        return from_load(view, t, torque)
    gap, w, zeta, slowed = contact(model, t)
    dt = view.scene.dt
    moved, none = view.motion, np.zeros(view.motion.position.size)
    a = pushed(
        moved.position, moved.velocity, none, none + 1.0, gap, w**2, 2.0 * zeta * w, 0.0, slowed, dt,
        fine_steps(w / (2 * np.pi), zeta, dt),
    )[0]  # fmt: skip
    return view.blur(a)[:, None]


def sizes(model: ServoHypothesis) -> Array:
    """Inertia of the motor, then the linear numbers of the terms; the load's inertia is in the place of its term."""
    out = [model.inertia]
    for t in model.terms:
        if t.kind.code not in TWO_MASS:
            out += list(t.q[: t.kind.linear])
        elif not t.kind.on_load:
            out[0] -= model.inertia * t.q[1]
            out.append(model.inertia * t.q[1])
        elif t.kind.code == k.BACKLASH:
            out.append(0.5 * model.inertia * (1 - t.q[1]) * t.q[0])
        else:
            out.append(model.inertia**2 * t.q[1] * (1 - t.q[1]) * t.q[0])
    return np.array(out)


def seen_from_load(inertia: float, t: ServoTerm, size: float) -> ServoTerm:
    """A term seen from the load with the solved drive of the motor; its share of the inertia is kept."""
    share = t.q[1]
    if t.kind.code == k.BACKLASH:
        return dataclasses.replace(t, q=(2.0 * size / (inertia * (1 - share)), *t.q[1:]))
    return dataclasses.replace(t, q=(size / (inertia**2 * share * (1 - share)), *t.q[1:]))


def with_sizes(view: Any, model: ServoHypothesis, solved: Array) -> ServoHypothesis:
    """The model with its inertia split as solved; the antiresonance is kept."""
    terms, i = [], 1
    motor, load = max(float(solved[0]), 1e-3 * view.scene.inertia), 0.0
    for t in model.terms:
        if t.kind.code in TWO_MASS and t.kind.on_load:
            terms.append(seen_from_load(motor, t, max(float(solved[i]), 1e-9 * motor)))
            i += 1
        elif t.kind.code in TWO_MASS:
            load = max(float(solved[i]), 1e-3 * motor)
            i += 1
            gap, w, zeta, slowed = contact(model, t)
            low, high = t.kind.ranged(view.scene)[t.kind.fields.index("load_share")]
            # just inside its range, because a fit along the run does not leave a limit
            share = float(np.clip(load / (motor + load), low + INSIDE, high - INSIDE))
            held = zeta / np.sqrt(1 - share)
            q: tuple[float, ...]
            if t.kind.code == k.BACKLASH:
                q = (gap, share, float(w / (2 * np.pi) / np.sqrt(1 - share)), float(held), slowed * load)
            else:
                q = (float(1.0 / ((motor + load) * share * w * w)), share, float(held), slowed * load)
            terms.append(dataclasses.replace(t, q=q))
        else:
            terms.append(dataclasses.replace(t, q=(*map(float, solved[i : i + t.kind.linear]), *t.q[t.kind.linear :])))
            i += t.kind.linear
    timing = float(np.clip(solved[-1] / view.scene.dt, -1.0, 1.0))
    return dataclasses.replace(model, inertia=motor + load, timing=timing, terms=tuple(terms))


def start(model: ServoHypothesis, kind: Any, gap: float, hz: float, zeta: float, dry: float = 0.0) -> ServoTerm:
    """A term of the kind with this antiresonance, half of the inertia and a dry friction behind it."""
    share, w = 0.5, 2 * np.pi * hz
    held = zeta / np.sqrt(1 - share)
    if kind.code == k.BACKLASH:
        return ServoTerm(kind, (gap, share, hz / np.sqrt(1 - share), held, dry))
    return ServoTerm(kind, (1.0 / (model.inertia * share * w * w), share, held, dry))


def splits_of_friction(model: ServoHypothesis) -> list[ServoHypothesis]:
    """The model, and with the dry friction of its load on the motor instead, if there is any: starts for a fit.

    Behind a filter that hides the resonance the two are the same torque but for the reversals, whose edges the filter
    rounds: a seventh of MuJoCo's friction ended at a load that has none, in a minimum of the run too.
    """
    out = [model]
    dry = next((i for i, t in enumerate(model.terms) if t.name == "coulomb"), None)
    for i, t in enumerate(model.terms):
        if dry is not None and t.kind.code in TWO_MASS and not t.kind.on_load and t.q[-1] > 0.0:
            more = model.terms[dry].with_slot(0, model.terms[dry].q[0] + t.q[-1])
            out.append(model.replaced(i, t.with_slot(len(t.q) - 1, 0.0)).replaced(dry, more))
    return out
