"""Displays in scikit-learn's manner: `from_estimator` computes, `plot` draws, attributes hold what was drawn.

matplotlib is imported only when something is drawn, so the library works without it.  Every display
keeps its ``figure_`` and ``axes_``.
"""

from whsklearn.plot.displays import (
    ConvergenceDisplay,
    EffectDisplay,
    HorizonDisplay,
    ResidualDisplay,
    TrackingDisplay,
    flat_parameters,
    parameter_paths,
)

__all__ = [
    "ConvergenceDisplay", "EffectDisplay", "HorizonDisplay", "ResidualDisplay", "TrackingDisplay", "flat_parameters",
    "parameter_paths",
]  # fmt: skip
