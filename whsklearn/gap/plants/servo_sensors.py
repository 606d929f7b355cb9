"""Effects of the sensor that are read directly from the record: a coarse grid, a folded sign."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from whsklearn.effects import get_effect
from whsklearn.gap.diagnosis import NamedEffect
from whsklearn.gap.plants import servo_evidence as rules
from whsklearn.gap.record import rms


def coarse_encoder(view: Any, base: Any) -> list[Any]:
    """The quantization, if all positions are on a grid that is the main noise and nothing else is missing.

    A log in counts states its grid; only a coarser one is an effect.
    """
    step = view.quantum
    if step < rules.COARSE_GRID * view.scene.reach or step / 12**0.5 < rules.GRID_NOISE * view.noise:
        return []
    if step < rules.COARSER_THAN_STATED * view.record.resolution:
        return []
    effect = get_effect("quantization")(step=step)  # type: ignore[call-arg]
    if view.rms(view.gap(base)) > rules.NEAR_GRID * view.floor():
        return []
    return [NamedEffect(effect, {}, 0.0, rules.GRID_SEEN, 1.0)]


def unfold(position: NDArray[np.float64], dt: float) -> NDArray[np.float64] | None:
    """The position whose absolute value was logged, or None if nothing looks folded.

    A folded reading stays on one side and turns back at zero at speed: the slopes before and after are opposite and
    equal.  At a real turn the axis would have come to rest.
    """
    span = float(np.ptp(position))
    if position.min() < -rules.FOLD_BELOW * span or position.min() > rules.FOLD_ABOVE * span:
        return None
    w = max(2, round(rules.FOLD_WINDOW / dt))
    typical = rms(np.diff(position)) / dt
    out, sign, k, flips = position.copy(), 1.0, w, 0
    last = -10 * w
    while k < position.size - w:
        near = position[k] < rules.FOLD_TURNS * span and position[k] == position[k - w : k + w + 1].min()
        if near and k - last > 2 * w:
            before = (position[k] - position[k - w]) / (w * dt)
            after = (position[k + w] - position[k]) / (w * dt)
            least, (low, high) = rules.FOLD_SPEED * typical, rules.FOLD_RATIO
            if before < -least and after > least and low < -before / after < high:
                out[last if last > 0 else 0 : k] *= sign
                sign, flips, last = -sign, flips + 1, k
        k += 1
    out[max(last, 0) :] *= sign
    return out if flips else None
