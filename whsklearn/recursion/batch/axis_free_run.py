"""Free run of a physical axis model, with exact sensitivities.

J dv/dt = u - o - k1 f1(e) - k2 f2(e) - B v - C sign(v) - sum w_k sign(v) max(|v| - knot_k, 0), e = q - centre,
where f1 and f2 are e and e^2, or sin e and cos e for a hanging body.  u is held between samples.
Viscous and dry friction are integrated implicitly (a proximal step), so standstill is exact: while the
drive cannot overcome the dry friction, v = 0 and all earlier errors are forgotten.
"""

from __future__ import annotations

import itertools
import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from whsklearn._numba import njit
from whsklearn.recursion.batch.levenberg_marquardt import descend

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

SUBSTEPS = 4
LARGEST = 1e100  # bound of an error or a sensitivity, so that its square stays finite


class AxisLog(NamedTuple):
    """Drive and motion of an axis, and the start of each piece; every piece has its own initial state.

    ``v0`` and ``q0`` are the initial states, ``knots`` (> 0) are the kinks of the friction over speed, and
    ``centre`` is the position where e = 0.  ``target`` is the velocity, or the position if ``of_position``.
    If the axis ``hangs``, the position forces are those of gravity.  theta holds inertia, viscous friction,
    Coulomb friction, offset, k1, k2 and one weight per knot.
    """

    u: Array
    target: Array
    counts: NDArray[np.bool_]
    bounds: NDArray[np.int64]
    v0: Array
    q0: Array
    dt: float
    knots: Array
    centre: float = 0.0
    of_position: bool = False
    hangs: bool = False


class AxisFit(NamedTuple):
    """theta, its covariance, the error on the samples that count, and the sum of squares of that error."""

    theta: Array
    covariance: Array
    error: Array
    cost: float


def free_run(theta: Array, log: AxisLog) -> Array:
    """Velocity or position, shape (n,), whichever the log has as its target."""
    velocity, position = _pass(theta, log, np.empty((0, 0, 0)))
    return position if log.of_position else velocity


def sensitivities(theta: Array, log: AxisLog) -> tuple[Array, Array]:
    """The run, shape (n,), and its derivatives, shape (p + 2, n).

    The last two derivatives are by v0 and q0 of the sample's piece.
    """
    rows = np.zeros((2, theta.size + 2, log.u.size))
    velocity, position = _pass(theta, log, rows)
    return (position, rows[1]) if log.of_position else (velocity, rows[0])


def fit_axis(
    theta: Array, log: AxisLog, free: NDArray[np.bool_], *, iterations: int = 40, prior: Array | None = None
) -> AxisFit:
    """Levenberg-Marquardt on the free-run error.

    Parameters
    ----------
    theta : ndarray of shape (p,)
        Initial parameters.
    log : AxisLog
        The record.
    free : ndarray of bool, shape (p,)
        Which parameters are fitted.
    iterations : int, default=40
        Largest number of iterations.
    prior : ndarray of shape (p,), optional
        Inverse variances, in units of the noise variance, of a prior centred on the initial theta.

    Returns
    -------
    AxisFit
        Its cost is infinite if the free run diverges.
    """
    weight = np.zeros(theta.size) if prior is None else prior
    begin = theta.copy()

    def run_of(trial: Array) -> _Run:
        error = (log.target - free_run(trial, log)) * log.counts
        return _Run(trial, log, error, _squares(error) + float(weight @ (trial - begin) ** 2))

    def equations(at: _Run) -> tuple[Array, Array] | None:
        moving = sensitivities(at.theta, log)[1][: theta.size][free] * log.counts
        if not _says_something(at.cost, moving):
            return None
        information = moving @ moving.T + np.diag(weight[free])
        return _regular(information), moving @ at.error - weight[free] * (at.theta - begin)[free]

    end = descend(
        run_of(theta), equations, lambda at, step: run_of(_stepped(at.theta, free, step)), iterations, enough=1e-8
    )
    rows = sensitivities(end.theta, log)[1][: theta.size] * log.counts
    if not _says_something(end.cost, rows[free]):
        return AxisFit(end.theta, np.full((theta.size, theta.size), np.inf), end.error, np.inf)
    return AxisFit(end.theta, _covariance(rows, end.error, free), end.error, float(end.error @ end.error))


class _Run(NamedTuple):
    """Parameters, the log with the states of its pieces, the error of the run, and what is lowered."""

    theta: Array
    log: AxisLog
    error: Array
    cost: float


