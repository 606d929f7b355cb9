"""MLflow as the record of runs."""

from whsklearn.tracking.beside import BesideRun
from whsklearn.tracking.runs import (
    Run,
    Tracker,
    TrackingError,
    estimator_params,
    experiments,
    log_candidates,
    open_tracker,
    tracking_uri,
)

__all__ = [
    "BesideRun", "Run", "Tracker", "TrackingError", "estimator_params", "experiments", "log_candidates", "open_tracker",
    "tracking_uri",
]  # fmt: skip
