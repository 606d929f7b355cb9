"""Effects of the encoder that leave no missing torque behind: a coarse grid."""

from __future__ import annotations

from typing import Any

from whsklearn.gap.bench import Bench

COARSE = 6e-4  # step of the grid as a share of half the travel, finer ones are any encoder's


def coarse_encoder(bench: Bench, found: Any) -> tuple[str, list] | None:
    """The verdict if all positions lie on a grid that is the main noise, None otherwise."""
    from whsklearn.effects import get_effect
    from whsklearn.gap.diagnosis import NamedEffect

    step = bench.quantum
    if step < COARSE * bench.scene.reach / 2 or step / 12**0.5 < 0.7 * bench.noise:
        return None
    effect = get_effect("quantization")(step)
    gap = bench.rms(found.base_missing, "all")
    if gap > 1.3 * bench.floor():
        return None
    return "named", [NamedEffect(effect, {}, 0.0, 0.95, 1.0)]
