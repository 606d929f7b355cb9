"""Is the data fit to identify from, is the model fit to be believed: tests that answer with figures."""

from whsklearn.validation.convergence import convergence_bound
from whsklearn.validation.excitation import Excitation, excitation
from whsklearn.validation.horizon import HorizonCurve, error_against_horizon
from whsklearn.validation.residuals import (
    CorrelationTest,
    WhitenessTest,
    cross_correlation_test,
    residual_tests,
    whiteness_test,
)
from whsklearn.validation.splitters import memory_length, time_series_split

__all__ = [
    "CorrelationTest", "Excitation", "HorizonCurve", "WhitenessTest", "convergence_bound", "cross_correlation_test",
    "error_against_horizon", "excitation", "memory_length", "residual_tests", "time_series_split", "whiteness_test",
]  # fmt: skip
