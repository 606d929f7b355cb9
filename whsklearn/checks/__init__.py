"""Contracts of effects and of streaming estimators, for the library's own and for yours."""

from whsklearn.checks.effects import EffectContractError, check_effect
from whsklearn.checks.scikit_learn import expected_failed_checks
from whsklearn.checks.streaming import check_streaming, state_difference, streaming_checks

__all__ = [
    "EffectContractError", "check_effect", "check_streaming", "expected_failed_checks", "state_difference",
    "streaming_checks",
]  # fmt: skip
