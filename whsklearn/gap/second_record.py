"""The repaired model on another record of the same axis, without refitting any parameter."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np

from whsklearn.gap.own_units import rows_in
from whsklearn.gap.plants import Base, make_plant
from whsklearn.gap.proof import free_run_error
from whsklearn.logs.overlap import shared_run


def on_second_record(finder: Any, log: Any, **columns: str | None) -> list[dict[str, float]]:
    """Free-run errors of the base and the repaired model on another record, one row per horizon.

    Parameters
    ----------
    finder : GapFinder
        Fitted, with a plant of the engine's own (a servo axis or a simulator).
    log : record or DataFrame
        As `GapFinder.fit` takes it.

    Returns
    -------
    list of dict
        ``horizon`` (s), ``before`` and ``after`` (RMSE in the unit of the first record's position).

    Raises
    ------
    ValueError
        If the record cannot be used, holds samples of the one that was fitted, or there is no model to carry over.
    """
    found = getattr(finder, "found_", None)
    if found is None:
        raise ValueError("There is no model to test: the diagnosis ended before one was fitted, or is of a chain.")
    base = Base(finder.law, finder.orders, finder.direct)
    plant = make_plant(finder.model, log, None, base, tolerance=finder.tolerance, columns=columns)
    fatal = [p for p in plant.check() if p.fatal]
    if fatal:
        raise ValueError(f"The second record cannot be used: {fatal[0].explanation}")
    here = plant.base(np.random.default_rng(finder.random_state))  # sets the plant up; its numbers are not used
    fitted = finder.plant_
    if plant.units != fitted.units:
        raise ValueError(
            f"The second record has its drive in {plant.logged[0]} and its position in {plant.logged[1]}, the first in "
            f"{fitted.logged[0]} and {fitted.logged[1]}, and one cannot be brought to the other; give a record of the "
            "same quantities."
        )
    signals = [np.column_stack([p.record.drive, p.record.position]) for p in (fitted, plant)]
    if shared_run(*signals) is not None:
        raise ValueError(
            "It holds samples of the record that was fitted, and a test on these tests nothing; give another run."
        )
    rows = []
    for horizon in plant.horizons:
        before, after = (free_run_error(plant, _moved(m, here), horizon).rmse for m in (found.base, found.model))
        rows.append({"horizon": horizon, "before": before, "after": after})
    return rows_in(rows, plant.units[1], fitted.own_units, "before", "after")


def _moved(model: Any, here: Any) -> Any:
    """A model with the sampling and the scale of another record."""
    return dataclasses.replace(model, scene=here.scene) if hasattr(here, "scene") else model
