"""Free run of a physical axis model, with exact sensitivities.

J dv/dt = u - o - p(q) - B v - (C + c |u|) sign(v) - sum w_k sign(v) max(|v| - knot_k, 0), where p(q) is that of waves,
the sum of a_k sin(k e) + b_k cos(k e), one of which may be gravity, and of a spring, w_1 e + w_2 e^2 + w_3 e^3, with
e = q - centre.  Beyond its ends, a stop pushes back.

The steps are those of `whsklearn.systems._servo_kernel`: half a drift, a kick, half a drift (second order), linearly
implicit in the velocity.  A step in which the axis stops is divided there, so that a reversal is as exact as the rest
of the run, and standstill is exact: while the drive cannot overcome dry friction, v = 0 and all earlier errors of the
velocity are forgotten.  Friction that reverses early is continuous in v, so that no step is divided.

It has its own kernel for speed: finite differences with the servo's kernel, which has every effect, take many times as
long. Two masses have their own loop, `whsklearn.recursion.batch.coupled_run`.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from whsklearn._numba import njit, part
from whsklearn.effects import EarlyReversal, FlexibleCoupling, LoadFriction, LoadSideViscous
from whsklearn.effects.base import Array, Bools, Integers
from whsklearn.effects.equations import early_stop, speed_hinge
from whsklearn.effects.transmission import contact_stiffness
from whsklearn.recursion.batch.best_linear import BATCHES, descend
from whsklearn.recursion.batch.coupled_run import bodies_of, coupled_pass, slopes_of
from whsklearn.systems._servo_kernel import implicit_gain

SETTLED = 1e-8  # relative change in cost of a piece, at which the search for its state ends
SHARE_AND_DAMPING = ((0.02, 0.003), (0.98, 1.0))  # lower and upper bounds of a coupling's load share and damping ratio
MOST_LOADED = LoadFriction.quantities["coefficient"].high  # c of friction that grows with the drive
# Lower and upper bounds of both numbers of an early reversal
LEAD_AND_IMPEDANCE = tuple(
    np.array([getattr(EarlyReversal.quantities[k], end) for k in ("lead", "impedance")]) for end in ("low", "high")
)
HANGS = np.ones(1)  # orders of an axis with a weight on it
LARGEST = 1e100  # bound of an error or a sensitivity, so that its square stays finite
UNSEEN = 1e-12  # of the largest eigenvalue of the information, columns at unit length: smaller ones are rounding

_WITHOUT_ROWS, _NOWHERE = np.empty((0, 0, 0)), np.empty((0, 0))


class AxisForm(NamedTuple):
    """Which forces act in addition to inertia, viscous and dry friction and an offset.

    ``knots`` (> 0) are the speeds at which the slope of the friction changes.  The position-dependent forces are waves
    of these ``orders`` (1/rad), each with two weights, then those of a spring with this number of ``powers`` of e (0:
    none).  Gravity is a wave of order one (`HANGS`).  ``stop`` is that of `whsklearn.effects.ContactStop`: lower and
    upper end, stiffness and relaxation; empty if there is none.  If the axis is ``loaded``, its dry friction grows with
    the drive; if its drive is not ``shifted``, it has no offset; if its dry friction reverses ``early``, it is that of
    `whsklearn.effects.EarlyReversal`.  theta holds inertia, viscous friction, Coulomb friction, offset, one weight per
    position-dependent force, the growth with the drive, lead and impedance of an early reversal, and one weight per
    knot.

    If the axis is ``coupled``, it has a load behind a spring, and theta ends with viscous and Coulomb friction of the
    load, resonance, load share and damping ratio; then only friction acts in addition, and the output is the motion of
    the motor or, ``at_load``, of the load.
    """

    knots: Array = np.empty(0)
    orders: Array = np.empty(0)
    powers: int = 0
    centre: float = 0.0
    stop: Array = np.empty(0)
    loaded: bool = False
    shifted: bool = True
    early: bool = False
    coupled: bool = False
    at_load: bool = False

    @property
    def states(self) -> int:
        """Size of the state of a piece: velocity and position, and twist and slip of a coupling."""
        return 4 if self.coupled else 2

    @property
    def of_position(self) -> int:
        """Number of position-dependent forces."""
        return 2 * self.orders.size + self.powers

    @property
    def size(self) -> int:
        """Number of parameters."""
        return 4 + self.of_position + self.loaded + 2 * self.early + self.knots.size + 5 * self.coupled

    @property
    def limits(self) -> tuple[Array, Array]:
        """Lowest and highest theta; the slope at standstill of a friction with knots has none."""
        low, high = np.full(self.size, -np.inf), np.full(self.size, np.inf)
        if not self.shifted:
            low[3] = high[3] = 0.0
        low[2 if self.knots.size else 1 : 3] = 0.0
        low[self.growth], high[self.growth] = 0.0, MOST_LOADED
        if self.early:
            low[self.reversal], high[self.reversal] = LEAD_AND_IMPEDANCE
        if self.coupled:
            low[4:6], low[-2:], high[-2:] = 0.0, *SHARE_AND_DAMPING
        return low, high

    @property
    def growth(self) -> slice:
        """Place in theta of what the friction of a ``loaded`` axis grows by; empty of another."""
        return slice(4 + self.of_position, 4 + self.of_position + self.loaded)

    @property
    def reversal(self) -> slice:
        """Places in theta of the lead and the impedance of friction that reverses ``early``; empty of another."""
        return slice(self.growth.stop, self.growth.stop + 2 * self.early)


class AxisLog(NamedTuple):
    """Drive and motion of an axis, and the start of each piece; every piece has its own initial state.

    ``u`` is the drive in every fine step, shape (n, steps).  ``start`` (k, 2 or 4) holds velocity and position at the
    start of each piece and, if they are known, twist and slip of a coupling.  ``target`` is the velocity, or the
    position if ``of_position``.
    """

    u: Array
    target: Array
    counts: Bools
    bounds: Integers
    start: Array
    dt: float
    form: AxisForm = AxisForm()
    of_position: bool = False

    @property
    def states(self) -> Array:
        """A copy of ``start`` with all states of the form, shape (k, 2 or 4); a coupling is at rest if not told."""
        out = np.zeros((len(self.start), self.form.states))
        out[:, : self.start.shape[1]] = self.start
        return out


class AxisFit(NamedTuple):
    """theta, its covariance, the error on the samples that count, and the sum of squares of that error."""

    theta: Array
    covariance: Array
    error: Array
    cost: float


def axis_motion(theta: Array, log: AxisLog, chosen: Bools | None = None) -> Array:
    """Velocity or position, whichever is the target of the log; shape (n,). Zero but in ``chosen`` pieces, if given."""
    velocity, position = _pass(theta, log, _WITHOUT_ROWS, chosen=chosen)
    return position if log.of_position else velocity


def sensitivities(
    theta: Array, log: AxisLog, *, of_states: bool = False, chosen: Bools | None = None
) -> tuple[Array, Array]:
    """The run, shape (n,), and its derivatives, shape (p + 2, n).

    The last two derivatives are with respect to v0 and q0 of the sample's piece.  With a coupling there are four, one
    per state.  With ``of_states`` there are only these. Both are zero but in ``chosen`` pieces, if these are given.
    """
    states = log.form.states
    rows = np.zeros((2, states + theta.size * (not of_states), log.target.size))
    run, by = _pass(theta, log, rows, chosen=chosen)[int(log.of_position)], rows[int(log.of_position)]
    if log.form.coupled and len(by) > states:
        by[:-states] = slopes_of(theta) @ by[:-states]
    if not (log.form.shifted or of_states):
        by[3] = 0.0
    return run, by


@dataclass(eq=False)
class _Run:
    """Parameters, the log with the states of its pieces, the error of the run, and the cost to minimise."""

    theta: Array
    log: AxisLog
    error: Array
    cost: float

    @cached_property
    def slopes(self) -> tuple[Array, Array]:
        """Sensitivities beside the states (p, n), and what these explain of them (k, states, p); of a point from which
        a step is taken, as most steps are refused.
        """
        return beside_the_states(sensitivities(self.theta, self.log)[1], self.log)


def _says_something(cost: float, rows: Array) -> bool:
    """Whether a run and its sensitivities are finite."""
    return bool(np.isfinite(cost) and np.abs(rows).max(initial=0.0) < LARGEST)


def _stepped(theta: Array, step: Array, form: AxisForm) -> Array | None:
    """theta after a step: inertia keeps at least a twentieth, a resonance and a lead half; None if friction would drive
    the axis.

    A lead that is short beside the fine step has hardly any slope left, so a fit that steps there stays there.

    Only a law with knots may fall from standstill, as Stribeck's does.
    """
    trial = np.clip(rising_at_last(theta + step, form.knots), *form.limits)
    if form.coupled:
        trial[-3] = np.clip(trial[-3], 0.5 * theta[-3], 2.0 * theta[-3])
    if form.early:
        lead = form.reversal.start
        trial[lead] = np.clip(trial[lead], 0.5 * theta[lead], 2.0 * theta[lead])
    trial[0] = max(trial[0], 0.05 * theta[0])
    return trial if dissipates(trial, form.knots) else None


def rising_at_last(theta: Array, knots: Array) -> Array:
    """theta with a friction that does not fall beyond the last knot, where it would drive a faster axis."""
    out = theta.copy()
    if knots.size:
        out[-1] = max(out[-1], -(out[1] + out[out.size - knots.size : -1].sum()))
    return out


def dissipates(theta: Array, knots: Array) -> bool:
    """Whether dry and viscous friction bent at the knots oppose the motion at every knot."""
    bent = np.maximum(knots[:, None] - knots, 0.0) @ theta[theta.size - knots.size :]
    return bool(np.all(theta[2] + theta[1] * knots + bent >= 0.0))


def settled(theta: Array, log: AxisLog, passes: int = 8) -> AxisLog:
    """The log with the states of its pieces fitted for these parameters."""
    return log._replace(start=fit_state(theta, log, passes))


def handed_over(theta: Array, log: AxisLog) -> AxisLog:
    """The log with pieces that begin with the state at the end of the one before, where that fits better.

    A state that is fitted from the wrong side of a standstill stays there, and of a coupled axis, whose twist is not
    measured, its fit has several minima. The first piece may begin at rest.
    """
    for _ in range(HANDED):
        ends = np.empty_like(log.states)
        motion = _pass(theta, log, _WITHOUT_ROWS, ends)
        rest = np.zeros_like(ends[:1])
        rest[0, 1] = log.target[0] if log.of_position else log.start[0, 1]
        states = np.vstack([rest, ends[:-1]])
        stay = costs(log.target - motion[int(log.of_position)], log)
        # the position is fitted too
        better = costs(log.target - axis_motion(theta, log._replace(start=states)), log, level=log.of_position) < stay
        if not better.any():
            break
        there = log._replace(start=np.where(better[:, None], states, log.states))
        other = there._replace(start=fit_state(theta, there, SETTLING, better))
        better &= costs(log.target - axis_motion(theta, other, better), log) < stay
        log = log._replace(start=np.where(better[:, None], other.states, log.states))
    return log


HANDED = 2  # rounds of it
SETTLING = 3  # passes of the state fit after each step of the parameters


def fit_pieces(theta: Array, log: AxisLog, *, iterations: int = 25, enough: float = 1e-6) -> AxisFit:
    """Multiple shooting: theta, and v0 and q0 of every piece, by Levenberg-Marquardt on the errors of all pieces.

    The states are eliminated: the part of the sensitivities and of the error that they can explain does not count for
    theta (variable projection, Golub and Pereyra 1973).  If gravity makes the free run unstable, its error grows
    e-fold in every sqrt(J / G).  A piece that lasts a few times as long is still informative; a run of the whole
    record is not (Bock 1981).

    ``theta`` (p,): initial parameters. ``log``: the record in pieces. ``iterations``: largest number of iterations.
    Returns the fit; its cost is infinite if the run diverges.
    """

    def run_of(trial: Array, there: AxisLog) -> _Run:
        error = there.target - axis_motion(trial, there)
        return _Run(trial, there, error, _squares(error))

    def equations(at: _Run) -> tuple[Array, Array] | None:
        rows = at.slopes[0]
        if not _says_something(at.cost, rows):
            return None
        slope = rows @ at.error
        # friction at its limit stays there: on an axis that turns one way an offset has the same effect, and of a step
        # that they share, the half that friction cannot take would be missing
        low, high = log.form.limits
        stays = ((at.theta <= low) & (slope < 0.0)) | ((at.theta >= high) & (slope > 0.0))
        rows = np.where(stays[:, None], 0.0, rows)
        return rows @ rows.T + 1e-300 * np.eye(len(rows)), np.where(stays, 0.0, slope)  # the diagonal is positive

    def moved(at: _Run, step: Array) -> _Run | None:
        trial = _stepped(at.theta, step, log.form)
        if trial is None:
            return None
        run = run_of(trial, settled(trial, _following(at, trial), SETTLING))
        return run if run.cost < at.cost else run_of(trial, handed_over(trial, run.log))

    start = handed_over(theta, settled(theta, log, SETTLING))
    end = descend(run_of(theta, start), equations, moved, iterations, enough=enough)
    rows = end.slopes[0]
    if not _says_something(end.cost, rows):
        return AxisFit(end.theta, np.full((theta.size, theta.size), np.inf), end.error, np.inf)
    return AxisFit(end.theta, covariance_of(rows, end.error, end.theta, log.bounds), end.error, end.cost)


def _following(at: _Run, theta: Array) -> AxisLog:
    """The log of a run with states that follow a step of the parameters to first order, where that begins closer.

    Fitted from where they were, a few of many states end on the wrong side of a standstill, and the step is refused
    for their sake: from numbers that were 3 to 30 % off, a fit over pieces of 0.25 s then ended at five to sixty times
    the least sum of squares.
    """
    other = at.log._replace(start=at.log.states - at.slopes[1] @ (theta - at.theta))
    stay, follow = (costs(log.target - axis_motion(theta, log), log) for log in (at.log, other))
    return at.log._replace(start=np.where((follow < stay)[:, None], other.states, at.log.states))


def costs(error: Array, log: AxisLog, *, level: bool = False) -> Array:
    """Sum of squares of each piece, about its ``level`` or zero; infinite if it has diverged."""
    begins = log.bounds[:-1]
    lost = ~(np.abs(error) < LARGEST)
    known = np.where(lost, 0.0, error) * log.counts
    costs = np.add.reduceat(known**2, begins)
    if level:
        costs -= np.add.reduceat(known, begins) ** 2 / np.add.reduceat(np.maximum(log.counts, 1e-9), begins)
    return np.where(np.add.reduceat(lost, begins, dtype=int) > 0, np.inf, costs)


def beside_the_states(rows: Array, log: AxisLog) -> tuple[Array, Array]:
    """Sensitivities to theta, (p, n), without the part that v0 and q0 of each piece explain at the samples that count,
    and that part, (k, states, p), as sensitivities of the states.

    The other samples follow: their rows are those of a run whose state is fitted to the samples that count.
    """
    n = log.form.states
    out = rows[:-n].copy()
    follows = np.zeros((log.bounds.size - 1, n, len(out)))
    if not np.abs(rows).max(initial=0.0) < LARGEST:  # the run has diverged, and so have they
        return out, follows
    for e, (s, t) in enumerate(itertools.pairwise(log.bounds)):
        seen, by_state = log.counts[s:t], rows[-n:, s:t]
        follows[e] = np.linalg.lstsq(by_state[:, seen].T, out[:, s:t][:, seen].T, rcond=1e-9)[0]
        out[:, s:t] -= follows[e].T @ by_state
    return out, follows


def _squares(error: Array) -> float:
    """Sum of squares; infinite if the run has diverged."""
    return float(error @ error) if np.abs(error).max(initial=0.0) < LARGEST else np.inf


def fit_state(theta: Array, log: AxisLog, passes: int = 8, chosen: Bools | None = None) -> Array:
    """Fit the state of every piece, or of the ``chosen`` ones, to the samples that count, by Gauss-Newton.

    Replaying the drive over the 300 ms before an instant gives its state to within 2.75e-4 rad after 2 s; a
    causal quadratic gives 1.9e-3 (library servo).  A step across standstill can be too long, so it is shortened: once,
    a single one of 24 windows that ended on the wrong side caused all of the error by which structures are compared.
    """
    state, n = log.states, log.form.states
    trial, step, best = state.copy(), np.zeros_like(state), np.full(len(state), np.inf)
    going = np.ones(len(state), dtype=bool) if chosen is None else chosen.copy()
    for _ in range(passes):
        run, rows = sensitivities(theta, log._replace(start=trial), of_states=True, chosen=going)
        _state_steps(rows[-n:], log.target - run, log.counts, log.bounds, going, trial, state, step, best)
        if not going.any():
            break
        trial = state + step
    return state


@njit(cache=True, error_model="numpy")
def _state_steps(rows, left, counts, bounds, going, trial, state, step, best):
    """Take the states ``trial`` (k, n) that come closer, and their next steps; other steps become a quarter.

    Those of pieces that are still ``going`` (k,): until the cost of a state hardly changes.
    ``rows`` (n, N) are sensitivities to the states of ``left`` (N,). A log has a thousand pieces, and a fit passes over
    them hundreds of times: in Python `identify` took 4.6 s of CPU for 1,200 samples, and 2.8 so.
    """
    n = rows.shape[0]
    for e in np.flatnonzero(going):
        s, t = bounds[e], bounds[e + 1]
        m = 0
        for i in range(s, t):
            m += counts[i]
        by, error = np.zeros((m, n)), np.zeros(m)
        k, cost, size = 0, 0.0, 0.0
        for i in range(s, t):
            for j in range(n):
                size = max(size, abs(rows[j, i])) if rows[j, i] == rows[j, i] else np.inf
            if counts[i]:
                for j in range(n):
                    by[k, j] = rows[j, i]
                error[k] = left[i]
                cost += left[i] ** 2 if abs(left[i]) < LARGEST else np.inf
                k += 1
        going[e] = not abs(cost - best[e]) <= SETTLED * cost  # the first is compared with infinity
        if cost < best[e] and size < LARGEST:
            best[e], state[e] = cost, trial[e]
            step[e] = np.linalg.lstsq(by, error, 1e-9)[0] if m else np.zeros(n)
            gain = 0.0  # what the step would take off the cost, were the run linear in the state
            for i in range(m):
                change = 0.0
                for j in range(n):
                    change += by[i, j] * step[e, j]
                gain += change**2
            going[e] &= gain > SETTLED * cost
        else:
            step[e] /= 4.0


def covariance_of(rows: Array, error: Array, theta: Array, bounds: Integers) -> Array:
    """Covariance by leaving out batches in turn, as the error is seldom white; a batch is no smaller than a piece.

    Each batch moves the estimate by (A - A_b)^-1 of its score, A being the information (the jackknife of clustered
    data, MacKinnon, Nielsen and Webb 2023).  The sum of squared scores alone is too small where few batches, such as
    those with fast motion, tell most of a number.

    Along a direction that no sample shows, numbers may exchange all that they contribute: if an axis turns one way
    only, just the sum of Coulomb friction and offset is known.  A pseudoinverse alone would call each of them certain.
    """
    scale = np.linalg.norm(rows, axis=1)
    scale[scale < 1.0 / LARGEST] = 1.0  # nothing shows it
    unit = rows / scale[:, None]
    information = unit @ unit.T
    values, axes = np.linalg.eigh(information)
    seen = values > UNSEEN * values[-1]
    edges = np.linspace(0, error.size, min(BATCHES, error.size) + 1).astype(int)
    if bounds.size > 2:
        edges = np.unique(bounds[np.searchsorted(bounds, edges, side="right") - 1])
    hidden = axes[:, ~seen] * (np.abs(theta * scale) @ np.abs(axes[:, ~seen]))
    covariance = hidden @ hidden.T
    for s, e in itertools.pairwise(edges.tolist()):
        without = axes[:, seen].T @ (information - unit[:, s:e] @ unit[:, s:e].T) @ axes[:, seen]
        moved = axes[:, seen] @ (
            np.linalg.pinv(without, hermitian=True) @ (axes[:, seen].T @ (unit[:, s:e] @ error[s:e]))
        )
        covariance += np.outer(moved, moved)
    return covariance / np.outer(scale, scale)


def behind_the_spring(theta: Array) -> tuple[FlexibleCoupling, LoadSideViscous]:
    """The coupling from theta (inertia, resonance in Hz, load share, damping ratio), with the load's friction."""
    frequency, share, ratio = theta[-3:].tolist()
    reduced = float(theta[0]) * share * (1.0 - share)
    coupling = FlexibleCoupling(1.0 / contact_stiffness(frequency, reduced), share, ratio, float(theta[5]))
    return coupling, LoadSideViscous(float(theta[4]))


