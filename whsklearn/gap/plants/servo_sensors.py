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

# Step of the grid as a share of half the travel, where a coarse encoder is not told by its counts: linear axes.
COARSE_GRID = 2.5e-4
# Counts a turn of the coarsest encoders that servos are sold with: 12 bits (AS5600, Dynamixel XL330), 1024 lines.
USUAL_COUNTS = 4096
# Multiple of the encoder's stated or usual step: one lost bit doubles it.
COARSER_THAN_STATED = 1.5
# Largest misfit of an unfolded reading as a share of that before: half of a folded record is on the wrong side.
UNFOLDED = 0.1
# Share of the span: how close to zero a folded reading turns.
FOLD_TURNS = 0.02
# s on either side of a turn over which slopes are computed; and the smallest such slope, as a share of the rms speed,
# because a real turn comes to rest.
FOLD_WINDOW, FOLD_SPEED = 0.006, 0.1


def coarse_encoder(view: Any, base: Any) -> list[Any]:
    """The quantization, if all positions are on a grid that is the main noise and nothing else is missing.

    A log in counts states its grid; only a coarser one is an effect.  An axis whose log does not state it is taken to
    have at least an encoder of the usual kind.
    """
    step, stated = view.quantum, view.record.resolution
    if not stated and view.record.units[1] == "rad":
        stated = 2 * np.pi / USUAL_COUNTS
    if step < COARSE_GRID * view.scene.reach or step**2 / 12.0 < HALF * view.noise**2:
        return []
    if step < COARSER_THAN_STATED * stated:
        return []
    effect = get_effect("quantization")(step=step)  # type: ignore[call-arg]
    if view.rms(view.gap(base)) > QUIET * view.floor:
        return []
    return [NamedEffect(effect, {}, 0.0, 1.0)]


def unfold(position: NDArray[np.float64], dt: float) -> NDArray[np.float64] | None:
    """The position whose absolute value was logged, or None if nothing looks folded.

    A folded reading stays on one side and turns back at zero at speed: the slopes before and after are opposite and
    equal.  At a real turn the axis would have come to rest.
    """
    span = float(np.ptp(position))
    if abs(position.min()) > FOLD_TURNS * span:
        return None
    w = max(2, round(FOLD_WINDOW / dt))
    typical = rms(np.diff(position)) / dt
    out, sign, k, flips = position.copy(), 1.0, w, 0
    last = -10 * w
    while k < position.size - w:
        near = position[k] < FOLD_TURNS * span and position[k] == position[k - w : k + w + 1].min()
        if near and k - last > 2 * w:
            before = (position[k] - position[k - w]) / (w * dt)
            after = (position[k + w] - position[k]) / (w * dt)
            if min(-before, after) > FOLD_SPEED * typical:
                out[last if last > 0 else 0 : k] *= sign
                sign, flips, last = -sign, flips + 1, k
        k += 1
    out[max(last, 0) :] *= sign
    return out if flips else None
