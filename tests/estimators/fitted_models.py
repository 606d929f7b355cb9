"""One estimator of each kind, small and quick."""

from __future__ import annotations

from whsklearn import (
    DifferentialEvolutionRegressor,
    MultiInnovationGradientRegressor,
    PEMRegressor,
    RMILSRegressor,
    WienerHammersteinLags,
)
from whsklearn.effects.law import polynomial_law

FAST = {"n_starts": 2, "memory": 64, "random_state": 0}
MODELS = {
    "RMILS": RMILSRegressor(WienerHammersteinLags(), **FAST),
    "published": RMILSRegressor(WienerHammersteinLags(), gradient="pseudolinear"),
    "gradient": MultiInnovationGradientRegressor(WienerHammersteinLags()),
    "PEM": PEMRegressor(n_starts=1, random_state=0),
    "swarm": DifferentialEvolutionRegressor(n_generations=2, random_state=0),
    "polynomial": RMILSRegressor(WienerHammersteinLags(1, 0, 2, 1, law=polynomial_law([0.0, 1.0, 0.3])), **FAST),
}