def _says_something(cost: float, rows: Array) -> bool:
    """Whether a run and its sensitivities are finite."""
    return bool(np.isfinite(cost) and np.abs(rows).max(initial=0.0) < LARGEST)


def _regular(information: Array) -> Array:
    """Normal equations whose diagonal is above zero."""
    information[np.diag_indices_from(information)] += 1e-300
    return information


def _stepped(theta: Array, free: NDArray[np.bool_], step: Array) -> Array:
    """theta after a step: the inertia keeps a twentieth, and friction only dissipates."""
    trial = theta.copy()
    trial[free] += step
    trial[0] = max(trial[0], 0.05 * theta[0])
    trial[1:3] = np.maximum(trial[1:3], 0.0)
    return trial


def settled(theta: Array, log: AxisLog, passes: int = 8) -> AxisLog:
    """The log with the states of its pieces that these parameters ask for."""
    v0, q0 = fit_state(theta, log, passes)
    return log._replace(v0=v0, q0=q0)


def fit_pieces(theta: Array, log: AxisLog, free: NDArray[np.bool_], *, iterations: int = 25) -> AxisFit:
    """Multiple shooting: theta, and v0 and q0 of every piece, by Levenberg-Marquardt on the errors of all pieces.

    The states are eliminated: what they can explain of the sensitivities and of the error does not count for theta
    (variable projection, Golub and Pereyra 1973).  Where gravity makes a free run unstable its error grows by e in
    sqrt(J / G); a piece of a few times that still says something, a run of the whole record does not (Bock 1981).

    Parameters
    ----------
    theta : ndarray of shape (p,)
        Start.
    log : AxisLog
        The record in pieces.
    free : ndarray of bool, shape (p,)
        Which parameters move.
    iterations : int, default=25
        At most so many.

    Returns
    -------
    AxisFit
        Of infinite cost where the run runs away, and says nothing.
    """

    def run_of(trial: Array, before: AxisLog) -> _Run:
        there = settled(trial, before)
        error = there.target - free_run(trial, there)
        return _Run(trial, there, error, _squares(error))

    def equations(at: _Run) -> tuple[Array, Array] | None:
        rows = sensitivities(at.theta, at.log)[1]
        if not _says_something(at.cost, rows):
            return None
        moving = beside_the_states(rows, at.log)[free]
        return _regular(moving @ moving.T), moving @ at.error

    def moved(at: _Run, step: Array) -> _Run:
        return run_of(_stepped(at.theta, free, step), at.log)

    end = descend(run_of(theta, log), equations, moved, iterations, enough=1e-6)
    rows = sensitivities(end.theta, end.log)[1]
    if not _says_something(end.cost, rows):
        return AxisFit(end.theta, np.full((theta.size, theta.size), np.inf), end.error, np.inf)
    return AxisFit(end.theta, _covariance(beside_the_states(rows, end.log), end.error, free), end.error, end.cost)


def beside_the_states(rows: Array, log: AxisLog) -> Array:
    """Sensitivities by theta, (p, n), without what another v0 and q0 of the piece would do to its samples that count.

    Samples that do not count follow: their rows are of a run whose state is fitted to those that do.
    """
    out = rows[:-2].copy()
    if not np.abs(rows).max(initial=0.0) < LARGEST:  # the run is lost, and so are they
        return out
    for s, e in itertools.pairwise(log.bounds):
        seen, by_state = log.counts[s:e], rows[-2:, s:e]
        follows = np.linalg.lstsq(by_state[:, seen].T, out[:, s:e][:, seen].T, rcond=1e-9)[0]
        out[:, s:e] -= follows.T @ by_state
    return out


def _squares(error: Array) -> float:
    """Sum of squares; infinite if the run has diverged."""
    return float(error @ error) if np.abs(error).max(initial=0.0) < LARGEST else np.inf


def fit_state(theta: Array, log: AxisLog, passes: int = 8) -> tuple[Array, Array]:
    """Fit v0 and q0 of every piece to the samples that count, by Gauss-Newton.

    Replaying the drive over the 300 ms before a moment gives the state there to within 2.75e-4 rad after 2 s; a
    causal quadratic gives 1.9e-3 (library servo).  A step across standstill can be too long, so it is shortened: a
    single one of 24 windows that ended on the wrong side caused all of the error by which structures are compared.
    """
    state = np.column_stack([log.v0, log.q0])
    trial, step, best = state.copy(), np.zeros_like(state), np.full(len(state), np.inf)
    for _ in range(passes):
        run, rows = sensitivities(theta, log._replace(v0=trial[:, 0], q0=trial[:, 1]))
        left = log.target - run
        for e, (s, t) in enumerate(itertools.pairwise(log.bounds)):
            keep = log.counts[s:t]
            cost = _squares(left[s:t][keep])
            if cost < best[e] and np.abs(rows[-2:, s:t]).max() < LARGEST:
                best[e], state[e] = cost, trial[e]
                step[e] = np.linalg.lstsq(rows[-2:, s:t][:, keep].T, left[s:t][keep], rcond=1e-9)[0]
            else:
                step[e] /= 4.0
        trial = state + step
    return state[:, 0].copy(), state[:, 1].copy()


