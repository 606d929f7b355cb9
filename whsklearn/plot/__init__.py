"""Displays in scikit-learn's manner: `from_estimator` computes, `plot` draws, attributes hold what was drawn.

matplotlib is imported only when something is drawn, so the library works without it.  Every display
keeps its ``figure_`` and ``axes_``.
"""

from whsklearn.plot.convergence import ConvergenceDisplay
from whsklearn.plot.effect import EffectDisplay
from whsklearn.plot.friction import FrictionDisplay
from whsklearn.plot.horizon import HorizonDisplay
from whsklearn.plot.parameters import flat_parameters, parameter_paths
from whsklearn.plot.residual import ResidualDisplay
from whsklearn.plot.tracking import TrackingDisplay

__all__ = [
    "ConvergenceDisplay",
    "EffectDisplay",
    "FrictionDisplay",
    "HorizonDisplay",
    "ResidualDisplay",
    "TrackingDisplay",
    "flat_parameters",
    "parameter_paths",
]
