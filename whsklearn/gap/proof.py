"""Proof of closure: the model runs on its own over held-out samples, and over a second record if there is one."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np

from whsklearn.effects.base import rms
from whsklearn.gap.calibration import N_OWN
from whsklearn.gap.diagnosis import rows_in
from whsklearn.gap.plants import Base, make_plant
from whsklearn.gap.search import SAME
from whsklearn.logs.overlap import shared_run


def free_run_error(plant: Any, model: Any, horizon: float, *beside: Any) -> dict[str, float]:
    """``nmse``, ``mu_e`` and ``rmse`` of the free run on the held-out samples that compare it with ``beside``, too.

    ``beside``: other models. The errors of a run that diverges are limited to ten times the range of the output.
    """
    y, held = plant.measured(*beside)
    y_hat = plant.simulate(model, horizon)
    worst = 10.0 * float(np.ptp(y))
    e = np.clip(np.nan_to_num((y - y_hat)[held], nan=worst, posinf=worst, neginf=-worst), -worst, worst)
    return {"nmse": float(np.mean(e**2) / np.var(y[held])), "mu_e": float(np.mean(e)), "rmse": rms(e)}


def closure(before: float, after: float, floor: float, spread: float = np.inf) -> float:
    """Share of the gap that is closed, 1 - (after - floor) / (before - floor), within -1 and 1.

    ``spread`` is the error without a model, the standard deviation of the record.  The error of a base model that
    diverges is larger and would let any repair close the whole gap.  The gap is therefore counted from ``spread``, and
    a repaired model that is no better than none has closed nothing.

    >>> closure(2.0, 1.1, 1.0)
    0.9
    >>> closure(1000.0, 2.5, 0.0, spread=5.0), closure(1000.0, 6.0, 0.0, spread=5.0)
    (0.5, 0.0)
    """
    if before > spread:
        if spread <= after <= before:
            return 0.0
        before = spread if after < spread else before
    gap = before - floor
    if after > before * (1.0 + SAME):
        return float(max(-1.0, (before - after) / max(gap, SAME * before)))
    if gap <= SAME * floor:
        return 0.0
    return float(np.clip(round(1.0 - (after - floor) / gap, 12), -1.0, 1.0))


def prove(
    plant: Any, base: Any, model: Any, rng: np.random.Generator, given: tuple[Any, Any] | None = None
) -> list[dict[str, Any]]:
    """One row per horizon: errors before and after, the floor and the closure.

    The floor of a horizon is the error of the repaired model against records that it simulated itself, restarted by
    the same rule: the error due to noise in the restarts and, for an axis, in the reading of the drive.  Where friction
    sticks and slips, one record has half again the floor of another, so it is the rms over `N_OWN` of them; exact
    records differ by their noise only.
    Both runs of the log use the same restarts, so an error below this floor is a chance result of the noise, and the
    floor is never printed above it.  ``given`` is the record as it was given and its base model, if the plant has
    repaired a reading (`whsklearn.gap.plant.Reading`); the error before is then computed from these.
    """
    others = [plant.made(model, rng) for _ in range(1 if plant.exact else N_OWN)]
    y, held = plant.measured(base, model)
    spread = float(np.std(y[held]))
    other_record, first = given or (plant, base)
    rows = []
    for horizon in plant.horizons:
        after = free_run_error(plant, model, horizon, base, model)
        same = other_record is plant and first is model
        before = after if same else free_run_error(other_record, first, horizon, base, model)
        own = rms(np.array([free_run_error(other, model, horizon)["rmse"] for other in others]))
        floor = min(own, after["rmse"], before["rmse"])
        rows.append({
            "horizon": horizon, "before": before["rmse"], "after": after["rmse"], "floor": floor,
            "closure": closure(before["rmse"], after["rmse"], floor, spread), "first": before, "last": after,
        })  # fmt: skip
    return rows


def on_second_record(finder: Any, log: Any, **columns: str | None) -> list[dict[str, float]]:
    """Free-run errors of the base and the repaired model on another record, one row per horizon.

    ``finder``: fitted, with a plant of the engine's own (a servo axis or a simulator).
    ``log``: as `GapFinder.fit` takes it.
    Returns ``horizon`` (s), ``before`` and ``after`` (RMSE in the unit of the first record's position).
    Raises ValueError if the record cannot be used or contains samples of the fitted one, or if there is no model to
        transfer.
    """
    found = getattr(finder, "found_", None)
    if found is None:
        raise ValueError("There is no model to test: the diagnosis ended before one was fitted, or is of a chain.")
    base = Base(finder.law, finder.orders, finder.direct)
    plant = make_plant(finder.model, log, None, base, tolerance=finder.tolerance, columns=columns)
    fatal = [p for p in plant.check() if p.fatal]
    if fatal:
        raise ValueError(f"The second record cannot be used: {fatal[0].explanation}")
    here = plant.base(np.random.default_rng(finder.random_state))  # sets up the plant; its numbers are not used
    fitted = finder.plant_
    if plant.units != fitted.units:
        raise ValueError(
            f"The second record has its drive in {plant.logged[0]} and its position in {plant.logged[1]}, the first in "
            f"{fitted.logged[0]} and {fitted.logged[1]}, which cannot be converted; give a record of the "
            "same quantities."
        )
    signals = [np.column_stack([p.record.drive, p.record.position]) for p in (fitted, plant)]
    if shared_run(*signals) is not None:
        raise ValueError("It contains samples of the record that was fitted, so it is no test; give another run.")
    models = [found.base, found.model]
    if hasattr(here, "scene"):  # with the sampling and the scale of this record
        models = [dataclasses.replace(m, scene=here.scene) for m in models]
    rows = []
    for horizon in plant.horizons:
        before, after = (free_run_error(plant, m, horizon)["rmse"] for m in models)
        rows.append({"horizon": horizon, "before": before, "after": after})
    return rows_in(rows, plant.units[1], fitted.own_units, "before", "after")
