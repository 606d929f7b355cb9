"""The scikit-learn estimators: the recursions, and the baselines they are compared with."""

from whsklearn.estimators.differential_evolution import DifferentialEvolutionRegressor
from whsklearn.estimators.least_squares import (
    MILSRegressor,
    MultiInnovationGradientRegressor,
    RLSRegressor,
    RMILSRegressor,
)
from whsklearn.estimators.pem import PEMRegressor
from whsklearn.estimators.streaming_pem import StreamingPEMRegressor

__all__ = [
    "DifferentialEvolutionRegressor", "MILSRegressor", "MultiInnovationGradientRegressor", "PEMRegressor",
    "RLSRegressor", "RMILSRegressor", "StreamingPEMRegressor",
]  # fmt: skip
