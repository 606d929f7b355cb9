"""Proof of closure: the model runs on its own over held-out samples, restarted at a horizon.

Every restart takes position and velocity from the smoothed measurement, the same for every model, so
what differs between before and after is the model alone.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from whsklearn.gap.axis_model import AxisModel
from whsklearn.gap.bench import Bench
from whsklearn.gap.record import blocks

Array = NDArray[Any]
HORIZONS = (0.1, 0.5, 2.0)  # s


@dataclass(frozen=True)
class Simulation:
    """Errors of one simulation on held-out samples, y - y_hat."""

    nmse: float
    mu_e: float
    rmse: float

    def as_dict(self) -> dict[str, float]:
        """For the report's file."""
        return {"nmse": self.nmse, "mu_e": self.mu_e, "rmse": self.rmse}


def restart_states(bench: Bench) -> tuple[Array, Array]:
    """Position and velocity at every sample by local polynomials of degree 4 over 80 ms (Savitzky, Golay 1964)."""
    from scipy.signal import savgol_filter

    dt = bench.scene.dt
    width = max(7, 2 * round(0.04 / dt) + 1)
    y = bench.record.position
    return savgol_filter(y, width, 4), savgol_filter(y, width, 4, deriv=1, delta=dt)


def free_run(bench: Bench, model: AxisModel, horizon: float) -> Array:
    """Simulated position, restarted every ``horizon`` seconds; shape (n,)."""
    every = max(1, round(horizon / bench.scene.dt))
    y_hat, _, _ = model.follow(
        bench.record.drive, bench.record.position, (0.0, 0.0), start=restart_states(bench), reset_every=every
    )
    return y_hat


def held_out(bench: Bench) -> NDArray[np.bool_]:
    """Held-out samples of the log, shape (n,), without the edges."""
    n = len(bench.record)
    number, _ = blocks(n)
    mask = number >= 0
    edge = int(0.5 / bench.scene.dt)
    mask[:edge] = False
    mask[n - bench.lens.half_width :] = False
    return mask


def simulation_error(bench: Bench, model: AxisModel, horizon: float = 0.5) -> Simulation:
    """NMSE, mean error and RMSE of the free run on held-out samples."""
    y = bench.record.position
    mask = held_out(bench)
    e = (y - free_run(bench, model, horizon))[mask]
    e = np.clip(np.nan_to_num(e, nan=1e6), -1e6, 1e6)
    return Simulation(float(np.mean(e**2) / np.var(y[mask])), float(np.mean(e)), float(np.sqrt(np.mean(e**2))))


def closure(before: float, after: float, floor: float) -> float:
    """Share of the gap that is gone, 1 - (after - floor) / (before - floor), within -1 and 1."""
    gap = before - floor
    if gap <= 1e-3 * floor:
        return 0.0
    return float(np.clip(1.0 - (after - floor) / gap, -1.0, 1.0))