def _pass(theta: Array, log: AxisLog, rows: Array, ends: Array = _NOWHERE, chosen: Bools | None = None) -> Array:
    form, bounds = log.form, log.bounds
    chosen = np.ones(bounds.size - 1, dtype=bool) if chosen is None else chosen
    if form.coupled:
        numbers = bodies_of(theta)
        motion: Array = coupled_pass(numbers, form.at_load, log.u, bounds, chosen, log.states, log.dt, rows, ends)
    else:
        motion = axis_pass(theta, form, log.u, bounds, chosen, log.states, log.dt, rows, ends)
    return motion


@part
def _of_position(e, orders, force, slope):
    """Position-dependent forces of unit weight and their slopes, at ``e`` from the centre: waves, then powers of e."""
    waves, power = 2 * orders.size, 1.0
    for k in range(orders.size):
        order, at = orders[k], 2 * k
        force[at], force[at + 1] = math.sin(order * e), math.cos(order * e)
        slope[at], slope[at + 1] = order * force[at + 1], -order * force[at]
    for k in range(waves, force.size):
        slope[k] = (k - waves + 1.0) * power
        power *= e
        force[k] = power


@njit(cache=False, forceinline=True, error_model="numpy")  # as a call the run takes half as long again
def _torques(theta, form, drive, q, v, force, slope):
    """Drive less offset and forces over position, friction but dry, and the slopes of what resists by v and by q.

    ``force`` and ``slope`` become those of position-dependent forces of unit weight.
    """
    _of_position(q - form.centre, form.orders, force, slope)
    net, resisting, by_v, by_q = drive - theta[3], theta[1] * v, theta[1], 0.0
    for k in range(force.size):
        net -= theta[4 + k] * force[k]
        by_q += theta[4 + k] * slope[k]
    for k in range(form.knots.size):
        weight = theta[theta.size - form.knots.size + k]
        bent, _, tilt = speed_hinge(form.knots[k], v)
        resisting += weight * bent
        by_v += weight * tilt
    if form.stop.size > 0:
        side, depth = (1.0, q - form.stop[1]) if q - form.stop[1] > form.stop[0] - q else (-1.0, form.stop[0] - q)
        stiffness, relaxation = form.stop[2], form.stop[3]
        if depth > 0.0 and depth + relaxation * side * v > 0.0:  # it never pulls, as in `end_stop`
            net -= side * stiffness * depth
            by_q += stiffness
            resisting += stiffness * relaxation * v
            by_v += stiffness * relaxation
    return net, resisting, by_v, by_q


