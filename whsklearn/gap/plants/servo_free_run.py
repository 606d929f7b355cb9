"""Free runs of a servo model along the log, restarted at a horizon.

Every restart takes position and velocity from the smoothed measurement, by the same rule for every model, so that only
the model differs between before and after.  The twist of a coupling, which is not measured, is that of the model held
near the record up to the restart.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from whsklearn.gap.plants import servo_evidence as rules
from whsklearn.gap.plants.servo_model import AxisModel
from whsklearn.gap.record import held_out_blocks, rms

Array = NDArray[Any]
WINDOWS = (0.08, 0.04, 0.02, 0.01, 0.005)  # s, of the smoother that gives the start of a run


def smoothed(position: Array, dt: float, width: int) -> tuple[Array, Array]:
    """Position and velocity by local polynomials of degree 4 over ``width`` samples (Savitzky, Golay 1964)."""
    from scipy.signal import savgol_filter

    return savgol_filter(position, width, 4), savgol_filter(position, width, 4, deriv=1, delta=dt)


def smoothing_width(position: Array, dt: float, noise: float) -> int:
    """The widest window, in samples, that changes the velocity by no more than noise does.

    The velocity of a narrow window differs from that of a wide one by its own noise, known from the window's weights,
    and by the motion that the wide one smooths away.  The wide one is used while the second part is smaller (Lepski's
    rule of 1991 for choosing a bandwidth).  Otherwise, with a motor that cogs at 70 Hz under a stiff loop, every run
    would start with an error of a radian per second.
    """
    from scipy.signal import savgol_coeffs

    widths = sorted({max(7, 2 * round(w / 2 / dt) + 1) for w in WINDOWS}, reverse=True)
    for wide, narrow in pairwise(widths):
        apart = smoothed(position, dt, wide)[1] - smoothed(position, dt, narrow)[1]
        own = noise * float(np.linalg.norm(savgol_coeffs(narrow, 4, deriv=1, delta=dt)))
        if float(np.mean(apart[wide:-wide] ** 2)) < rules.AS_NOISE * own**2:
            return wide
    return widths[-1]


def restart_states(view: Any, model: AxisModel) -> tuple[tuple[Array, Array], Array]:
    """((angle, velocity), twist of the coupling with its rate) from which a run starts, at every sample.

    The state is the smoothed measurement plus whatever sensor and smoothing remove from the model's own motion while
    it is held near the record, because the impacts of play are faster than any smoother that suppresses the noise.  A
    model that cannot be held near the record does not affect its start.
    """
    dt = view.scene.dt
    width = smoothing_width(view.record.position, dt, view.noise)
    q, v = view.record.by_piece(lambda x: smoothed(x, dt, width), view.record.position)
    y_hat, angle, speed, twist = view.held_near(model)
    folded = any(t.kind.name == "sensor_rectification" for t in model.terms)  # unfolded at the restart
    if folded or not (np.all(np.isfinite(y_hat)) and np.all(np.isfinite(twist))):
        return (q, v), np.zeros((0, 2))
    own_q, own_v = view.record.by_piece(lambda x: smoothed(x, dt, width), y_hat)
    if model.load_side:
        angle, speed = angle - twist[:, 0], speed - twist[:, 1]
    if rms(speed - own_v) > rules.OWN_MOTION * view.scene.speed:
        return (q, v), np.zeros((0, 2))
    return (q + angle - own_q, v + speed - own_v), twist


def horizon_of(model: AxisModel, scene: Any, tolerance: float) -> float:
    """The longest horizon in s, at most 0.5, over which a torque not worth a name keeps a run near the path.

    ``tolerance`` of the rms drive displaces an axis by tau h^2 / (2 J) or, if viscous friction dominates, by tau h /
    B; the path over h has the length v h.  The friction of a motor is never known better, so a longer run shows only
    drift.
    """
    viscous = sum(t.q[0] for t in model.terms if t.name == "viscous")
    error = tolerance * scene.torque
    if error <= rules.OFF_PATH * viscous * scene.speed:
        return rules.LONGEST_RUN
    longest = 2.0 * rules.OFF_PATH * scene.speed * model.inertia / error
    digits = 10.0 ** np.floor(np.log10(longest))
    return float(np.clip(round(longest / digits) * digits, 10 * scene.dt, rules.LONGEST_RUN))


def predictable(surrogate: Any, model: AxisModel, longest: float) -> float:
    """The longest horizon up to ``longest`` (s) over which the model predicts a record that it made itself.

    If a motion passes unstable positions (a motor that cogs under a soft drive tips from tooth to tooth), the noise
    of a restart grows until a run shows nothing, whatever the model.
    """
    horizons = [longest, *(h for h in rules.SHORTER_RUNS if 10 * model.scene.dt <= h < longest)]
    held = held_out(surrogate)
    for h in horizons:
        e = (surrogate.record.position - free_run(surrogate, model, h))[held]
        if np.all(np.isfinite(e)) and rms(e) < rules.OWN_ERROR * h * model.scene.speed:
            return h
    return longest


def free_run(view: Any, model: AxisModel, horizon: float) -> Array:
    """Simulated position, restarted every ``horizon`` seconds; shape (n,)."""
    every = max(1, round(horizon / view.scene.dt))
    start, twist = restart_states(view, model)
    return model.follow(
        view.record.drive, view.record.position, (0.0, 0.0), start=start, reset_every=every, twist=twist,
        pieces=view.record.pieces,
    )[0]  # fmt: skip


def held_out(view: Any) -> NDArray[np.bool_]:
    """Held-out samples of the log, shape (n,), without the edges."""
    n = len(view.record)
    number, _ = held_out_blocks(n)
    mask = number >= 0
    edge = int(0.5 / view.scene.dt)
    mask[:edge] = False
    mask[n - view.filter.half_width :] = False
    return mask & ~view.record.near_a_hole(view.filter.half_width, edge)


def misfit(view: Any, model: AxisModel) -> float:
    """Mean square of the innovation; finite even for a model that diverges."""
    e = view.record.position - view.follow(model)[0]
    return float(np.mean(np.clip(np.nan_to_num(e, nan=1e6), -1e6, 1e6) ** 2))


def train_error(view: Any, model: AxisModel, horizon: float) -> float:
    """Rms error of the free run over the samples that are not held out; infinite if it diverges."""
    fitted = ~held_out(view)
    e = (view.record.position - free_run(view, model, horizon))[fitted]
    return rms(e) if np.all(np.isfinite(e)) else float("inf")
