"""Free run of a physical axis model, with exact sensitivities.

J dv/dt = u - o - p(q) - B v - C sign(v) - sum w_k sign(v) max(|v| - knot_k, 0), where p(q) is the load of gravity,
w_1 sin e + w_2 cos e, or of a spring, w_1 e + w_2 e^2 + w_3 e^3, with e = q - centre.

The steps are those of `whsklearn.systems._servo_kernel`: half a drift, a kick, half a drift (second order), linearly
implicit in the velocity.  Dry friction is a proximal step, so standstill is exact: while the drive cannot overcome it,
v = 0 and all earlier errors are forgotten.  It has its own kernel for speed: with 8 parameters, 25,000 samples with all
sensitivities take 2.6 ms.  Finite differences with the servo's kernel, which has every effect, take 100 ms. Two masses
have their own loop, `whsklearn.recursion.batch.coupled_run`.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from whsklearn._numba import njit, part
from whsklearn.effects import FlexibleCoupling, LoadSideViscous
from whsklearn.effects.base import Array, Bools, Integers
from whsklearn.effects.equations import speed_hinge
from whsklearn.effects.transmission import contact_stiffness
from whsklearn.recursion.batch.best_linear import descend
from whsklearn.recursion.batch.coupled_run import STATES, bodies_of, coupled_pass, slopes_of
from whsklearn.systems._servo_kernel import implicit_gain

SETTLED = 1e-9  # relative decrease in cost that at least one state must still reach for the search to continue
SHARE_AND_DAMPING = ((0.02, 0.003), (0.98, 1.0))  # lower and upper bounds of a coupling's load share and damping ratio
LARGEST = 1e100  # bound of an error or a sensitivity, so that its square stays finite
UNSEEN = 1e-12  # of the largest eigenvalue of the information, columns at unit length: smaller ones are rounding

_WITHOUT_ROWS, _NOWHERE = np.empty((0, 0, 0)), np.empty((0, 0))


class AxisForm(NamedTuple):
    """Which forces act in addition to inertia, viscous and dry friction and an offset.

    ``knots`` (> 0) are the speeds at which the slope of the friction changes.  The position-dependent forces are those
    of gravity if the axis ``hangs``, otherwise those of a spring with this number of ``powers`` of e (0: none).  theta
    holds inertia, viscous friction, Coulomb friction, offset, one weight per position-dependent force, and one per
    knot.  If the axis is ``coupled``, it has a load behind a spring, and theta ends with viscous and Coulomb friction
    of the load, resonance, load share and damping ratio; then only friction acts in addition, and the output is the
    motion of the motor or, ``at_load``, of the load.
    """

    knots: Array = np.empty(0)
    hangs: bool = False
    powers: int = 0
    centre: float = 0.0
    coupled: bool = False
    at_load: bool = False

    @property
    def states(self) -> int:
        """Size of the state of a piece: velocity and position, and twist and slip of a coupling."""
        return 4 if self.coupled else 2

    @property
    def of_position(self) -> int:
        """Number of position-dependent forces."""
        return 2 if self.hangs else self.powers

    @property
    def size(self) -> int:
        """Number of parameters."""
        return 4 + self.of_position + self.knots.size + 5 * self.coupled


class AxisLog(NamedTuple):
    """Drive and motion of an axis, and the start of each piece; every piece has its own initial state.

    ``u`` is the drive in every fine step, shape (n, steps). ``v0`` and ``q0`` are the initial states.  ``target`` is
    the velocity, or the position if ``of_position``.  ``twist`` (k, 2) holds the twist of a coupling and its rate.
    """

    u: Array
    target: Array
    counts: Bools
    bounds: Integers
    v0: Array
    q0: Array
    dt: float
    form: AxisForm = AxisForm()
    of_position: bool = False
    twist: Array | None = None

    @property
    def states(self) -> Array:
        """Velocity, position and, for a coupling, twist and slip at the start of each piece, shape (k, 2 or 4)."""
        own = np.column_stack([self.v0, self.q0])
        if not self.form.coupled:
            return own
        return np.hstack([own, np.zeros_like(own) if self.twist is None else self.twist])

    def starting(self, states: Array) -> AxisLog:
        """The log with other initial states."""
        return self._replace(v0=states[:, 0].copy(), q0=states[:, 1].copy(), twist=states[:, 2:])


class AxisFit(NamedTuple):
    """theta, its covariance, the error on the samples that count, and the sum of squares of that error."""

    theta: Array
    covariance: Array
    error: Array
    cost: float


def axis_motion(theta: Array, log: AxisLog) -> Array:
    """Velocity or position, whichever is the target of the log; shape (n,)."""
    velocity, position = _pass(theta, log, _WITHOUT_ROWS)
    return position if log.of_position else velocity


def sensitivities(theta: Array, log: AxisLog, *, of_states: bool = False) -> tuple[Array, Array]:
    """The run, shape (n,), and its derivatives, shape (p + 2, n).

    The last two derivatives are with respect to v0 and q0 of the sample's piece.  With a coupling there are four, one
    per state.  With ``of_states`` there are only these.
    """
    states = log.form.states
    rows = np.zeros((2, states + theta.size * (not of_states), log.target.size))
    run, by = _pass(theta, log, rows)[int(log.of_position)], rows[int(log.of_position)]
    if log.form.coupled and len(by) > states:
        by[:-states] = slopes_of(theta) @ by[:-states]
    return run, by


class _Run(NamedTuple):
    """Parameters, the log with the states of its pieces, the error of the run, and the cost to minimise."""

    theta: Array
    log: AxisLog
    error: Array
    cost: float


def _says_something(cost: float, rows: Array) -> bool:
    """Whether a run and its sensitivities are finite."""
    return bool(np.isfinite(cost) and np.abs(rows).max(initial=0.0) < LARGEST)


def _stepped(theta: Array, step: Array, form: AxisForm) -> Array | None:
    """theta after a step: inertia keeps at least a twentieth, a resonance half; None if friction would drive the axis.

    Only a law with knots may fall from standstill, as Stribeck's does.
    """
    trial = rising_at_last(theta + step, form.knots)
    if form.coupled:
        trial[-3] = np.clip(trial[-3], 0.5 * theta[-3], 2.0 * theta[-3])
        trial[-2:] = np.clip(trial[-2:], *SHARE_AND_DAMPING)
        trial[4:6] = np.maximum(trial[4:6], 0.0)
    trial[0] = max(trial[0], 0.05 * theta[0])
    trial[2] = max(trial[2], 0.0)
    if not form.knots.size:
        trial[1] = max(trial[1], 0.0)
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
    return log.starting(fit_state(theta, log, passes))


def handed_over(theta: Array, log: AxisLog) -> AxisLog:
    """The log of a coupled axis; each piece begins with the state at the end of the one before, if that fits better.

    The twist is not measured, and with dry friction on either side its fit has several minima. The first piece may
    begin at rest.
    """
    if not log.form.coupled:
        return log
    for _ in range(HANDED):
        begins, ends = log.bounds[:-1], np.empty((log.bounds.size - 1, STATES))
        motion = coupled_pass(
            bodies_of(theta), log.form.at_load, log.u, log.bounds, log.states, log.dt, _WITHOUT_ROWS, ends
        )
        states = np.vstack([[0.0, log.target[0] if log.of_position else 0.0, 0.0, 0.0], ends[:-1]])
        other = log.starting(states)
        costs = [np.add.reduceat(((log.target - run) * log.counts) ** 2, begins)
                 for run in (motion[int(log.of_position)], axis_motion(theta, other))]  # fmt: skip
        better = costs[1] < costs[0]
        if not better.any():
            break
        log = settled(theta, log.starting(np.where(better[:, None], states, log.states)), SETTLING)
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

    def run_of(trial: Array, before: AxisLog) -> _Run:
        there = handed_over(trial, settled(trial, before, SETTLING))
        error = there.target - axis_motion(trial, there)
        return _Run(trial, there, error, _squares(error))

    def rows_of(at: _Run) -> Array:
        return beside_the_states(sensitivities(at.theta, at.log)[1], at.log)

    return _fitted(theta, log, run_of, rows_of, iterations, enough)


def _fitted(
    theta: Array,
    log: AxisLog,
    run_of: Callable[[Array, AxisLog], _Run],
    rows_of: Callable[[_Run], Array],
    iterations: int,
    enough: float,
) -> AxisFit:
    """Fit from theta, given functions for a run and for the sensitivities (p, n) of its errors."""

    def equations(at: _Run) -> tuple[Array, Array] | None:
        rows = rows_of(at)
        if not _says_something(at.cost, rows):
            return None
        slope = rows @ at.error
        # friction at its limit stays there: on an axis that turns one way an offset has the same effect, and of a step
        # that they share, the half that friction cannot take would be missing
        stays = np.zeros(slope.size, dtype=bool)
        stays[1:3] = (at.theta[1:3] <= 0.0) & (slope[1:3] < 0.0) & np.array([not log.form.knots.size, True])
        rows = np.where(stays[:, None], 0.0, rows)
        return rows @ rows.T + 1e-300 * np.eye(len(rows)), np.where(stays, 0.0, slope)  # the diagonal is positive

    def moved(at: _Run, step: Array) -> _Run | None:
        trial = _stepped(at.theta, step, log.form)
        return None if trial is None else run_of(trial, at.log)

    end = descend(run_of(theta, log), equations, moved, iterations, enough=enough)
    rows = rows_of(end)
    if not _says_something(end.cost, rows):
        return AxisFit(end.theta, np.full((theta.size, theta.size), np.inf), end.error, np.inf)
    return AxisFit(end.theta, _covariance(rows, end.error, end.theta), end.error, end.cost)


def beside_the_states(rows: Array, log: AxisLog) -> Array:
    """Sensitivities to theta, (p, n), without the part that v0 and q0 of each piece explain at the samples that count.

    The other samples follow: their rows are those of a run whose state is fitted to the samples that count.
    """
    n = log.form.states
    out = rows[:-n].copy()
    if not np.abs(rows).max(initial=0.0) < LARGEST:  # the run has diverged, and so have they
        return out
    for s, e in itertools.pairwise(log.bounds):
        seen, by_state = log.counts[s:e], rows[-n:, s:e]
        follows = np.linalg.lstsq(by_state[:, seen].T, out[:, s:e][:, seen].T, rcond=1e-9)[0]
        out[:, s:e] -= follows.T @ by_state
    return out


def _squares(error: Array) -> float:
    """Sum of squares; infinite if the run has diverged."""
    return float(error @ error) if np.abs(error).max(initial=0.0) < LARGEST else np.inf


def fit_state(theta: Array, log: AxisLog, passes: int = 8) -> Array:
    """Fit the state of every piece to the samples that count, by Gauss-Newton.

    Replaying the drive over the 300 ms before an instant gives its state to within 2.75e-4 rad after 2 s; a
    causal quadratic gives 1.9e-3 (library servo).  A step across standstill can be too long, so it is shortened: once,
    a single one of 24 windows that ended on the wrong side caused all of the error by which structures are compared.
    """
    state, n = log.states, log.form.states
    trial, step, best = state.copy(), np.zeros_like(state), np.full(len(state), np.inf)
    for _ in range(passes):
        before = best.copy()
        run, rows = sensitivities(theta, log.starting(trial), of_states=True)
        left = log.target - run
        for e, (s, t) in enumerate(itertools.pairwise(log.bounds)):
            keep = log.counts[s:t]
            cost = _squares(left[s:t][keep])
            if cost < best[e] and np.abs(rows[-n:, s:t]).max() < LARGEST:
                best[e], state[e] = cost, trial[e]
                step[e] = np.linalg.lstsq(rows[-n:, s:t][:, keep].T, left[s:t][keep], rcond=1e-9)[0]
            else:
                step[e] /= 4.0
        if not (best < (1.0 - SETTLED) * before).any():
            break
        trial = state + step
    return state


def _covariance(rows: Array, error: Array, theta: Array, batches: int = 60) -> Array:
    """Covariance from sums of the scores over batches, as in the simulation-error fit; the error is seldom white.

    Along a direction that no sample shows, numbers may exchange all that they contribute: if an axis turns one way
    only, just the sum of Coulomb friction and offset is known.  A pseudoinverse alone would call each of them certain.
    """
    scale = np.maximum(np.linalg.norm(rows, axis=1), 1e-150)
    unit = rows / scale[:, None]
    values, axes = np.linalg.eigh(unit @ unit.T)
    seen = values > UNSEEN * values[-1]
    inverse = (axes[:, seen] / values[seen]) @ axes[:, seen].T
    edges = np.linspace(0, error.size, min(batches, error.size) + 1).astype(int)[:-1]
    scores = np.add.reduceat(unit * error, edges, axis=1)
    hidden = axes[:, ~seen] * (np.abs(theta * scale) @ np.abs(axes[:, ~seen]))
    return (inverse @ (scores @ scores.T) @ inverse + hidden @ hidden.T) / np.outer(scale, scale)


def behind_the_spring(theta: Array) -> tuple[FlexibleCoupling, LoadSideViscous]:
    """The coupling from theta (inertia, resonance in Hz, load share, damping ratio), with the load's friction."""
    frequency, share, ratio = theta[-3:].tolist()
    reduced = float(theta[0]) * share * (1.0 - share)
    coupling = FlexibleCoupling(1.0 / contact_stiffness(frequency, reduced), share, ratio, float(theta[5]))
    return coupling, LoadSideViscous(float(theta[4]))


