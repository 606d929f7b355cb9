"""Displays in scikit-learn's manner: `from_estimator` computes, `plot` draws, attributes hold what was drawn.

matplotlib is imported only when something is drawn, so the library works without it.  Every display
keeps its ``figure_`` and ``axes_``.
"""

from whsklearn._displays.convergence import ConvergenceDisplay
from whsklearn._displays.friction import FrictionDisplay
from whsklearn._displays.horizon import HorizonDisplay
from whsklearn._displays.parameters import flat_parameters, parameter_paths
from whsklearn._displays.residual import ResidualDisplay
from whsklearn._displays.tracking import TrackingDisplay

__all__ = [
    "ConvergenceDisplay",
    "FrictionDisplay",
    "HorizonDisplay",
    "ResidualDisplay",
    "TrackingDisplay",
    "flat_parameters",
    "parameter_paths",
]
