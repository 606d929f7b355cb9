"""Sub-innovation updates with the exact gradient: the default reading of (10)-(14).

The last p samples are one window, which starts from the stored state before it.  For
i = 1 .. p the window is run again up to its i-th sample with the newest parameters, and
that sample updates theta and P with weight 1/p.  Over p windows each sample then counts
once, and P stays calibrated.  With ``frozen`` the p rows are evaluated at theta(t-1) and
P follows the block update (7)-(9), which by the block inversion lemma is p scalar updates.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from whsklearn._numba import njit, part, piece
from whsklearn.effects.base import Array
from whsklearn.recursion.rows.covariance import inflate, measurement_update
from whsklearn.recursion.rows.predictor import (
    LEAST_MOTION,
    Law,
    advance,
    by_block,
    copy_past,
    past_of,
    predict,
    respond,
)
from whsklearn.systems.stability import is_stable

STABLE_RADIUS = 0.999
LARGEST_PARAMETER = 1e45  # a weight has the unit of y per x, so it may be 1e30 times a coefficient of a block
LARGEST_SIGNAL = 1e60  # logs hold at most 1e30
LOSS_FORGETTING = 0.995
LONGEST_TRANSIENT = 256  # samples of constant input after which forgetting stops
MOVING, IDLE, STILL = range(3)


def relative_sharpness(seen, sharpest):
    """kappa times the root mean square of dx, which rises with the samples seen from 1 to ``sharpest``."""
    return min(max((seen / 32.0) ** 1.75, 1.0), sharpest)


_relative_sharpness = part(relative_sharpness)  # of kernels; called from Python it would be compiled by itself too


@njit(error_model="numpy", short=True)
def mark_still(repeats, recent_u, recent_y, known, kept, u, y, still):
    """Mark samples as MOVING, IDLE or STILL; ``repeats`` counts how often the last input and sample repeat.

    A record that is bitwise constant for longer than a window is STILL: it repeats the same information, and
    counting it as new samples would make the noise variance and P decay.  An axis whose input has been constant for
    LONGEST_TRANSIENT samples is IDLE: its noise is informative, but it does not excite the directions in which
    forgetting would inflate P.  ``known`` is the number of samples, discounted by the forgetting factor ``kept``.
    """
    m = u.shape[1]
    for t in range(y.size):
        same = True
        for i in range(m):
            same = same and u[t, i] == (u[t - 1, i] if t > 0 else recent_u[i])
        repeats[0] = repeats[0] + 1 if same else 0
        same = same and y[t] == (y[t - 1] if t > 0 else recent_y[0])
        repeats[1] = repeats[1] + 1 if same else 0
        still[t] = MOVING
        if repeats[0] >= LONGEST_TRANSIENT:
            still[t] = IDLE
        if repeats[1] >= recent_y.size - 1:
            still[t] = STILL
        else:
            known[0] = (kept if still[t] == MOVING else 1.0) * known[0] + 1.0


class Models(NamedTuple):
    """Models that run in parallel, one row each."""

    # theta, ud, before (S, n), (S, n, n), (S, n_state): parameters, factorised covariance and the state before the
    # window
    theta: Array
    ud: Array
    before: Array
    loss: Array  # (S, 2): weighted sum of squared innovations, and their number
    motion: Array  # (S, 2): the same for dx, which sets the scale of kappa
    sharpness: Array  # (S,): kappa


class Samples(NamedTuple):
    """Samples in time order, or the latest ones, newest first."""

    u: Array  # u, y, weight: input, of shape (m, n_inputs) or flat; output; weight of its squared error
    y: Array
    weight: Array


class Schedule(NamedTuple):
    """Settings that depend on the number of samples seen."""

    forgetting: Array  # (3,): current value, final value, and the rate at which the first approaches the second
    ceiling: float  # limit up to which forgetting inflates P
    sharpest: float  # if positive, kappa rises to this value (relative to dx) with the samples seen


def run_windows(
    models: Models, recent: Samples, since: int, seen: int, schedule: Schedule, law: Law, p: int, frozen: bool,
    samples: Samples, still: NDArray[np.uint8],
) -> int:  # fmt: skip
    """Run every model through the samples; all state arrays change in place.

    ``recent``: the latest samples, newest first: u of shape ((p + lags) * n_inputs,), y and weights of shape (p +
        lags,).
    ``since``, ``seen``: number of samples since the experiment began, and in all; returns ``since`` after the last one.
    ``frozen``: whether all rows of a window are evaluated at the parameters before it.
    ``still`` (m,): from `mark_still`: a STILL sample advances the state and changes nothing else; nothing is forgotten
        at an IDLE one.
    """
    na, nb, _, _, nw = law[0].tolist()
    m, n, n_state = samples.u.shape[1], models.theta.shape[1], models.before.shape[1]
    # one array, so that the kernel counts no references: the line of samples, four of theta, a state with room for p
    scratch = np.zeros((m + 2) * (still.size + recent.y.size) + 4 * n + n_state + p * (2 * na + 2 * nb + nw))
    # plain tuples: Numba takes twice as long to unpack named ones, which was a third of a row
    return int(
        _run_models(
            tuple(models), tuple(recent), since, seen, tuple(schedule), law, p, frozen, tuple(samples), still, scratch
        )
    )


@njit(error_model="numpy", counted=False, short=True)
def _run_models(models, recent, since, seen, schedule, law, p, frozen, samples, still, scratch):
    models, recent, schedule, samples = Models(*models), Samples(*recent), Schedule(*schedule), Samples(*samples)
    count, m = samples.y.size, samples.u.shape[1]
    length = count + recent.y.size
    to_y, to_weight, to_rest = m * length, (m + 1) * length, (m + 2) * length
    line = Samples(piece(scratch, 0, (to_y,)), piece(scratch, to_y, (length,)), piece(scratch, to_weight, (length,)))
    # for every model in turn
    n = models.theta.shape[1]
    room, rest = past_of(scratch, to_rest + 4 * n, law[0], p), piece(scratch, to_rest, (4 * n,))
    _line_up(samples, recent, line)
    rate = schedule.forgetting[0]
    for s in range(models.theta.shape[0]):
        model = Models(
            models.theta[s], models.ud[s], models.before[s], models.loss[s], models.motion[s],
            models.sharpness[s : s + 1],
        )  # fmt: skip
        rate = _run_model(model, room, line, since, seen, schedule, law, p, frozen, still, rest)
    schedule.forgetting[0] = rate
    _keep(recent.u, line.u)
    _keep(recent.y, line.y)
    _keep(recent.weight, line.weight)
    return since + count


@part
def _line_up(samples, recent, line):
    """Write the samples into ``line`` from the newest to the oldest, and the recent ones behind them."""
    count, m = samples.u.shape
    for t in range(count):
        at = count - 1 - t
        for j in range(m):
            line.u[at * m + j] = samples.u[t, j]
        line.y[at], line.weight[at] = samples.y[t], samples.weight[t]
    for k in range(recent.u.size):
        line.u[count * m + k] = recent.u[k]
    for k in range(recent.y.size):
        line.y[count + k], line.weight[count + k] = recent.y[k], recent.weight[k]


@part
def _keep(recent, line):
    """Store the newest samples of the line."""
    for k in range(recent.size):
        recent[k] = line[k]


@part
def _run_model(model, line, samples, since, seen, schedule, law, p, frozen, still, scratch):
    """Run one model through the samples; return the forgetting factor after the last of them."""
    theta, ud, before, _, motion, sharpness = model
    recent_u, recent_y, _ = samples
    dims, codes, shapes = law
    n, count = theta.size, still.size
    m = recent_u.size // recent_y.size
    nc = dims[2]
    past = past_of(before, 0, dims, 0)
    psi, start = piece(scratch, 0, (n,)), piece(scratch, n, (n,))
    room = psi, start, piece(scratch, 2 * n, (n,)), piece(scratch, 3 * n, (n,))
    blocks, psi_blocks = by_block(start if frozen else theta, dims), by_block(psi, dims)
    b = piece(theta, dims[0] - 1, (dims[1],))
    rate = schedule.forgetting[0]
    for t in range(count):
        newest = count - 1 - t
        since += 1
        seen += 1
        learns = still[t] != STILL
        window = min(p, since) if learns else 0
        if learns:
            rate += (1.0 - schedule.forgetting[2]) * (schedule.forgetting[1] - rate)
            if rate != 1.0 and still[t] == MOVING:
                inflate(ud, 1.0 / rate, schedule.ceiling)
        for k in range(n):
            start[k] = theta[k]
        copy_past(past, 0, line, min(p, since), past)
        for i in range(window + 1):
            # the newest sample of the run-up has index window-1-i in the recent ones; a frozen run continues from there
            now = window - 1 - i
            run_up = window - 1
            onwards = i == window  # finally the state before the window advances, with the newest parameters:
            if onwards:  # in the same loop, because a second call of `advance` would be inlined once more
                if since < p:
                    break
                run_up, now = p - 1, p - 2
                for k in range(n):
                    start[k] = theta[k]
            if frozen and 0 < i < window:
                run_up = now + 1
            for k in range(run_up, now, -1):
                advance(blocks, line, k, recent_u[(newest + k + 1) * m :])
            for k in range(min(run_up, now + nc), now, -1):
                respond(blocks, codes, shapes, sharpness[0], line, k)
            if onwards:
                copy_past(line, p - 1, past, 0, past)
                if learns:
                    dx = line.x[p - 1] - line.x[p]
                    motion[0] = LOSS_FORGETTING * motion[0] + dx * dx
                    motion[1] = LOSS_FORGETTING * motion[1] + 1.0
                break
            _meet(model, samples, newest, line, now, blocks, psi_blocks, room, b, p, frozen)
        if learns and schedule.sharpest > 0.0:
            rms = np.sqrt(motion[0] / max(motion[1], 1.0))
            sharpness[0] = _relative_sharpness(seen, schedule.sharpest) / max(rms, LEAST_MOTION)
    return rate


# these two are written into their callers: as calls, a sample took 4 % longer
@njit(cache=False, error_model="numpy", forceinline=True)
def _meet(model, samples, newest, line, now, blocks, psi_blocks, room, b, p, frozen):
    """Learn the sample in row ``now`` of the past ``line``; the loss counts a window's last."""
    theta, ud, _, loss, _, _ = model
    _, recent_y, recent_weight = samples
    psi, start, gain, old = room
    weight = recent_weight[newest + now]
    if weight == 0.0:
        return
    e = recent_y[newest + now] - predict(blocks, line, now + 1, recent_y[newest + now + 1 :], psi, psi_blocks)
    if frozen:
        for k in range(theta.size):
            e -= psi[k] * (theta[k] - start[k])
    learnt = _learn(theta, ud, psi, e, p / weight, b, gain, old)
    if now == 0:
        loss[0] = LOSS_FORGETTING * loss[0] + (weight * e * e if learnt else LARGEST_SIGNAL)
        loss[1] = LOSS_FORGETTING * loss[1] + 1.0


@njit(cache=False, error_model="numpy", forceinline=True)
def _learn(theta, ud, psi, e, variance, b, gain, old):
    """(12), and theta += gain e, or a half, a quarter .. of it until L1 with ``b`` is stable; none if it never is.

    Returns False, and changes nothing, if a number is too large: an interim model may diverge.  ``b`` is part of theta;
    ``gain`` and ``old`` are scratch.
    """
    usable = abs(e) < LARGEST_SIGNAL  # False for NaN as well
    for k in range(theta.size):
        usable &= abs(psi[k]) < LARGEST_SIGNAL
    if not usable:
        return False
    measurement_update(ud, psi, variance, gain)
    for k in range(theta.size):
        old[k] = theta[k]
    scale = 1.0
    for _ in range(10):
        ok = True
        for k in range(theta.size):
            theta[k] = old[k] + scale * gain[k] * e
            ok &= abs(theta[k]) < LARGEST_PARAMETER
        if ok and is_stable(b, STABLE_RADIUS):
            return True
        scale *= 0.5
    for k in range(theta.size):
        theta[k] = old[k]
    return True
