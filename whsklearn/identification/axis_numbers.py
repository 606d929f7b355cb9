"""An axis in the form of the free-run kernel: its parameters in a vector, its record in pieces."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import numpy as np

from whsklearn.effects import (
    CableSpring,
    Cogging,
    ContactStop,
    EarlyReversal,
    Effect,
    FlexibleCoupling,
    GravityImbalance,
    HardeningSpring,
    LoadFriction,
    SpeedHinge,
)
from whsklearn.effects.base import Array
from whsklearn.identification.view import View
from whsklearn.models import AxisModel
from whsklearn.recursion.batch.axis_free_run import HANGS, AxisForm, AxisLog, axis_motion, handed_over, settled

PIECE = 2.0  # s, length of a free run whose position must stay accurate
LEAST_PIECE = 100  # samples of such a free run
FEWEST_SHOT = 20  # samples of a piece of multiple shooting, ten per state variable
# s, fine step of a search: a quarter of the time in which MuJoCo's dry friction stops an axis, which is the fastest
COARSE = EarlyReversal().lead / 4.0
WAVES = GravityImbalance | Cogging


def axis_log(log: View, form: AxisForm) -> AxisLog:
    """The record in the form for fitting an axis: one piece, or short ones if there is gravity.

    With gravity the position matters, and a free run deviates from it after some seconds.
    """
    n, placed = log.u.size, form.of_position > 0
    piece = max(round(PIECE / log.dt), LEAST_PIECE) if placed else n
    begins = np.concatenate([np.arange(a, b, piece) for a, b in itertools.pairwise(log.bounds)])
    return AxisLog(
        log.drive, log.target, np.arange(n) >= 0, np.append(begins, n),
        np.column_stack([log.target[begins], log.y[begins] * placed]), log.dt, form,
    )  # fmt: skip


def shooting_log(log: View, seconds: float, form: AxisForm) -> AxisLog:
    """A logged position in pieces of the given length (s) and at least `FEWEST_SHOT` samples, for multiple shooting."""
    piece = max(seconds / log.dt, FEWEST_SHOT)
    begins = np.concatenate(
        [
            np.linspace(a, b, max(int((b - a) / piece), 1) + 1)[:-1].astype(int)
            for a, b in itertools.pairwise(log.bounds.tolist())
        ]
    )
    return AxisLog(
        log.drive, log.y, np.ones(log.u.size, dtype=bool), np.append(begins, log.u.size),
        np.column_stack([log.target[begins], log.y[begins]]), log.dt, form, of_position=True,
    )  # fmt: skip


def coarse(log: View) -> View:
    """The record with as few fine steps as a search needs; the last fit of an axis takes all of them."""
    return replace(log, steps=min(math.ceil(log.dt / COARSE - 1e-9), log.steps))


def in_pieces(log: View, form: AxisForm, seconds: float = PIECE) -> AxisLog:
    """The record as an axis is fitted to it, or what it leaves is told: a position in pieces of this length, otherwise
    as `axis_log`.
    """
    return shooting_log(log, seconds, form) if log.logged == "position" else axis_log(log, form)


def axis_residual(theta: Array, log: View, form: AxisForm) -> Array:
    """Residual of the axis in SI, its state fitted: for a position in pieces, otherwise of one run."""
    pieces = handed_over(theta, settled(theta, in_pieces(log, form)))
    return pieces.target - axis_motion(theta, pieces)


def axis_theta(model: AxisModel) -> tuple[Array, AxisForm]:
    """The kernel's parameters of an axis that `axis_fit` made, and its form."""
    p = model.parameters
    hinges = [t for t in model.law.terms if isinstance(t, SpeedHinge)]
    offset, *rest = model.effects
    if rest and isinstance(rest[0], FlexibleCoupling):
        share = rest[0].load_share
        reduced = model.inertia * share * (1.0 - share)
        coupling = (reduced * rest[0].compliance) ** -0.5 / (2.0 * np.pi), share, rest[0].damping_ratio
        theta = [
            model.inertia,
            p["viscous"],
            p["coulomb"],
            offset.magnitude,
            p["load_viscous"],
            rest[0].load_coulomb,
            *coupling,
        ]
        return np.array(theta), AxisForm(coupled=True, at_load=model.side == "load")
    growth = [e.magnitude for e in rest if isinstance(e, LoadFriction)]
    early = [x for e in rest if isinstance(e, EarlyReversal) for x in (e.lead, e.impedance)]
    stop = [x for e in rest if isinstance(e, ContactStop) for x in (*e.ends, e.stiffness, e.relaxation)]
    forces, base = position_weights([e for e in rest if not isinstance(e, LoadFriction | EarlyReversal | ContactStop)])
    orders = np.array([e.order if isinstance(e, Cogging) else 1.0 for e in rest if isinstance(e, WAVES)])
    knots = np.array([t.knot for t in hinges])
    theta = [model.inertia, p["viscous"], p["coulomb"], offset.magnitude + base, *forces, *growth, *early]
    powers = len(forces) - 2 * orders.size
    form = AxisForm(knots, orders, powers, stop=np.array(stop), loaded=bool(growth), early=bool(early))
    return np.array(theta + [t.magnitude for t in hinges]), form


def position_effects(weights: Array, form: AxisForm) -> tuple[float, list[Effect]]:
    """The contribution of position-dependent forces to the offset, and these forces as effects.

    w_1 sin(k q) + w_2 cos(k q) is A cos(k q + phi); w_1 q + w_2 q^2 + w_3 q^3 is a cubic about c = -w_2 / (3 w_3) and a
    line.
    """
    waves: list[Effect] = []
    for order, (sine, cosine) in zip(form.orders.tolist(), weights[: 2 * form.orders.size].reshape(-1, 2), strict=True):
        amplitude, phase = float(np.hypot(sine, cosine)), float(np.arctan2(-sine, cosine))
        hangs = order == HANGS[0]
        waves.append(GravityImbalance(amplitude, phase) if hangs else Cogging(amplitude, order, phase))
    line, square, cube = np.r_[weights[2 * form.orders.size :], np.zeros(3 - form.powers)].tolist()
    if form.powers < 2:
        return 0.0, [*waves, *[CableSpring(line)] * form.powers]
    centre = -square / (3.0 * cube) if cube else 0.0  # a start on a linear spring has neither
    return cube * centre**3, [*waves, CableSpring(line - 3.0 * cube * centre**2), HardeningSpring(cube, centre)]


def position_weights(effects: list[Effect]) -> tuple[list[float], float]:
    """The inverse of `position_effects`: weights, and the contribution of the cubic to the offset."""
    waves = [e for e in effects if isinstance(e, WAVES)]
    weights = [x for e in waves for x in (-e.amplitude * np.sin(e.phase), e.amplitude * np.cos(e.phase))]
    springs = effects[len(waves) :]
    if not springs:
        return weights, 0.0
    first, *more = springs
    assert isinstance(first, CableSpring)
    if not more:
        return [*weights, first.stiffness], 0.0
    (cubic,) = more
    assert isinstance(cubic, HardeningSpring)
    cube, centre = cubic.stiffness, cubic.centre
    line, square = first.stiffness + 3.0 * cube * centre**2, -3.0 * cube * centre
    return [*weights, line, square, cube], -cube * centre**3
