"""Inverse dynamics of an axis: the torque balance along the measured motion, both sides behind one Gaussian."""

from __future__ import annotations

import itertools
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.optimize import minimize_scalar

from whsklearn.effects.base import Array, rms
from whsklearn.filtering.records import HOLDS, filtered, gaussian_derivatives
from whsklearn.identification.view import View
from whsklearn.recursion.batch.axis_free_run import HANGS, AxisForm, dissipates, rising_at_last

# Standard deviations of the Gaussian in samples.  With a narrow one, encoder noise in the acceleration biases the
# inertia towards zero (to a twentieth on a wrist logged at 100 Hz); a wide one removes the motion. Simulation decides
# which of the starts is best.
WIDTHS = (1.5, 4.0, 10.0, 25.0)
SLOW = 0.02  # of the rms velocity: below it the direction is uncertain, and with it the sign of friction
# Largest residual of the drive that the numbers of a free run may leave, as a multiple of the least-squares residual
# and as a share of the rms drive: fits in a wrong minimum leave several times as much. Chosen on a simulated shoulder
# and the joints of an AIRBOT, not calibrated.
WORSE, ALIKE = 2.0, 0.05
# Share of the rms drive that must go into acceleration; below it the sign of the inertia is arbitrary
LEAST_INERTIA = 1e-3
# Largest residual, as a share of the drive's standard deviation, of what is called an axis once its drive is shifted in
# time or turned round; above it the system is not an axis, and further poles look like a delay.
KNOWN = 0.35
# A speed whose deviation is less than this share of its mean shows the sum of friction and offset, not the inertia.
# Starts then have these times (s) in which friction would stop the axis.
EVEN, STOPS_IN = 0.05, (0.03, 0.3, 3.0, 30.0)
FEWEST = 20  # samples of a balance: its six numbers and a few
# Waves over the position: orders and samples that are tried, the highest order as in the catalogue, and how far (rad)
# the Gaussian may blur it in the slowest fifth of the samples, which is a third of it left
MOST_TRIED, HIGHEST, BLURRED, SLOWER = 2_000, 256.0, 1.5, 0.2
FEWEST_TURNS = 4.0 * np.pi  # rad of a wave over the travel, two periods: with fewer it is a cubic


def balance(log: View, width: float, form: AxisForm) -> tuple[Array, Array]:
    """(columns, drive) of u = J a + B v + C sign(v) + o + p(q) + sum w_k hinge_k, shapes (m, p) and (m,).

    Columns as theta of `whsklearn.recursion.batch.axis_free_run.AxisForm`.
    If the axis rests for longer than the width of the Gaussian, friction can have any value, so these samples are
    omitted.

    ``log``: in SI; its position, or its velocity. ``width``: standard deviation of the Gaussian in samples; the
    velocity for friction is smoothed with half of it.
    """
    dt = log.dt
    g, g1, g2 = gaussian_derivatives(width * dt, dt)
    fine, fine1, _ = gaussian_derivatives(max(0.5 * width, 1.0) * dt, dt)
    parts = []
    for a, b in itertools.pairwise(log.bounds):
        half = g.size // 2
        if b - a < 2 * half + FEWEST:
            continue
        if log.logged == "position":
            middle = float(np.mean(log.y[a:b]))
            y = log.y[a:b] - middle
            q, v = filtered(y, fine, 1) + middle, filtered(y, fine1, 1)
            acceleration = filtered(y, g2, 1)
        else:
            q, v = np.zeros(b - a), filtered(log.target[a:b], fine, 1)
            acceleration = filtered(log.target[a:b], g1, 1)
        slow = SLOW * max(rms(v), 1e-300)
        side = np.tanh(v / slow)
        columns = [v, side, np.full_like(v, form.shifted)]
        columns += form_columns(q, v, side, log.u[a:b], form)
        blurred = filtered(np.column_stack([*columns, np.abs(v) > slow, log.u[a:b]]), g, 1)
        keep = blurred[:, -2] > 0.5
        keep[:half] = keep[b - a - half :] = False
        parts.append(np.column_stack([acceleration, blurred[:, :-2], blurred[:, -1]])[keep])
    rows = np.concatenate(parts) if parts else np.empty((0, form.size + 1))
    return rows[:, :-1], rows[:, -1]


