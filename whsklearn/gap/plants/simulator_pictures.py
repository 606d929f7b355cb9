"""The series of a simulator's diagnosis that the page draws."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from whsklearn.gap.localisation import since_reversal, spectra
from whsklearn.gap.plants.simulator_model import SimulatorModel
from whsklearn.gap.record import rms

Array = NDArray[Any]


def signals(plant: Any) -> dict[str, tuple[Array, str]]:
    """Name -> (signal at the judged samples, unit)."""
    s, k = plant.motion.signals, plant.every
    drive, rad = plant.units
    still = 0.01 * rms(s.velocity)
    return {
        "time": (s.time[::k], "s"), "position": (s.position[::k], rad), "velocity": (s.velocity[::k], f"{rad}/s"),
        "reversal": (since_reversal(s.velocity, plant.record.dt, still)[::k], "s"), "drive": (s.drive[::k], drive),
    }  # fmt: skip


def pictures(plant: Any, base: SimulatorModel, model: SimulatorModel) -> dict[str, Any]:
    """Overlay, gap over time, its spectra by frequency and by order, and its axes."""
    step, y, clock = plant.record.dt * plant.every, plant.record.position, plant.record.clock
    errors = plant.errors(base), plant.errors(model)
    gaps = errors[0][:: plant.every], errors[1][:: plant.every]
    return {
        "time": clock, "measured": y, "held": ~plant.train,
        "runs": {"before": y - errors[0], "after": y - errors[1]},
        "gap_time": clock[:: plant.every], "usable": np.ones(gaps[0].size, dtype=bool),
        "floor": plant.noise, "axes": signals(plant), "units": plant.units, "what": plant.gap_word,
        **spectra(*gaps, step, y[:: plant.every], np.arange(0.5, 40.0, 0.1)),
    }  # fmt: skip
