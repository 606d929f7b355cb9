"""Free runs of a servo model along the log, restarted at a horizon.

Every restart takes position and velocity from the smoothed measurement, by the same rule for every model, so
what differs between before and after is the model alone.  The twist of a coupling, which nobody measured, is that
of the model as it was held near the record until then.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from whsklearn.gap.axis_model import AxisModel
from whsklearn.gap.record import blocks

Array = NDArray[Any]


def smoothed(position: Array, dt: float) -> tuple[Array, Array]:
    """Position and velocity by local polynomials of degree 4 over 80 ms (Savitzky, Golay 1964)."""
    from scipy.signal import savgol_filter

    width = max(7, 2 * round(0.04 / dt) + 1)
    return savgol_filter(position, width, 4), savgol_filter(position, width, 4, deriv=1, delta=dt)


def restart_states(view: Any, model: AxisModel) -> tuple[tuple[Array, Array], Array]:
    """((angle, velocity), twist of the coupling with its rate) from which a run starts at any sample.

    The measurement smoothed, plus what sensor and smoothing take off the same model's own motion while it is held
    near the record: the knocks of a play are faster than any smoother that keeps the noise out.
    """
    dt = view.scene.dt
    q, v = smoothed(view.record.position, dt)
    y_hat, angle, speed, twist = view.held_near(model)
    folded = any(t.kind.name == "sensor_rectification" for t in model.terms)  # unfolded at the restart
    if folded or not (np.all(np.isfinite(y_hat)) and np.all(np.isfinite(twist))):
        return (q, v), np.zeros((0, 2))
    own_q, own_v = smoothed(y_hat, dt)
    if model.load_side:
        angle, speed = angle - twist[:, 0], speed - twist[:, 1]
    return (q + angle - own_q, v + speed - own_v), twist


def free_run(view: Any, model: AxisModel, horizon: float) -> Array:
    """Simulated position, restarted every ``horizon`` seconds; shape (n,)."""
    every = max(1, round(horizon / view.scene.dt))
    start, twist = restart_states(view, model)
    return model.follow(
        view.record.drive, view.record.position, (0.0, 0.0), start=start, reset_every=every, twist=twist
    )[0]


def held_out(view: Any) -> NDArray[np.bool_]:
    """Held-out samples of the log, shape (n,), without the edges."""
    n = len(view.record)
    number, _ = blocks(n)
    mask = number >= 0
    edge = int(0.5 / view.scene.dt)
    mask[:edge] = False
    mask[n - view.filter.half_width :] = False
    return mask


def misfit(view: Any, model: AxisModel) -> float:
    """Mean square of the innovation, finite for a model that runs away."""
    e = view.record.position - view.follow(model)[0]
    return float(np.mean(np.clip(np.nan_to_num(e, nan=1e6), -1e6, 1e6) ** 2))


def train_error(view: Any, model: AxisModel, horizon: float) -> float:
    """Rms of the free run over the samples that are not held out, infinite where it diverges."""
    fitted = ~held_out(view)
    e = (view.record.position - free_run(view, model, horizon))[fitted]
    return float(np.sqrt(np.mean(e**2))) if np.all(np.isfinite(e)) else float("inf")
