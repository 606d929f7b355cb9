"""The series of a servo diagnosis that the page draws."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from whsklearn.gap.localisation import since_reversal, spectra

Array = NDArray[Any]


def signals(view: Any, units: tuple[str, str]) -> dict[str, tuple[Array, str]]:
    """The signals that the gap may follow, at the judged samples of the inverse view."""
    motion, dt = view.motion, view.scene.dt
    drive, rad = units
    picked = {
        "time": (view.time, "s"),
        "position": (motion.position, rad),
        "velocity": (motion.velocity, f"{rad}/s"),
        "reversal": (since_reversal(motion.velocity, dt, 0.01 * view.scene.speed), "s"),
    }
    if np.ptp(motion.position) > 2 * np.pi:
        picked["angle in the turn"] = (np.mod(motion.position, 2 * np.pi), rad)
    out = {k: (x[:: view.every][view.at], u) for k, (x, u) in picked.items()}
    return out | {"drive": (view.drive[view.at], drive)}


def pictures(view: Any, base: Any, model: Any, units: tuple[str, str], what: str) -> dict[str, Any]:
    """Overlay, gap over time, its spectra by frequency and by order, and its axes."""
    gaps = view.gap(base), view.gap(model)
    orders = np.arange(0.5, min(160.0, 2 * np.pi * 2 * view.cutoff / view.scene.speed), 0.1)
    return {
        "time": view.time, "measured": view.record.position, "gap_time": view.time[:: view.every][view.at],
        "usable": np.ones(gaps[0].size, dtype=bool), "floor": view.floor(model),
        "axes": signals(view, units), "units": units, "what": what,
        **spectra(*gaps, view.step, view.motion.position[:: view.every][view.at], orders),
    }  # fmt: skip