def _pass(theta: Array, log: AxisLog, rows: Array) -> Array:
    form = log.form
    if form.coupled:
        motion: Array = coupled_pass(
            bodies_of(theta), form.at_load, log.u, log.bounds, log.states, log.dt, rows, _NOWHERE
        )
    else:
        motion = axis_pass(theta, form, log.u, log.bounds, log.states, log.dt, rows)
    return motion


@part
def _of_position(e, hangs, force, slope):
    """Position-dependent forces of unit weight and their slopes, at ``e`` from the centre: pendulum or powers of e."""
    if hangs:
        force[0], force[1] = math.sin(e), math.cos(e)
        slope[0], slope[1] = force[1], -force[0]
        return
    power = 1.0
    for k in range(force.size):
        slope[k] = (k + 1.0) * power
        power *= e
        force[k] = power


@part
def _by_numbers(by, form, v, s, kick, h, by_gain, force):
    """Slopes ``by`` of a step's acceleration by each number of theta, after a kick; those by the state stay zero."""
    places = 4 + force.size
    by[0], by[1], by[2], by[3] = -kick / h, by_gain - v, -s, -1.0
    for k in range(force.size):
        by[4 + k] = -force[k]
    for k in range(form.knots.size):
        bent, _, tilt = speed_hinge(form.knots[k], v)
        by[places + k] = by_gain * tilt - bent