@part
def _by_numbers(by, form, v, s, kick, h, stiffness, force, size):
    """Slopes ``by`` of a step's acceleration by each number of theta, after a kick; those by the state stay zero.

    ``size``: of the drive.
    """
    places = 4 + force.size + form.loaded + 2 * form.early
    by_gain = -kick * (0.5 if stiffness < 0.5 else 1.0)  # effect of a slope through the gain
    by[0], by[1], by[2], by[3] = -kick / h, by_gain - v, -s, -1.0
    for k in range(force.size):
        by[4 + k] = -force[k]
    if form.loaded:
        by[4 + force.size] = -s * size
    if form.early:
        by[places - 2] = by[places - 1] = 0.0
    for k in range(form.knots.size):
        bent, _, tilt = speed_hinge(form.knots[k], v)
        by[places + k] = by_gain * tilt - bent


@part
def _by_numbers_held(by, form, v, kick, h, net, inertia, impedance, stop, stop_by_lead):
    """The same where friction that reverses early holds, from those of `_by_numbers`.

    ``net``: torque without friction and offset. ``stop``: torque per velocity, with its slope by the lead.
    """
    last = by.size - 2 - form.knots.size  # of the forces; the two states come after the knots
    by[0], by[1], by[2], by[3] = -kick / h - stop * v / inertia, by[1] + v, 0.0, 0.0
    for k in range(4, last - 2):
        by[k] *= 1.0 - impedance
    if form.loaded:
        by[last - 3] = 0.0
    by[last - 2], by[last - 1] = -stop_by_lead * v, -net - stop * v / impedance
    for k in range(form.knots.size):
        by[last + k] += speed_hinge(form.knots[k], v)[0]