def acting(log: View) -> Array:
    """The drive (n,) that acts about the instants of the samples: held, it is the mean of the last two."""
    if log.hold != HOLDS[0]:
        return log.u
    out = log.u.copy()
    out[1:] = 0.5 * (log.u[1:] + log.u[:-1])
    out[log.bounds[:-1]] = log.u[log.bounds[:-1]]
    return out


def form_columns(q: Array, v: Array, side: Array, drive: Array, form: AxisForm) -> list[Array]:
    """What acts beside inertia, viscous and dry friction and an offset at weight one, in the order of theta.

    ``q``, ``v``, ``drive`` (n,): position, velocity and drive; ``side`` (n,): the direction of dry friction.
    """
    e = q - form.centre
    columns = [wave(k * e) for k in form.orders for wave in (np.sin, np.cos)] + [
        e ** (k + 1) for k in range(form.powers)
    ]
    columns += [side * np.abs(drive)] * form.loaded + [np.zeros_like(v)] * 2 * form.early
    return columns + [side * np.maximum(np.abs(v) - k, 0.0) for k in form.knots]


def solved(columns: Array, drive: Array, *, falls: bool = False) -> Array:
    """Bounded least squares (p,): inertia, viscous and Coulomb friction are not below zero.

    With three bounds there are eight combinations of active bounds; the best feasible solution is returned.  If the
    friction ``falls``, the slope at standstill has no bound.
    """
    scale = np.linalg.norm(columns, axis=0)
    scale[scale == 0.0] = 1.0
    r: Array = np.linalg.qr(np.column_stack([columns / scale, drive])).R
    best, least = np.zeros(scale.size), np.inf
    bounded = [0, 2] if falls else [0, 1, 2]
    for off in itertools.product((True, False), repeat=len(bounded)):
        free = np.delete(np.arange(scale.size), np.array(bounded)[list(off)])
        theta = np.zeros(scale.size)
        theta[free] = np.linalg.lstsq(r[:, free], r[:, -1], rcond=1e-9)[0]
        left = float(np.linalg.norm(r[:, -1] - r[:, :-1] @ theta))
        if theta[bounded].min() >= 0.0 and left < least:
            best, least = theta, left
    return best / scale


