"""Lagged regressors as transformers that carry their state."""

from whsklearn.lags.inverse_dynamics import InverseDynamicsLags
from whsklearn.lags.rigid_body import RigidBodyLags
from whsklearn.lags.wiener_hammerstein import WienerHammersteinLags

__all__ = ["InverseDynamicsLags", "RigidBodyLags", "WienerHammersteinLags"]
