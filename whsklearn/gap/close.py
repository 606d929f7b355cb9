"""Proof of closure: the model runs on its own over held-out samples, restarted at a horizon.

Every restart takes position and velocity from the smoothed measurement, by the same rule for every model, so
what differs between before and after is the model alone.  The twist of a coupling, which nobody measured, is that
of the model as it was held near the record until then.
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


def smoothed(position: Array, dt: float) -> tuple[Array, Array]:
    """Position and velocity by local polynomials of degree 4 over 80 ms (Savitzky, Golay 1964)."""
    from scipy.signal import savgol_filter

    width = max(7, 2 * round(0.04 / dt) + 1)
    return savgol_filter(position, width, 4), savgol_filter(position, width, 4, deriv=1, delta=dt)


def restart_states(bench: Bench, model: AxisModel) -> tuple[tuple[Array, Array], Array]:
    """((angle, velocity), twist of the coupling with its rate) from which a run starts at any sample.

    The measurement smoothed, plus what sensor and smoothing take off the same model's own motion while it is held
    near the record: the knocks of a play are faster than any smoother that keeps the noise out.
    """
    dt = bench.scene.dt
    q, v = smoothed(bench.record.position, dt)
    y_hat, angle, speed, twist = bench.held_near(model)
    folded = any(t.kind.name == "sensor_rectification" for t in model.terms)  # unfolded at the restart
    if folded or not (np.all(np.isfinite(y_hat)) and np.all(np.isfinite(twist))):
        return (q, v), np.zeros((0, 2))
    own_q, own_v = smoothed(y_hat, dt)
    if model.load_side:
        angle, speed = angle - twist[:, 0], speed - twist[:, 1]
    return (q + angle - own_q, v + speed - own_v), twist


def free_run(bench: Bench, model: AxisModel, horizon: float) -> Array:
    """Simulated position, restarted every ``horizon`` seconds; shape (n,)."""
    every = max(1, round(horizon / bench.scene.dt))
    start, twist = restart_states(bench, model)
    return model.follow(
        bench.record.drive, bench.record.position, (0.0, 0.0), start=start, reset_every=every, twist=twist
    )[0]


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
