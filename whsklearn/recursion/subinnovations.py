"""Sub-innovation updates with the exact gradient: the default reading of (10)-(14).

The last p samples are one window.  It starts from the stored state before it; for
i = 1 .. p it is run again up to its i-th sample with the newest parameters, and that
sample updates theta and P with weight 1/p, so that over p windows it counts once and P
stays calibrated.  With ``frozen`` the p rows are evaluated at theta(t-1) and P is the
block update (7)-(9), which by the block inversion lemma is p scalar updates.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from whsklearn._numba import njit, part
from whsklearn.recursion.covariance import inflate, measurement_update
from whsklearn.recursion.delay_line import push
from whsklearn.recursion.predictor import advance, predict
from whsklearn.systems.stability import is_stable

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

STABLE_RADIUS = 0.999
LARGEST_PARAMETER = 1e8
LARGEST_SIGNAL = 1e60  # logs hold 1e30 at the most
LOSS_FORGETTING = 0.995
LONGEST_TRANSIENT = 256  # samples of constant input after which nothing more is forgotten
MOVING, IDLE, STILL = range(3)


@part
def relative_sharpness(seen, sharpest):
    """kappa times the root mean square of dx: rises with the samples seen from 1 to ``sharpest``."""
    return min(max((seen / 32.0) ** 1.75, 1.0), sharpest)


@njit(cache=True, error_model="numpy")
def mark_still(repeats, recent_u, recent_y, known, kept, u, y, still):
    """Mark samples that are MOVING, IDLE or STILL; ``repeats`` counts how often the last input and sample repeat.

    A record that stands STILL to the last bit, longer than a window sees, says the same thing again: taken for new
    samples, it would let the noise variance and P die away.  An input that stood still for LONGEST_TRANSIENT samples
    leaves an IDLE axis: it says what its noise is, but does not excite what forgetting would take away.
    ``known`` counts samples under the forgetting factor ``kept``.
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
    """Models side by side, a row each.

    Attributes
    ----------
    theta, ud, before : ndarrays of shape (S, n), (S, n, n), (S, n_state)
        Parameters, factorised covariance and the state before the window.
    loss : ndarray of shape (S, 2)
        Weighted sum of squared innovations, and how many.
    motion : ndarray of shape (S, 2)
        The same of dx, which sets the scale of kappa.
    """

    theta: Array
    ud: Array
    before: Array
    loss: Array
    motion: Array


class Samples(NamedTuple):
    """Samples in time order, or the latest ones, newest first.

    Attributes
    ----------
    u, y, weight : ndarrays
        Input, of shape (m, n_inputs) or flat, output and weight of its squared error.
    """

    u: Array
    y: Array
    weight: Array


@njit(cache=True, error_model="numpy")
def run_windows(
    models, recent, since, seen, forgetting, ceiling, sharpness, sharpest, law, p, frozen, samples, still
):  # fmt: skip
    """Take every model through the samples; all state arrays change in place.

    Parameters
    ----------
    models : Models
    recent : Samples
        The latest ones, newest first: u of shape ((p + lags) * n_inputs,), y and weights of shape (p + lags,).
    since : int
        Samples since the experiment began.
    seen : int
        Samples in all.
    forgetting : ndarray of shape (3,)
        Present value, final value, rate at which the one goes to the other.
    ceiling : float
        Where forgetting stops to inflate P.
    sharpness : ndarray of shape (S,)
        kappa of each model.
    sharpest : float
        Where positive, kappa rises with the samples seen to this value (relative to dx).
    law : tuple of ndarrays
        dims, codes, shapes.
    samples : Samples
        The new ones.
    still : ndarray of shape (m,)
        By `mark_still`: STILL samples teach nothing, the state goes on and nothing else does; IDLE ones let nothing
        be forgotten.

    Returns
    -------
    int
        ``since`` after the last sample.
    """
    theta, ud, before, loss, motion = models
    dims, codes, shapes = law
    u, y = samples.u, samples.y
    recent_u, recent_y, recent_weight = recent
    n_models, n = theta.shape
    m = u.shape[1]
    na, nb = dims[0], dims[1]
    work = np.empty(before.shape[1])
    psi = np.empty(n)
    gain = np.empty(n)
    start = np.empty(n)
    old = np.empty(n)
    for t in range(y.size):
        push(recent_u, u[t])
        for k in range(recent_y.size - 1, 0, -1):
            recent_y[k] = recent_y[k - 1]
            recent_weight[k] = recent_weight[k - 1]
        recent_y[0] = y[t]
        recent_weight[0] = samples.weight[t]
        since += 1
        seen += 1
        learns = still[t] != STILL
        window = min(p, since) if learns else 0
        if learns:
            forgetting[0] += (1.0 - forgetting[2]) * (forgetting[1] - forgetting[0])
        for s in range(n_models):
            th = theta[s]
            if learns and forgetting[0] != 1.0 and still[t] == MOVING:
                inflate(ud[s], 1.0 / forgetting[0], ceiling)
            for k in range(n):
                start[k] = th[k]
            at = start if frozen else th
            for i in range(window):
                # newest sample of the run-up has index window-1-i in ``recent``; a frozen one goes on where it was
                now = window - 1 - i
                run_up = window - 1
                if frozen and i > 0:
                    run_up = now + 1
                else:
                    for k in range(work.size):
                        work[k] = before[s, k]
                for k in range(run_up, now, -1):
                    advance(at, dims, codes, shapes, sharpness[s], work, recent_u, (k + 1) * m)
                weight = recent_weight[now]
                if weight == 0.0:
                    continue
                e = recent_y[now] - predict(at, dims, work, recent_y, now + 1, psi)
                if frozen:
                    for k in range(n):
                        e -= psi[k] * (th[k] - start[k])
                size = abs(e)
                for k in range(n):
                    size += abs(psi[k])
                usable = size < LARGEST_SIGNAL  # False for NaN too: an interim model that blows up teaches nothing
                if now == 0:
                    loss[s, 0] = LOSS_FORGETTING * loss[s, 0] + (weight * e * e if usable else LARGEST_SIGNAL)
                    loss[s, 1] = LOSS_FORGETTING * loss[s, 1] + 1.0
                if usable:
                    measurement_update(ud[s], psi, p / weight, gain)
                    _step(th, gain, e, na, nb, old)
            if since >= p:
                dx = advance(th, dims, codes, shapes, sharpness[s], before[s], recent_u, p * m)
                if learns:
                    motion[s, 0] = LOSS_FORGETTING * motion[s, 0] + dx * dx
                    motion[s, 1] = LOSS_FORGETTING * motion[s, 1] + 1.0
            if learns and sharpest > 0.0:
                sharpness[s] = relative_sharpness(seen, sharpest) / max(
                    np.sqrt(motion[s, 0] / max(motion[s, 1], 1.0)), 1e-12
                )
    return since


@part
def _step(theta, gain, e, na, nb, old):
    """theta += gain e, halved until L1 is stable, not taken if it never is; ``old`` is scratch."""
    n = theta.size
    for k in range(n):
        old[k] = theta[k]
    b = theta[na - 1 : na - 1 + nb]
    scale = 1.0
    for _ in range(10):
        ok = True
        for k in range(n):
            theta[k] = old[k] + scale * gain[k] * e
            if not abs(theta[k]) < LARGEST_PARAMETER:
                ok = False
        if ok and is_stable(b, STABLE_RADIUS):
            return
        scale *= 0.5
    for k in range(n):
        theta[k] = old[k]
