"""Effects of the sensor that are read directly from a record, before any model: a coarse grid and a lost sign."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from whsklearn.effects import get_effect
from whsklearn.effects.base import rms
from whsklearn.gap.diagnosis import NamedEffect
from whsklearn.gap.plant import QUIET
from whsklearn.gap.search import HALF

# Counts a turn of the coarsest encoders that servos are sold with: 12 bits (AS5600, Dynamixel XL330), 1024 lines. A
# grid that has more over half the travel is not coarse.
USUAL_COUNTS = 4096
# Share of the span: how close to zero a folded reading turns, unless a sample is a longer way.
FOLD_TURNS = 0.02
# s on either side of a turn, three times of which (three samples at least) a cubic is fitted to; and the smallest speed
# there, as a share of the rms speed: where the axis comes to rest, nothing tells to which side it goes on.
FOLD_WINDOW, FOLD_SPEED = 0.006, 0.1


def coarse_encoder(view: Any, base: Any) -> list[Any]:
    """The quantization, if all positions are on a grid that is the main noise and nothing else is missing.

    A log in counts states its grid; only one that lacks a bit of it is an effect.  An axis whose log does not state it
    is taken to have at least an encoder of the usual kind.
    """
    step, stated = view.quantum, view.record.resolution
    if not stated and view.record.units[1] == "rad":
        stated = 2 * np.pi / USUAL_COUNTS
    if step < view.scene.reach / USUAL_COUNTS or step**2 / 12.0 < HALF * view.noise**2:
        return []
    if stated and round(np.log2(step / stated)) < 1:
        return []
    effect = get_effect("quantization")(step=step)  # type: ignore[call-arg]
    if view.rms(view.gap(base)) > QUIET * view.floor:
        return []
    return [NamedEffect(effect, {}, 0.0, 1.0)]


def unfold(position: NDArray[np.float64], dt: float) -> NDArray[np.float64] | None:
    """The position whose absolute value was logged, or None if nothing looks folded.

    A folded reading stays on one side and turns back at zero at speed.  A cubic, q(t) about the turn, is fitted three
    times: to the reading as it is, and with its sign changed from the sample nearest to zero or the next one on.
    A real turn is smoothest as it is.  What is below zero is noise, and a turn rises above it: a pendulum that hung at
    rest within three counts of zero, and was then lifted, had been unfolded there.
    """
    span, noise = float(np.ptp(position)), max(0.0, -float(position.min()))
    if position.min() < -FOLD_TURNS * span:
        return None
    w = max(1, round(FOLD_WINDOW / dt))
    reach = 3 * w
    cubic = np.vander(np.arange(-reach, reach + 1) * dt, 4, increasing=True)
    signs = np.ones((2 * reach + 1, 3))
    signs[reach:, 1] = signs[reach + 1 :, 2] = -1.0
    slowest = max(FOLD_SPEED * rms(np.diff(position)), 2.0 * noise / reach) / dt
    here, beside = position[1:-1], np.stack((position[:-2], position[2:]))
    near = here <= np.maximum(FOLD_TURNS * span, beside.max(axis=0) - here)
    out, last, flips = position.copy(), -2 * w, 0
    for k in (1 + np.flatnonzero(near & (here <= beside.min(axis=0)))).tolist():
        if k - last <= 2 * w or position[k] > position[max(0, k - w) : k + w + 1].min():
            continue
        around = slice(max(0, k - reach), k + reach + 1)
        ways = out[around, None] * signs[max(0, reach - k) :][: out[around].size]
        numbers, left, *_ = np.linalg.lstsq(cubic[max(0, reach - k) :][: out[around].size], ways)
        best = int(np.argmin(left)) if left.size else 0
        if best and abs(numbers[1, best]) > slowest:
            out[k + best - 1 :] *= -1.0
            last, flips = k, flips + 1
    both_sides = min(out.max(), -out.min()) > FOLD_TURNS * span  # a sign that is the other one everywhere is no fold
    return out if flips and both_sides else None