@njit(cache=True, error_model="numpy")
def axis_pass(theta, form, u, bounds, start, dt, rows):
    """Return velocity and position, (2, n); write the derivatives into rows (2, p + 2, n) unless it is empty.

    With rows of (2, 2, n) they are those with respect to the state at the start of the piece alone.
    One loop: motion and sensitivities of a step share its forces and their slopes, which are computed once.
    """
    n_theta = theta.size
    n = n_theta + 2
    knots = form.knots
    of_position = n_theta - 4 - knots.size
    with_rows = rows.size > 0
    first = n - rows.shape[1]
    n_samples, steps = u.shape
    motion = np.zeros((2, n_samples))
    dv, dq, by = np.zeros(n), np.zeros(n), np.zeros(n)
    force, slope = np.zeros(of_position), np.zeros(of_position)  # position-dependent, of unit weight
    inertia, viscous, coulomb, offset = theta[0], theta[1], theta[2], theta[3]
    h = dt / steps
    half, g = 0.5 * h, h / inertia
    for piece in range(bounds.size - 1):
        v, q = start[piece, 0], start[piece, 1]
        dv[:], dq[:] = 0.0, 0.0
        dv[n_theta], dq[n_theta + 1] = 1.0, 1.0
        for t in range(bounds[piece], bounds[piece + 1]):
            motion[0, t], motion[1, t] = v, q
            if with_rows:
                for i in range(first, n):
                    rows[0, i - first, t], rows[1, i - first, t] = dv[i], dq[i]
            for j in range(steps):
                _of_position(q + half * v - form.centre, form.hangs, force, slope)
                pull = u[t, j] - offset - viscous * v
                by_v, by_q = viscous, 0.0  # slopes of the resisting forces
                for k in range(of_position):
                    pull -= theta[4 + k] * force[k]
                    by_q += theta[4 + k] * slope[k]
                for k in range(knots.size):
                    bent, _, tilt = speed_hinge(knots[k], v)
                    pull -= theta[4 + of_position + k] * bent
                    by_v += theta[4 + of_position + k] * tilt
                gain = implicit_gain(by_v, inertia, h)
                z = v + g * pull / gain
                stick = g * coulomb / gain
                if abs(z) <= stick:  # it sticks, and the velocity's sensitivities are reset
                    q += half * v
                    v = 0.0
                    if with_rows:
                        for i in range(first, n):
                            dq[i] += half * dv[i]
                            dv[i] = 0.0
                    continue
                s = 1.0 if z > 0.0 else -1.0
                new = z - s * stick
                if with_rows:
                    kick = new - v
                    by_gain = -kick * (0.5 if h * by_v / inertia < 0.5 else 1.0)  # effect of a slope through the gain
                    _by_numbers(by, form, v, s, kick, h, by_gain, force)
                    for i in range(first, n):
                        d = (-by_v * dv[i] - by_q * (dq[i] + half * dv[i]) + by[i]) * (g / gain)
                        dq[i] += half * (dv[i] + dv[i] + d)
                        dv[i] += d
                q += half * (v + new)
                v = new
            if not abs(v) < 1e150:
                v = 0.0
    return motion