def _covariance(rows: Array, error: Array, free: NDArray[np.bool_], batches: int = 60) -> Array:
    """Covariance from sums of the scores over batches, as in the simulation-error fit; the error is seldom white."""
    scale = np.where(free, np.maximum(np.linalg.norm(rows, axis=1), 1e-150), 1.0)
    unit = rows * (free / scale)[:, None]
    inverse = np.linalg.pinv(unit @ unit.T, rcond=1e-12, hermitian=True)
    edges = np.linspace(0, error.size, min(batches, error.size) + 1).astype(int)[:-1]
    scores = np.add.reduceat(unit * error, edges, axis=1)
    return (inverse @ (scores @ scores.T) @ inverse) / np.outer(scale, scale)


def _pass(theta: Array, log: AxisLog, rows: Array) -> Array:
    start = np.column_stack([log.v0, log.q0])
    motion: Array = axis_pass(theta, log.knots, log.centre, log.hangs, log.u, log.bounds, start, log.dt, rows)
    return motion


@njit(cache=True, error_model="numpy")
def axis_pass(theta, knots, centre, hangs, u, bounds, start, dt, rows):
    """Return velocity and position, (2, n); write the derivatives into rows (2, p + 2, n) unless it is empty."""
    n_theta = 6 + knots.size
    n = n_theta + 2
    with_rows = rows.size > 0
    motion = np.zeros((2, u.size))
    dv = np.zeros(n)
    dq = np.zeros(n)
    inertia, viscous, coulomb, offset, k1, k2 = theta[0], theta[1], theta[2], theta[3], theta[4], theta[5]
    h = dt / SUBSTEPS
    g = h / inertia
    stick = g * coulomb
    divisor = 1.0 + g * viscous
    for piece in range(bounds.size - 1):
        v = start[piece, 0]
        q = start[piece, 1]
        dv[:] = 0.0
        dq[:] = 0.0
        dv[n_theta] = 1.0
        dq[n_theta + 1] = 1.0
        for t in range(bounds[piece], bounds[piece + 1]):
            motion[0, t] = v
            motion[1, t] = q
            if with_rows:
                for i in range(n):
                    rows[0, i, t] = dv[i]
                    rows[1, i, t] = dq[i]
            for _ in range(SUBSTEPS):
                e = q - centre
                f1 = math.sin(e) if hangs else e
                f2 = math.cos(e) if hangs else e * e
                force = u[t] - offset - k1 * f1 - k2 * f2
                slope_v = 0.0
                side = 1.0 if v > 0.0 else -1.0
                for k in range(knots.size):
                    if abs(v) > knots[k]:
                        force -= theta[6 + k] * (v - side * knots[k])
                        slope_v -= theta[6 + k]
                z = v + g * force
                if abs(z) <= stick:
                    if with_rows:
                        dv[:] = 0.0
                    v = 0.0
                    continue
                s = 1.0 if z > 0.0 else -1.0
                new = (z - s * stick) / divisor
                if with_rows:
                    slope_q = -k1 * f2 + k2 * f1 if hangs else -k1 - 2.0 * k2 * e
                    for i in range(n):
                        d = dv[i] + g * (slope_v * dv[i] + slope_q * dq[i])
                        if i == 0:
                            d += (-g * force + s * stick + new * g * viscous) / inertia
                        elif i == 1:
                            d -= new * g
                        elif i == 2:
                            d -= s * g
                        elif i == 3:
                            d -= g
                        elif i == 4:
                            d -= g * f1
                        elif i == 5:
                            d -= g * f2
                        elif i < n_theta and abs(v) > knots[i - 6]:
                            d -= g * (v - side * knots[i - 6])
                        dv[i] = d / divisor
                        dq[i] += h * dv[i]
                v = new
                q += h * v
            if not abs(v) < 1e150:
                v = 0.0
    return motion