def next_wave(log: View, form: AxisForm) -> tuple[float, float, float]:
    """The order (1/rad) of the wave over the position that explains most beside a form, and its share of the squared
    residual and of the rms drive.

    A Gaussian of s seconds damps a wave by exp(-(k v s)^2 / 2), so a narrow one shows high orders, and a wide one those
    that drown in the noise of the encoder; the width of the largest share decides.  No wave has fewer periods over the
    travel than `FEWEST_TURNS`.

    ``log``: in SI, its position. ``form``: what is known to act. Both shares are zero if no order can be tried.
    """
    log, best = replace(log, u=acting(log)), (0.0, 0.0, 0.0)
    for width in WIDTHS:
        columns, drive = balance(log, width, form)
        if drive.size < FEWEST:
            continue
        every = max(int(width), drive.size // MOST_TRIED)  # neighbours behind a Gaussian say the same
        blur, place = (balance(log, width, AxisForm(powers=1))[0][::every, k] for k in (1, 4))
        blur = width * log.dt * np.abs(blur)  # rad of an order of one
        own = np.linalg.qr(columns[::every] / np.maximum(np.linalg.norm(columns[::every], axis=0), 1e-300)).Q
        left = drive[::every] - own @ (own.T @ drive[::every])
        reach = max(float(np.ptp(place)), 1e-300)
        highest = min(BLURRED / max(float(np.quantile(blur, SLOWER)), 1e-300), HIGHEST * max(1.0, 1.0 / reach))
        step = max(0.5 * np.pi / reach, highest / MOST_TRIED)
        lowest = FEWEST_TURNS / reach
        orders = np.arange(lowest, highest, step)
        if log.angle:
            orders = np.union1d(orders, np.arange(np.ceil(lowest), highest))

        def taken(
            order: float, left: Array = left, blur: Array = blur, place: Array = place, own: Array = own
        ) -> float:
            """The share of one order, beside the columns of the form."""
            damped = np.exp(-0.5 * np.minimum(order * blur, 30.0) ** 2)
            waves = np.column_stack([damped * np.cos(order * place), damped * np.sin(order * place)])
            waves -= own @ (own.T @ waves)
            found = waves @ np.linalg.lstsq(waves, left, rcond=1e-9)[0]
            return float(found @ found) / max(float(left @ left), 1e-300)

        if orders.size:
            near = max(orders.tolist(), key=taken)
            bounds = max(near - step, lowest), near + step
            peak = minimize_scalar(lambda k: -taken(k), bounds=bounds, method="bounded")
            size = np.sqrt(-peak.fun) * rms(left) / max(rms(drive), 1e-300)
            best = max(best, (-float(peak.fun), float(peak.x), float(size)))
    share, order, size = best
    return order, share, size


class Start(NamedTuple):
    """Numbers by inverse dynamics, and the torque balance from which they were solved."""

    theta: Array
    columns: Array
    drive: Array
    even: bool = False

    def holds(self, theta: Array) -> bool:
        """Whether other parameters explain the drive along the measured motion about as well as least squares does.

        A run that ignores the drive can follow a record for a while, especially that of an axis made unstable by
        gravity; its torque balance, however, is much worse.
        """
        left, least = (rms(self.drive - self.columns @ t) for t in (theta, self.theta))
        alike = left <= max(WORSE * least, ALIKE * rms(self.drive))
        return alike and (self.even or _accelerates(theta, self.columns, self.drive))  # without inertia it is no axis


def inverse_starts(log: View, form: AxisForm) -> list[Start]:
    """Starts of a fit, one for each width of the Gaussian that yields an inertia; friction is at least slightly above
    zero.  If the axis turns so evenly that none does, they differ in the inertia.

    Raises ValueError if with none of them the drive accelerates the output in its own direction, even with a
    position-dependent force.
    """
    log = replace(log, u=acting(log))
    found: list[Start] = []
    least = 1e-3 * np.std(log.u) / np.array([np.std(log.target) or 1.0, 1.0])
    for width in WIDTHS:
        columns, drive = balance(log, width, form)
        if drive.size < FEWEST:
            continue
        for falls in (False, True)[: 1 + (form.knots.size > 0)]:
            theta = solved(columns, drive, falls=falls)
            theta[1:3] = np.where(theta[1:3] >= 0.0, np.maximum(theta[1:3], least), theta[1:3])
            theta = rising_at_last(np.clip(theta, *form.limits), form.knots)
            if _accelerates(theta, columns, drive) and dissipates(theta, form.knots):
                found.append(Start(theta, columns, drive))
    found = found or _even_starts(log, form)
    if not found:
        raise ValueError(_backwards(log, form))
    return found


def _even_starts(log: View, form: AxisForm) -> list[Start]:
    """Starts of an axis that turns evenly against its drive, half of which is viscous and half Coulomb friction."""
    if form.size > AxisForm().size:
        return []
    for width in WIDTHS[::-1]:
        columns, drive = balance(log, width, form)
        speed, torque = (float(np.mean(x)) for x in (columns[:, 1], drive)) if drive.size else (0.0, 0.0)
        if drive.size >= FEWEST and np.std(columns[:, 1]) < EVEN * abs(speed) and speed * torque > 0.0:
            viscous, coulomb = 0.5 * torque / speed, 0.5 * abs(torque)
            return [Start(np.array([viscous * t, viscous, coulomb, 0.0]), columns, drive, True) for t in STOPS_IN]
    return []


def _accelerates(theta: Array, columns: Array, drive: Array) -> bool:
    """Whether the drive accelerates the output at all."""
    return bool(theta[0] * rms(columns[:, 0]) > LEAST_INERTIA * rms(drive))


def _backwards(log: View, form: AxisForm) -> str:
    """Error message if no inertia is found: a force that grows with the position may hide it."""
    if not form.of_position and log.logged == "position":
        for width in WIDTHS:
            columns, drive = balance(log, width, AxisForm(orders=HANGS))
            if drive.size >= FEWEST and _accelerates(solved(columns, drive), columns, drive):
                return "Without gravity no inertia fits: see the axis with gravity."
    text = "The drive does not accelerate the output in its own direction, so this is not a rigid axis"
    for width in WIDTHS:
        columns, drive = balance(log, width, form)
        if drive.size >= FEWEST:
            theta = solved(columns, -drive)
            if _accelerates(theta, columns, drive) and rms(drive + columns @ theta) < KNOWN * np.std(drive):
                return f"{text}; with the sign of the drive inverted it is (--invert-drive)."
    return f"{text}."
