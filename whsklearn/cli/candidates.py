"""The estimators that the jobs compare, in the order of the tables."""

from __future__ import annotations

from typing import Any

from whsklearn import (
    DifferentialEvolutionRegressor,
    MILSRegressor,
    MultiInnovationGradientRegressor,
    PEMRegressor,
    RLSRegressor,
    RMILSRegressor,
    WienerHammersteinLags,
)
from whsklearn.cli.comparison import ComparedModel

PUBLISHED: dict[str, Any] = {
    "gradient": "pseudolinear",
    "theta0": 0.01,
    "P0": 1e6,
}  # the article's start, theta(0) = 1/100


def candidates(
    lags: WienerHammersteinLags,
    *,
    p: int = 4,
    seed: int = 0,
    evolution: bool = False,
    published: dict[str, Any] | None = None,
) -> list[ComparedModel]:
    """Both readings of RLS, MILS and RMILS, the gradient scheme, and the batch fit for comparison."""
    old: dict[str, Any] = {**PUBLISHED, **(published or {})}
    common: dict[str, Any] = {"lags": lags, "random_state": seed}
    found = [
        ComparedModel("RLS", RLSRegressor(**common, **old), "pseudolinear"),
        ComparedModel("MILS", MILSRegressor(**common, p=p, **old), "pseudolinear"),
        ComparedModel("RMILS", RMILSRegressor(**common, p=p, **old), "pseudolinear"),
        ComparedModel(
            "gradient", MultiInnovationGradientRegressor(lags=lags, p=p, theta0=old["theta0"]), "pseudolinear"
        ),
        ComparedModel("RLS", RLSRegressor(**common), "full"),
        ComparedModel("MILS", MILSRegressor(**common, p=p), "full"),
        ComparedModel("RMILS", RMILSRegressor(**common, p=p), "full"),
        ComparedModel("PEM", PEMRegressor(**common), "batch", stream=False),
    ]
    if evolution:
        found.append(
            ComparedModel("differential evolution", DifferentialEvolutionRegressor(**common), "batch", stream=False)
        )
    return found
