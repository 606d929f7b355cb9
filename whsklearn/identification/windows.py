"""Free runs over windows: a model replays the drive, its state fitted on the samples before each window."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from whsklearn.effects.base import Array
from whsklearn.identification.axis_numbers import axis_residual, axis_theta
from whsklearn.identification.view import View, smooth
from whsklearn.models import AxisModel, ChainModel, LinearModel
from whsklearn.recursion.batch.axis_free_run import LARGEST, AxisForm, AxisLog, axis_motion, fit_state
from whsklearn.recursion.batch.simulation_search import SKIP

SECONDS = (0.1, 0.5, 2.0, 5.0)
LEAD = 0.3  # s before a window over which its state is fitted
MOST = 24  # windows of a length
# Times the median error over the leads: a state fit that leaves more is in a wrong minimum, and begins anew, as do
# those of a few windows, whose median says nothing
LOST, FEW = 3.0, 3
SPEEDS = 9  # that are tried then; a run over the samples of a lead takes microseconds
# Of the fit of a first block's state, which settles in fewer where the chain follows the record; where it does not, 300
# of them took three quarters of all time (a wrist of an AIRBOT)
FEW_STEPS = 20
PULL = 1e-3  # prior weight of an unchanged state, relative to the output, for what the samples before do not determine


def horizons(n: int, dt: float) -> list[int]:
    """Lengths of windows in samples: tenths of seconds to seconds if that suits the record, otherwise by its length."""
    fit = [h for h in (round(s / dt) for s in SECONDS) if 5 <= h <= n // 4]
    return fit if len(fit) > 1 else sorted({int(h) for h in np.geomspace(10, max(n // 4, 11), 3)})


def lead(n: int, dt: float) -> int:
    """Samples over which a state is fitted, at most half of a short record."""
    return min(int(np.clip(round(LEAD / dt), 30, max(n // 10, 30))), n // 2)


def window_errors(model: Any, log: View, horizon: int, before: int) -> Array:
    """Output minus prediction over windows, (windows, horizon); infinite if the model diverges."""
    begins = _begins(log, horizon, before)
    if model is None:
        return np.array([_steady(log, s, horizon, before) for s in begins])
    if isinstance(model, AxisModel):
        theta, form = axis_theta(model)
        logged = replace(log.in_si, logged=model.logged, steps=model.steps, hold=model.hold)
        return errors_from(theta, form, logged, begins, horizon, before) / log.si[1]  # in the record's unit
    return _response_errors(model, log, begins, horizon, before)


def _begins(log: View, horizon: int, before: int) -> NDArray[np.int64]:
    """Starts of the windows of a length, spread over the segments that are long enough."""
    spans = [(a + before, b - horizon) for a, b in itertools.pairwise(log.bounds.tolist()) if b - a >= before + horizon]
    count = int(np.clip(sum((b - a) // horizon + 1 for a, b in spans), 1, MOST))
    possible = np.concatenate([np.arange(a, b + 1) for a, b in spans])
    return possible[np.linspace(0, possible.size - 1, count).astype(int)]


def whole_errors(model: Any, log: View, before: int) -> tuple[Array, Array]:
    """Output minus prediction over all of each segment after its lead, and the output there."""
    parts = [log.part(a, b) for a, b in itertools.pairwise(log.bounds.tolist()) if b - a > 2 * before]
    parts = parts or [log.longest]
    errors = [window_errors(model, p, p.y.size - before, before)[0] for p in parts]
    return np.concatenate(errors), np.concatenate([p.y[before:] for p in parts])


def _steady(log: View, start: int, horizon: int, before: int) -> Array:
    """The trivial model: the output stays constant, a position continues at constant velocity."""
    past = log.y[start - before : start]
    if log.logged != "position":
        # for a white output the mean is the better constant, for a slow one the last value
        return log.y[start : start + horizon] - (past[-1] if smooth(log.y) else past.mean())
    m = min(before, 30)
    slope, level = np.polyfit(np.arange(-m, 0), past[-m:], 1)
    return log.y[start : start + horizon] - (level + slope * np.arange(horizon))


def errors_from(theta: Array, form: AxisForm, log: View, begins: NDArray[np.int64], horizon: int, before: int) -> Array:
    """State by Gauss-Newton over the lead, then the run on from there; (windows, horizon)."""
    position = log.logged == "position"
    lead_at, whole_at = ((begins[:, None] - before + np.arange(n)) for n in (before, before + horizon))
    first = log.y[lead_at]
    over = min(before - 1, 9)
    slope = (first[:, over] - first[:, 0]) / (over * log.dt) if position else first[:, 0].copy()

    def pieces(at: NDArray[np.int64], speed: Array) -> AxisLog:
        flat, bounds = at.ravel(), np.arange(len(at) + 1) * at.shape[1]
        return AxisLog(
            log.drive[flat], log.y[flat], np.ones(flat.size, dtype=bool), bounds,
            np.column_stack([speed, log.y[at[:, 0]]]), log.dt, form, of_position=position,
        )  # fmt: skip

    def run(at: NDArray[np.int64], states: Array) -> Array:
        return axis_motion(theta, pieces(at, states[:, 0])._replace(start=states)).reshape(at.shape)

    states = fit_state(theta, pieces(lead_at, slope))
    if position:
        left = powers(first - run(lead_at, states))
        lost = ~(left <= LOST**2 * np.median(left)) | (len(left) < FEW)
        if lost.any():
            at, seen = lead_at[lost], first[lost]
            speed = _first_speeds(seen, log.dt, lambda v: axis_motion(theta, pieces(at, v)).reshape(at.shape))
            again = fit_state(theta, pieces(at, speed))
            closer = powers(seen - run(at, again)) < left[lost]
            states[lost] = np.where(closer[:, None], again, states[lost])
    return (log.y[whole_at] - run(whole_at, states))[:, before:]


def powers(errors: Array, *, level: bool = False) -> Array:
    """Mean square of each row, about its ``level`` or zero; infinite if it diverges."""
    bounded = np.abs(errors).max(axis=1) < LARGEST
    rows = np.where(bounded[:, None], errors, 0.0)
    return np.where(bounded, np.mean((rows - level * rows.mean(axis=1, keepdims=True)) ** 2, axis=1), np.inf)


def _first_speeds(y: Array, dt: float, run: Callable[[Array], Array]) -> Array:
    """Speeds at the first of the samples (k, m) from which a state fit starts: those whose ``run`` is the closest.

    They are tried from that of a line to beyond that of a parabola, and at rest, then once more around the best.  Where
    an axis turns or sticks, nothing depends on the speed before, and a state fit from its wrong side stays there: so
    ended 9 to 17 % of the windows of an axis at its true numbers (tests/identification/test_windows.py).  In ten
    samples a coarse encoder does not move, so lines and parabolas through more of them are tried too.
    """
    few, m = min(y.shape[1], 10), y.shape[1]
    lines, slopes = [], []
    for span in sorted({few, max(m // 3, few), m}):
        at = np.arange(span) * dt
        lines.append((y[:, span - 1] - y[:, 0]) / at[-1])
        slopes.append(y[:, :span] @ np.linalg.pinv(np.vander(at, 3))[1])
    line, apart = np.array(lines), np.array(slopes) - np.array(lines)  # (spans, k)

    def closest(tried: Array) -> Array:
        left = np.array([powers(y - run(v), level=True) for v in tried])  # the position is fitted too
        return np.take_along_axis(tried, np.argmin(left, axis=0)[None], axis=0)[0]

    beyond = line + np.linspace(0.0, 2.0, SPEEDS)[:, None, None] * apart
    best = closest(np.vstack([beyond.reshape(-1, len(y)), np.zeros(len(y))]))
    near = 2.0 * np.abs(apart).max(axis=0) / (SPEEDS - 1)
    return closest(best + np.linspace(-0.75, 0.75, SPEEDS)[:, None] * near)


def axis_score(theta: Array, form: AxisForm, log: View) -> float:
    """Geometric mean of the errors over windows of all lengths, for a record in SI."""
    longest = log.longest.u.size
    before = lead(longest, log.dt)
    rms = [
        rms_of(errors_from(theta, form, log, _begins(log, h, before), h, before))
        for h in horizons(longest - before, log.dt)
    ]
    return mean_error(rms, log, 1e-6 * float(np.std(log.y)))


def mean_error(rms: list[float], log: View, least: float) -> float:
    """Geometric mean of errors, none below ``least``.

    A run with an error above the deviation of the output from its mean is lost, and the size of the error carries no
    information: if gravity makes a position unstable, a window of 5 s is lost with any model, and the shorter ones
    decide.
    """
    spread = float(np.std(log.y))
    return float(np.exp(np.mean(np.log([min(max(e, least), spread) for e in rms]))))


def rms_of(error: Array) -> float:
    """Root mean square; infinite if the run is."""
    return float(np.sqrt(np.mean(np.square(error)))) if np.abs(error).max() < LARGEST else np.inf


def residual(model: Any, log: View) -> Array:
    """Residual of a model in the signal that it was fitted to, in SI."""
    si = log.in_si
    if isinstance(model, AxisModel):
        theta, form = axis_theta(model)
        as_run = replace(si, logged=model.logged, steps=model.steps, hold=model.hold)
        return axis_residual(theta, as_run, form)
    plain = replace(model, logged="output", units={})
    known = si.target if model.logged == "position" else si.y
    pieces = [known[a:b] - plain.simulate(si.u[a:b]) for a, b in itertools.pairwise(si.bounds)]
    return np.concatenate([e[min(SKIP, e.size // 10) :] for e in pieces])


def _response_errors(
    model: LinearModel | ChainModel, log: View, begins: NDArray[np.int64], horizon: int, before: int
) -> Array:
    """The run from the start of the record, corrected before each window by the decaying effect of another state."""
    from scipy.signal import lfilter

    denominator = np.array(model.denominator if isinstance(model, LinearModel) else model.f2)
    span = before + horizon
    order = denominator.size - 1
    response = lfilter([1.0], denominator, np.r_[1.0, np.zeros(span + order)])
    columns = [response[k : k + span] for k in range(order)]
    if model.logged == "position":
        columns = [np.cumsum(c) for c in columns] + [np.ones(span)]
    if not columns:
        columns = [np.zeros(span)]
    basis = np.column_stack(columns)
    basis /= np.maximum(np.abs(basis).max(axis=0), 1e-300)
    residual = log.y - model.simulate(log.u)
    out = np.empty((begins.size, horizon))
    for i, s in enumerate(begins):
        piece = residual[s - before : s + horizon]
        since = s - before - log.bounds[np.searchsorted(log.bounds, s, "right") - 1]
        if isinstance(model, ChainModel) and since < _fades(model):
            piece = piece - _first_block_moved(model, log, s - before, before, span, basis)
        # what went into a dead time before the record began is not known
        blind = min(max(model.delay - since, 0), before // 2) if isinstance(model, LinearModel) else 0
        left = np.linalg.lstsq(basis[blind:before], piece[blind:before], rcond=1e-6)[0]
        out[i] = piece[before:] - basis[before:] @ left
    return out


def _fades(model: ChainModel) -> int:
    """Samples after which the initial state of the first block has decayed to 1 %."""
    slowest = float(np.abs(np.roots(model.f1)).max(initial=0.0))
    return math.ceil(math.log(0.01) / math.log(min(max(slowest, 1e-9), 1.0 - 1e-9)))


def _first_block_moved(model: ChainModel, log: View, start: int, before: int, span: int, basis: Array) -> Array:
    """Effect of another state of the first block at ``start`` on the output over ``span`` samples, by least squares.

    If the law loses the sign, a state of either sign may fit, so both are tried.
    """
    from scipy.optimize import least_squares
    from scipy.signal import lfilter

    order = len(model.f1) - 1
    x, v, _ = model.signals(log.u * log.si[0])
    x, v = x[start : start + span], v[start : start + span]
    response = lfilter([1.0], model.f1, np.r_[1.0, np.zeros(span + order)])
    modes = np.column_stack([response[k : k + span] for k in range(order)])
    modes /= np.maximum(np.abs(modes).max(axis=0), 1e-300)
    measured = (log.y - model.simulate(log.u))[start : start + span]

    def added(state: Array, n: int) -> Array:
        moved = x[:n] + modes[:n] @ state
        return lfilter(model.b2, model.f2, model.law(moved, np.diff(moved, prepend=moved[0])) - v[:n]) / log.si[1]

    across, sizes, _ = np.linalg.svd(basis[:before], full_matrices=False)
    across = across[:, sizes > 1e-6 * sizes[0]]  # what the state of the second block explains is taken from the error
    pull = PULL * float(np.std(log.y)) / max(float(np.std(x)), 1e-300)

    def left(state: Array) -> Array:
        error = measured[:before] - added(state, before)
        return np.r_[error - across @ (across.T @ error), pull * state]

    if order == 0:
        return np.zeros(span)
    turned = np.linalg.lstsq(modes[:before], -2.0 * x[:before], rcond=1e-6)[0]
    ends = [least_squares(left, state, max_nfev=FEW_STEPS) for state in (np.zeros(order), turned)]
    return added(min(ends, key=lambda e: e.cost).x, span)
