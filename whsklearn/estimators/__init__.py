"""The scikit-learn faces of the recursions, and the yardsticks they are held against."""

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
