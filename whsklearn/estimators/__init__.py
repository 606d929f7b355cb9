"""The scikit-learn estimators: the recursions, and the baselines they are compared with."""

from whsklearn.estimators.differential_evolution import DifferentialEvolutionRegressor
from whsklearn.estimators.gradient import MultiInnovationGradientRegressor
from whsklearn.estimators.mils import MILSRegressor
from whsklearn.estimators.pem import PEMRegressor
from whsklearn.estimators.rls import RLSRegressor
from whsklearn.estimators.rmils import RMILSRegressor
from whsklearn.estimators.streaming_pem import StreamingPEMRegressor

__all__ = [
    "DifferentialEvolutionRegressor",
    "MILSRegressor",
    "MultiInnovationGradientRegressor",
    "PEMRegressor",
    "RLSRegressor",
    "RMILSRegressor",
    "StreamingPEMRegressor",
]
