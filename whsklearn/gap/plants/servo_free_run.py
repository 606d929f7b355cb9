"""Free runs of a servo model along the log, restarted at a horizon.

Every restart takes position and velocity from the smoothed measurement, by the same rule for every model, so
what differs between before and after is the model alone.  The twist of a coupling, which nobody measured, is that
of the model as it was held near the record until then.
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
WINDOWS = (0.08, 0.04, 0.02, 0.01, 0.005)  # s, of the smoother that gives a run its start


def smoothed(position: Array, dt: float, width: int) -> tuple[Array, Array]:
    """Position and velocity by local polynomials of degree 4 over ``width`` samples (Savitzky, Golay 1964)."""
    from scipy.signal import savgol_filter

    return savgol_filter(position, width, 4), savgol_filter(position, width, 4, deriv=1, delta=dt)


def smoothing_width(position: Array, dt: float, noise: float) -> int:
    """The widest window, in samples, that takes no more off the velocity than noise does.

    A narrow window's velocity differs from a wide one's by its own noise, known from the window's weights, and by what
    the wide one smooths away; the wide one goes while that is the smaller part (the rule of Lepski 1991 for a choice
    of bandwidth).  A motor that cogs at 70 Hz under a stiff loop would else start every run a radian a second wrong.
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
    """((angle, velocity), twist of the coupling with its rate) from which a run starts at any sample.

    The measurement smoothed, plus what sensor and smoothing take off the same model's own motion while it is held
    near the record: the knocks of a play are faster than any smoother that keeps the noise out.  A model that cannot be
    held near the record has no say in where it starts.
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
    """The longest horizon in s, 0.5 at the most, over which a torque not worth a name leaves a run near the path.

    ``tolerance`` of the rms drive pushes an axis off by tau h^2 / (2 J) or, where viscous friction holds it, tau h / B;
    the path over h is v h long.  Friction of a motor is never known better, so a longer run shows drift only.
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

    Where a motion runs over unstable places (a motor that cogs under a soft drive tips from tooth to tooth), the noise
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
    """Mean square of the innovation, finite for a model that runs away."""
    e = view.record.position - view.follow(model)[0]
    return float(np.mean(np.clip(np.nan_to_num(e, nan=1e6), -1e6, 1e6) ** 2))


def train_error(view: Any, model: AxisModel, horizon: float) -> float:
    """Rms of the free run over the samples that are not held out, infinite where it diverges."""
    fitted = ~held_out(view)
    e = (view.record.position - free_run(view, model, horizon))[fitted]
    return rms(e) if np.all(np.isfinite(e)) else float("inf")
