"""MLflow as the record of runs."""

from whsklearn.tracking.beside import BesideRun
from whsklearn.tracking.runs import (
    Run,
    Tracker,
    TrackingError,
    estimator_params,
    experiments,
    log_candidates,
    metric_name,
    open_tracker,
    tracking_uri,
)
from whsklearn.tracking.served import alias_of, model_requirements

__all__ = [
    "BesideRun",
    "Run",
    "Tracker",
    "TrackingError",
    "alias_of",
    "estimator_params",
    "experiments",
    "log_candidates",
    "metric_name",
    "model_requirements",
    "open_tracker",
    "tracking_uri",
]