@njit(cache=True, error_model="numpy")
def axis_pass(theta, form, u, bounds, chosen, start, dt, rows, ends):
    """Return velocity and position, (2, n); write the derivatives into rows (2, p + 2, n) unless it is empty.

    Only of the ``chosen`` pieces (bool): elsewhere they stay zero.
    With rows of (2, 2, n) they are those with respect to the state at the start of the piece alone.  The states (k, 2)
    after the last sample of each piece are written into ends unless it is empty.
    One loop: motion and sensitivities of a step share its forces and their slopes, which are computed once.
    """
    n_theta = theta.size
    n = n_theta + 2
    bends = n_theta - form.knots.size
    of_position = bends - 4 - form.loaded - 2 * form.early
    with_rows = rows.size > 0
    first = n - rows.shape[1]
    n_samples, steps = u.shape
    motion = np.zeros((2, n_samples))
    dv, dq, by, by_rest = np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n)
    force, slope = np.zeros(of_position), np.zeros(of_position)  # position-dependent, of unit weight
    inertia, viscous, offset = theta[0], theta[1], theta[3]
    growth = theta[4 + of_position] if form.loaded else 0.0
    lead, impedance = (theta[bends - 2], theta[bends - 1]) if form.early else (1.0, 0.0)
    h = dt / steps
    half, g = 0.5 * h, h / inertia
    stop, stop_by_lead = early_stop(lead, impedance, inertia, h)
    for piece in np.flatnonzero(chosen):
        v, q = start[piece, 0], start[piece, 1]
        dv[:], dq[:] = 0.0, 0.0
        dv[n_theta], dq[n_theta + 1] = 1.0, 1.0
        for t in range(bounds[piece], bounds[piece + 1]):
            motion[0, t], motion[1, t] = v, q
            if with_rows:
                for i in range(first, n):
                    rows[0, i - first, t], rows[1, i - first, t] = dv[i], dq[i]
            for j in range(steps):
                net, resisting, by_v, by_q = _torques(theta, form, u[t, j], q + half * v, v, force, slope)
                size = abs(u[t, j])
                dry = theta[2] + growth * size
                side, gain = (1.0 if v > 0.0 else -1.0), implicit_gain(by_v, inertia, h)
                friction = resisting + side * dry
                held = False
                if form.early:  # `early_friction`
                    wanted = impedance * (net + offset) + stop * v - offset
                    held = abs(wanted - resisting) < dry
                    side = 1.0 if wanted > resisting else -1.0
                    friction = wanted if held else resisting + side * dry
                kick = g * (net - friction) / gain
                new = v + kick
                if form.early or (v != 0.0 and side * new > 0.0):  # it moves on
                    if with_rows:
                        _by_numbers(by, form, v, side, kick, h, by_v * h / inertia, force, size)
                        if held:
                            _by_numbers_held(by, form, v, kick, h, net + offset, inertia, impedance, stop, stop_by_lead)
                            by_v, by_q = stop, (1.0 - impedance) * by_q
                        for i in range(first, n):
                            d = (-by_v * dv[i] - by_q * (dq[i] + half * dv[i]) + by[i]) * (g / gain)
                            dq[i] += half * (dv[i] + dv[i] + d)
                            dv[i] += d
                    q += half * (v + new)
                    v = new
                    continue
                # it stops within the step, or is at rest; friction holds it, or is overcome for the time that is left
                before = -h * v / kick if v != 0.0 else 0.0
                after = h - before
                goes, late = (1.0 if net > 0.0 else -1.0), implicit_gain(viscous, inertia, after)
                moves = abs(net) > dry and after > 0.0
                new = after * (net - goes * dry) / inertia / late if moves else 0.0
                if with_rows:
                    _by_numbers(by, form, v, side, kick, h, by_v * h / inertia, force, size)
                    _by_numbers(by_rest, form, 0.0, goes, new, after, viscous * after / inertia, force, size)
                    for i in range(first, n):
                        by_force, shift, d = -by_q * (dq[i] + half * dv[i]), 0.0, 0.0  # shift of the time before
                        if v != 0.0:
                            shift = -h / kick * (dv[i] + before / inertia / gain * (by_force - by_v * dv[i] + by[i]))
                        if moves:
                            d = (by_force + by_rest[i]) * (after / inertia / late) - shift * new / after / late
                            d += dv[i] if v == 0.0 else 0.0  # a piece may begin at rest
                        dq[i] += 0.5 * (shift * (v - new) + (before if v != 0.0 else after * moves) * dv[i] + after * d)
                        dv[i] = d
                q += 0.5 * (before * v + after * new)
                v = new
            if not abs(v) < 1e150:
                v = 0.0
        if ends.size > 0:
            ends[piece, 0], ends[piece, 1] = v, q
    return motion
