"""NMSE, mu_e and RMSE of the free run, and the error of parameters."""

from whsklearn.metrics.indices import SCORER_NAMES, abs_mu_e, free_run_scorer, mu_e, nmse, parameter_error, rmse

__all__ = ["SCORER_NAMES", "abs_mu_e", "free_run_scorer", "mu_e", "nmse", "parameter_error", "rmse"]
