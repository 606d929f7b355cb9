"""Plants that the engine diagnoses: a servo axis, a Wiener-Hammerstein chain, an arm, or a user's own simulator."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from whsklearn.gap.data_check import UNEVEN
from whsklearn.gap.record import Array
from whsklearn.logs.load import Log
from whsklearn.logs.timebase import LONG_GAP
from whsklearn.logs.units import factor_of, own_units, unit_of


class Base(NamedTuple):
    """The settings of a base model."""

    law: Any = None  # friction law
    orders: tuple[int, ...] | None = None  # (n_a, n_b, n_c, n_d) of a chain
    direct: int = 0  # the number of blocks of a chain, of two, that have a direct path


def make_plant(model: Any, log: Any, y: Any, base: Base, *, tolerance: float, columns: dict[str, Any]) -> Any:
    """Make the plant for a kind of model. Raises ValueError if the kind is not known."""
    from whsklearn.models.arm import ArmModel
    from whsklearn.systems.arm import Arm
    from whsklearn.systems.servo import ServoAxis
    from whsklearn.systems.wiener_hammerstein import WienerHammersteinSystem

    if isinstance(log, Log):
        from whsklearn.gap.plants.from_log import taken_from

        chain = isinstance(model, WienerHammersteinSystem) or model == "wiener-hammerstein"
        log, columns = taken_from(log, "wiener-hammerstein" if chain else "servo")
    if isinstance(model, ServoAxis) or model == "servo":
        from whsklearn.gap.plants.servo import servo_plant

        return servo_plant(model, log, law=base.law, tolerance=tolerance, columns=columns)
    if isinstance(model, WienerHammersteinSystem) or model == "wiener-hammerstein":
        logged = unit_of(columns.get("input") or "", ""), unit_of(columns.get("output") or "", "")
        (by, into), (far, out) = map(factor_of, logged)
        u, v = _input_output(log, y, columns)
        plant = _chain(model, u * by, v * far, base, tolerance, *sampling(log, columns))
        plant.units, plant.logged, plant.own_units = (into, out), logged, own_units((into, out), logged)
        return plant
    if isinstance(model, (Arm, ArmModel)):
        from whsklearn.gap.plants.arm import arm_plant

        return arm_plant(model, log, law=base.law, tolerance=tolerance)
    if all(hasattr(model, name) for name in ("simulate", "refit", "with_effect")):
        from whsklearn.gap.plants.from_log import servo_record
        from whsklearn.gap.plants.simulator import SimulatorPlant

        return SimulatorPlant(model, servo_record(log, columns), tolerance=tolerance)
    raise ValueError(
        f"model is {model!r}; expected 'servo', 'wiener-hammerstein', a ServoAxis, a WienerHammersteinSystem, or an "
        "object with simulate, refit and with_effect."
    )


def _chain(
    model: Any, u: Array, y: Array, base: Base, tolerance: float, dt: float, at: NDArray[np.intp] | None
) -> Any:  # fmt: skip
    """The plant of a chain; orders, direct paths and law are taken from the system unless they are given."""
    from whsklearn.gap.plants.chain import ChainPlant

    system = None if isinstance(model, str) else model
    law, orders, direct = base
    if system is not None:
        orders = orders or tuple(v.size for v in (system.a, system.b, system.c, system.d))
        law, direct = law if law is not None else system.law, direct or system.direct
    orders = tuple(int(n) for n in orders or (2, 2, 2, 2))
    if len(orders) != 4 or min(orders[0], orders[2]) < 1 or min(orders) < 0:
        raise ValueError(f"orders are {orders}; expected n_a, n_b, n_c, n_d with n_a and n_c at least 1.")
    if direct not in (0, 1, 2):
        raise ValueError(f"direct is {direct}; expected the number of blocks with a direct path: 0, 1 or 2.")
    return ChainPlant(u, y, (law, orders, direct), tolerance=tolerance, dt=dt, at=at, given_model=system)


def holes_in(steps: Array) -> NDArray[np.bool_]:
    """Which steps of a clock are holes, shape (n,); none if so many are long that its samples come in bursts."""
    holes = steps >= LONG_GAP * np.median(steps)
    return np.asarray(holes & (np.mean(holes) <= UNEVEN))


def sampling(log: Any, columns: dict[str, Any]) -> tuple[float, NDArray[np.intp] | None]:
    """(mean step of an increasing time column, place of each sample on that grid if there are holes).

    The column is ``time_s`` if none is named; without one the step is 1.
    """
    if not isinstance(log, pd.DataFrame):
        return 1.0, None
    name = columns.get("time") or "time_s"
    if name not in log.columns:
        return 1.0, None
    time = pd.to_numeric(log[name], errors="coerce").to_numpy(dtype=float)
    steps = np.diff(time)
    if time.size < 2 or not np.all(np.isfinite(steps)) or np.any(steps <= 0):
        return 1.0, None
    holes = holes_in(steps)
    if not holes.any():
        return float((time[-1] - time[0]) / (time.size - 1)), None
    dt = float(steps[~holes].sum() / np.count_nonzero(~holes))
    return dt, np.concatenate([[0], np.cumsum(np.where(holes, np.rint(steps / dt), 1.0))]).astype(np.intp)


def _input_output(log: Any, y: Any, columns: dict[str, Any]) -> tuple[Array, Array]:
    """u and y, shape (n,) each, from a frame with named columns or from arrays."""
    if y is not None:
        u, v = np.asarray(log, dtype=float), np.asarray(y, dtype=float).reshape(-1)
        if u.ndim == 2 and u.shape[1] != 1:
            raise ValueError(f"The input has {u.shape[1]} columns; the gap workflow takes one input and one output.")
        if u.size != v.size:
            raise ValueError(f"{u.size} samples of the input and {v.size} of the output; give as many of each.")
        return u.reshape(-1), v
    frame = pd.DataFrame(log)
    picked = []
    for role in ("input", "output"):
        column = columns.get(role) or {"input": "u", "output": "y"}[role]
        if column not in frame.columns:
            have = ", ".join(map(str, frame.columns))
            raise ValueError(f"The log has no column {column!r} for the {role}; it has {have}. Name the right one.")
        picked.append(pd.to_numeric(frame[column], errors="coerce").to_numpy(dtype=float))
    return picked[0], picked[1]
