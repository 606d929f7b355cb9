"""Shared by the batch fit and the block-by-block fit of a Wiener-Hammerstein chain."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from sklearn.base import clone
from sklearn.utils.validation import check_is_fitted

from whsklearn.estimators import _model as wh
from whsklearn.estimators.base import AxisRegressor
from whsklearn.lags.wiener_hammerstein import WienerHammersteinLags

Array = NDArray[np.float64]


class ChainRegressor(AxisRegressor):
    """A chain whose orders and law may be found by the fit; blocks may have direct paths.

    A subclass provides its natural vector and covariance, and reports in `_found_lags` what the fit found.
    """

    @property
    def _is_wiener_hammerstein(self) -> bool:
        return True

    @property
    def _takes_direct_paths(self) -> bool:
        return True

    @property
    def _given_lags(self) -> WienerHammersteinLags:
        return WienerHammersteinLags() if self.lags is None else self.lags

    def _found_lags(self) -> dict[str, Any] | None:
        """The lag settings that the fit found; None if it did not search for any."""
        raise NotImplementedError

    @property
    def _lags(self) -> WienerHammersteinLags:
        found = self._found_lags() if "state_" in self.__dict__ else None
        return super()._lags if found is None else WienerHammersteinLags(**found)

    @property
    def structure_(self) -> WienerHammersteinLags:
        """Orders, law and delays that the fit found."""
        check_is_fitted(self, "state_")
        return clone(self._lags)

    def _noise_filter(self, natural: Array, structure: wh.Structure) -> Array:
        return np.empty(0) if self._fits_free_run else super()._noise_filter(natural, structure)

    def _theta(self) -> Array:
        return wh.paper_vector(self._natural(), self._structure())

    def _covariance(self) -> Array:
        jacobian = wh.paper_jacobian(self._natural(), self._structure())
        return jacobian @ self._natural_covariance() @ jacobian.T

    def __sklearn_tags__(self) -> Any:
        tags = super().__sklearn_tags__()
        tags.regressor_tags.poor_score = True
        return tags
