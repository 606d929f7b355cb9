"""Motor and load with a spring and a damper between them: a resonance first, then multiple shooting."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from whsklearn.effects import FlexibleCoupling
from whsklearn.effects.base import Array
from whsklearn.filtering.records import HOLDS
from whsklearn.identification.axis_fit import AS_LOW, LONG, TINY, determined, model_of, without_step
from whsklearn.identification.axis_inverse import FEWEST, inverse_starts
from whsklearn.identification.axis_numbers import shooting_log
from whsklearn.identification.view import View, since_start
from whsklearn.identification.windows import axis_score
from whsklearn.models import AxisModel
from whsklearn.recursion.batch.axis_free_run import SHARE_AND_DAMPING, AxisFit, AxisForm, fit_pieces
from whsklearn.recursion.batch.best_linear import filter_rows
from whsklearn.systems.servo import fine_steps

EARLY = 4_000  # samples of the first fit of a coupled axis
# Resonances that are tried: their number, the lowest (Hz), the highest (share of the sampling rate) and the damping
# ratios; neighbours are 5 to 8 % apart, which is the width of a peak with such damping. Each is sought in a band that
# is this many times wider in either direction, and fitted in pieces of `RINGS` s.
RESONANCES, SLOWEST, FASTEST, DAMPED, BAND = 80, 1.0, 0.2, (0.02, 0.05, 0.1), 2.0
PERIODS, RINGS = 4.0, 0.5
RESONANCES_TRIED = 3  # deepest minima from which two masses are fitted: friction has minima of its own
# Share of the squared error of a rigid axis in a band that a resonance may leave: 20 loads left 0.06 to 0.55, axes
# without one 0.82 or more, and with a share of the inertia below its limits (`benchmarks.two_masses`); the comparison
# judges the fit
RESONANT = 0.85
# Starts of a coupled axis, as the output hardly shows them: shares of friction on the load, shares of inertia; steps of
# the first fit of each, and how many of them go on
SIDES, SHARES, FEW, GO_ON = (0.1, 0.9), (0.3, 0.7), 8, 2
COARSE = 0.2  # rad of the resonance per fine step of these fits; leapfrog puts it off by COARSE^2 / 24, or 0.2 %


def fit_two_masses(log: View, *, at_load: bool = False) -> AxisModel:
    """Motor and load with a spring and a damper between them and friction on either side, drive to position.

    By multiple shooting from `resonance_starts` over pieces in which the load rings.

    ``at_load``: whether the output is the position of the load, of which the share of the load shows little: without
    friction, the drive moves it by 1 / (J p^2) beside its resonance whatever that share.

    Raises ValueError if the output is not a position, or no resonance is found.
    """
    if log.logged != "position":
        raise ValueError("The resonance of a load can be identified from a position only.")
    starts, form = resonance_starts(log, at_load=at_load), AxisForm(coupled=True, at_load=at_load)
    few, log = log.steps, replace(log, steps=fine_steps([FlexibleCoupling()], log.dt))
    early, begun = log.part(0, min(log.u.size, EARLY)), []
    for s, side in itertools.product(starts, SIDES):
        coarse = replace(early, steps=max(few, math.ceil(2.0 * np.pi * s[6] * log.dt / COARSE)))
        for x in SHARES if at_load else s[7:8]:
            theta = np.r_[s[0], (1.0 - side) * s[1:3], s[3], side * s[1:3], s[6], x, s[8]]
            for seconds in (PERIODS / s[6], RINGS):
                fit = fit_pieces(theta, shooting_log(coarse, seconds, form), iterations=FEW)
                theta = fit.theta
            begun.append(fit)
    begun = sorted(begun, key=lambda fit: fit.cost)[:GO_ON]
    if fit_pieces(begun[0].theta, shooting_log(replace(early, hold=HOLDS[1]), RINGS, form)).cost < begun[0].cost:
        log = replace(log, hold=HOLDS[1])
    ended = [fit_pieces(fit.theta, shooting_log(log, RINGS, form)) for fit in begun]
    best = min(ended, key=lambda fit: fit.cost)
    if not _possible(best, log.dt, at_load=at_load):
        raise ValueError("No resonance of a load is found: its frequency, share or damping is at a limit.")
    # where the output hardly shows on which side the friction is, fits end apart
    apart = [fit.theta - best.theta for fit in ended if fit.cost < AS_LOW * best.cost]
    best = without_step(best, log, RINGS, form)
    covariance = best.covariance + sum(np.outer(d, d) for d in apart)
    return determined(*model_of(best._replace(covariance=covariance), log, form, np.inf))


def _possible(fit: AxisFit, dt: float, *, at_load: bool) -> bool:
    """Whether share and damping of a load are inside their limits, and its resonance is one that samples can show.

    An output ``at_load`` hardly shows the share, which may then end anywhere.
    """
    within = [
        low < x < high for low, x, high in zip(SHARE_AND_DAMPING[0], fit.theta[-2:], SHARE_AND_DAMPING[1], strict=True)
    ]
    return bool(np.isfinite(fit.cost) and all(within[at_load:]) and fit.theta[-3] * dt < 0.5)


def resonance_starts(log: View, *, at_load: bool = False) -> list[Array]:
    r"""Numbers of two masses by least squares along the measured motion: inertia, friction, offset, resonance, share.

    One for each of the `RESONANCES_TRIED` deepest minima over the resonance, with all friction on the motor.

    With friction on the motor's side and tau the drive without it, a load that is the share s of the inertia J moves
    the motor by one more term,

    .. math:: q = \frac{1}{J p^2} \tau + \frac{s}{1 - s} \frac{1}{J (p^2 + 2 \zeta \omega p + \omega^2)} \tau,

    which is linear in the numbers except the resonance, for which a grid is tried, each in a `BAND` of its own: over
    all frequencies, errors of friction and of the encoder hid the rings of 11 of 20 loads (`benchmarks.two_masses`).
    The load itself, with ``at_load``, rings against the motor, with -1 in place of s / (1 - s), momentum being
    conserved, so its share is not known.

    Raises ValueError if every resonance leaves more than `RESONANT` of the squared error of a rigid axis in its band.
    """
    log = log.part(0, min(log.u.size, LONG))
    tried = [start.theta for start in inverse_starts(log, AxisForm())]
    rigid = min(tried, key=lambda theta: axis_score(theta, AxisForm(), log))
    explained, found = _ringing(log, rigid), []
    for frequency in np.geomspace(SLOWEST, FASTEST / log.dt, RESONANCES):
        found.append(min((explained(frequency, r, frequency / BAND)[0], frequency, r) for r in DAMPED))
    left = np.r_[np.inf, [f[0] for f in found], np.inf]
    valleys = [f for f, a, b, c in zip(found, left, left[1:], left[2:], strict=False) if b <= min(a, c)]
    starts = []
    for remaining, frequency, ratio in sorted(valleys)[:RESONANCES_TRIED]:
        weights = explained(frequency, ratio, SLOWEST)[1]
        rings = -weights[3] if at_load else weights[3]
        if remaining < RESONANT and weights[0] > 0.0 and rings > SHARE_AND_DAMPING[0][0] * (weights[0] + rings):
            share = min(rings / (weights[0] + rings), SHARE_AND_DAMPING[1][0])
            theta = np.r_[1.0, np.maximum(weights[1:3], 0.0), rigid[3] * weights[0]] / weights[0]
            starts.append(np.r_[theta, 0.0, 0.0, frequency, share, ratio])
    if not starts:
        raise ValueError("The residual of a rigid axis shows no resonance of a load.")
    return starts


def _ringing(log: View, rigid: Array) -> Callable[[float, float, float], tuple[float, Array]]:
    """What a resonance with a damping ratio leaves of the squared error in a band up to `BAND` times it, and weights.

    The weights are those of drive, viscous and dry friction in the acceleration, and of the drive less the friction of
    the ``rigid`` axis in the rings and in their rate.
    """
    from scipy.signal import butter, cont2discrete

    since, twice = since_start(log.bounds), np.array([1.0, -2.0, 1.0])

    def differenced(b: Array, a: Array, rows: Array) -> Array:
        """Filtered rows, differenced twice, so that no position drifts."""
        return np.where(since < twice.size, 0.0, filter_rows(np.convolve(b, twice), a, rows, log.bounds))

    torques = np.vstack([log.u, -log.target, -np.sign(log.target)])
    net = np.r_[1.0, rigid[1:3]] @ torques - rigid[3]
    # 1 / p^2 of a held torque, differenced twice
    pushed = filter_rows(0.5 * log.dt**2 * np.array([0.0, 1.0, 1.0]), np.ones(1), torques, log.bounds)
    rows = np.vstack([pushed, differenced(np.ones(1), np.ones(1), log.y[None, :]), net])

    def explained(frequency: float, ratio: float, lowest: float) -> tuple[float, Array]:
        b, a = butter(1, [lowest, frequency * BAND], "bandpass", fs=1.0 / log.dt)
        *columns, place, drive = filter_rows(b, a, rows, log.bounds)
        seen, turn = since >= 1.0 / (lowest * log.dt), 2.0 * np.pi * frequency
        if np.count_nonzero(seen) < FEWEST:
            return np.inf, np.zeros(5)
        both = [cont2discrete((b, [1.0, 2.0 * ratio * turn, turn**2]), log.dt) for b in ([1.0], [1.0, 0.0])]
        ringing = [differenced(b.ravel(), a, drive[None, :])[0] for b, a, _ in both]  # and its rate
        r: Array = np.linalg.qr(np.vstack([*columns, *ringing, place])[:, seen].T).R
        weights = np.asarray(np.linalg.lstsq(r[:5, :5], r[:5, 5], rcond=None)[0], dtype=float)
        return float(r[5, 5] ** 2 / max(np.sum(r[3:, 5] ** 2), TINY)), weights

    return explained
