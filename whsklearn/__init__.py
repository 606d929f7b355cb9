"""Identify servo axes as Wiener-Hammerstein systems with friction, and find what the model misses."""

import whsklearn.metrics  # noqa: F401 - makes neg_nmse, neg_rmse and neg_abs_mu_e known to scikit-learn by name
from whsklearn.estimators import (
    MILSRegressor,
    MultiInnovationGradientRegressor,
    PEMRegressor,
    RLSRegressor,
    RMILSRegressor,
    SwarmRegressor,
)
from whsklearn.inverse_dynamics import InverseDynamicsLags
from whsklearn.lags import WienerHammersteinLags
from whsklearn.systems.servo import ServoAxis
from whsklearn.systems.wiener_hammerstein import WienerHammersteinSystem

__version__ = "0.1.0"

__all__ = [
    "InverseDynamicsLags",
    "MILSRegressor",
    "MultiInnovationGradientRegressor",
    "PEMRegressor",
    "RLSRegressor",
    "RMILSRegressor",
    "ServoAxis",
    "SwarmRegressor",
    "WienerHammersteinLags",
    "WienerHammersteinSystem",
]
