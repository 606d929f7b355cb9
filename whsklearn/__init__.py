"""Identify servo axes as Wiener-Hammerstein systems with friction, and find what the model misses."""

import typing as _typing

if _typing.TYPE_CHECKING:
    from whsklearn.estimators import (
        DifferentialEvolutionRegressor,
        MILSRegressor,
        MultiInnovationGradientRegressor,
        PEMRegressor,
        RLSRegressor,
        RMILSRegressor,
        StreamingPEMRegressor,
    )
    from whsklearn.lags.inverse_dynamics import InverseDynamicsLags
    from whsklearn.lags.rigid_body import RigidBodyLags
    from whsklearn.lags.wiener_hammerstein import WienerHammersteinLags
    from whsklearn.systems.arm import Arm
    from whsklearn.systems.servo import ServoAxis
    from whsklearn.systems.wiener_hammerstein import WienerHammersteinSystem

__version__ = "0.1.0"

__all__ = [
    "Arm", "DifferentialEvolutionRegressor", "InverseDynamicsLags", "MILSRegressor", "MultiInnovationGradientRegressor",
    "PEMRegressor", "RLSRegressor", "RMILSRegressor", "RigidBodyLags", "ServoAxis", "StreamingPEMRegressor",
    "WienerHammersteinLags", "WienerHammersteinSystem",
]  # fmt: skip

# Names come on first use (PEP 562): Numba and scikit-learn take over a second, and `whsklearn --help` needs neither.
_ELSEWHERE = {
    "InverseDynamicsLags": "whsklearn.lags.inverse_dynamics",
    "WienerHammersteinLags": "whsklearn.lags.wiener_hammerstein",
    "Arm": "whsklearn.systems.arm",
    "RigidBodyLags": "whsklearn.lags.rigid_body",
    "ServoAxis": "whsklearn.systems.servo",
    "WienerHammersteinSystem": "whsklearn.systems.wiener_hammerstein",
}


def __getattr__(name: str) -> _typing.Any:
    if name not in __all__:
        raise AttributeError(f"module 'whsklearn' has no attribute {name!r}")
    import importlib

    importlib.import_module("whsklearn.metrics.indices")  # makes neg_nmse, neg_rmse, neg_abs_mu_e known to scikit-learn
    value = getattr(importlib.import_module(_ELSEWHERE.get(name, "whsklearn.estimators")), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*__all__, *(name for name in globals() if not name.startswith("_") or name.startswith("__"))})
