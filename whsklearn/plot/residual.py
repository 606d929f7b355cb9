"""Correlation of one-step residuals."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from whsklearn.plot.look import COLOURS, Display
from whsklearn.validation import cross_correlation_test, whiteness_test


class ResidualDisplay(Display):
    """Correlation of one-step residuals with themselves and with the input, with 95 % bands of 1.96 / sqrt(N).

    Parameters
    ----------
    residuals : array-like of shape (n,)
        One-step residuals e.
    u : array-like of shape (n,), optional
        Input, for the second panel.
    max_lag : int, optional
        Largest lag shown; 25, or fewer where the record is short.

    Attributes
    ----------
    whiteness, dependence : WhitenessTest, CorrelationTest
        The tests of `whsklearn.validation` behind the panels; their p-values are in the titles.

    References
    ----------
    scikit-learn developer's guide, Developing with the plotting API;
    Ljung 1999, System Identification, 2nd ed., sec. 16.6, Residual analysis.

    Examples
    --------
    >>> import numpy as np
    >>> from whsklearn.plot import ResidualDisplay
    >>> e = np.random.default_rng(0).normal(size=400)
    >>> round(ResidualDisplay(e, max_lag=20).band, 3)
    0.098
    """

    def __init__(self, residuals: ArrayLike, u: ArrayLike | None = None, *, max_lag: int | None = None):
        self.residuals = np.asarray(residuals, dtype=float).ravel()
        max_lag = max(1, min(25, self.residuals.size // 21)) if max_lag is None else max_lag
        self.whiteness = whiteness_test(self.residuals, max_lag)
        self.band = self.whiteness.band
        self.dependence = None
        if u is not None:
            signal = np.asarray(u, dtype=float).ravel()
            self.dependence = cross_correlation_test(self.residuals, signal, max_lag, negative_lags=True)

    @classmethod
    def from_estimator(
        cls, estimator: Any, X: ArrayLike, y: ArrayLike, *, max_lag: int | None = None, axes: Any = None
    ) -> ResidualDisplay:
        """Draw the one-step residuals of a fitted estimator.

        Parameters
        ----------
        estimator : estimator
            Fitted.
        X : array-like of shape (n, n_features)
            Input.
        y : array-like of shape (n,)
            Output.
        max_lag : int, optional
            In samples.
        axes : array of matplotlib axes, optional
            Where to draw; a new figure by default.
        """
        residuals = np.asarray(y, dtype=float).ravel() - estimator.predict_ahead(X, y, horizon=1)
        return cls(residuals, np.asarray(X)[:, 0], max_lag=max_lag).plot(axes)

    def plot(self, axes: Any = None) -> ResidualDisplay:
        """Draw the autocorrelation, and the cross-correlation where there is an input.

        Parameters
        ----------
        axes : array of matplotlib axes, optional
            Where to draw; a new figure by default.
        """
        panels = [("with themselves", self.whiteness.lags, self.whiteness.r, self.whiteness.p_value)]
        if self.dependence is not None:
            panels.append(("with the input", self.dependence.lags, self.dependence.r, self.dependence.p_value))
        axes = self._axes(axes, 1, len(panels), (5.6 * len(panels), 3.6), sharey=True)
        for ax, (title, lags, values, p_value) in zip(axes, panels, strict=False):
            outside = np.abs(values) > self.band
            ax.axhspan(-self.band, self.band, color="0.88", linewidth=0)
            ax.vlines(lags, 0.0, values, color=np.where(outside, COLOURS[1], COLOURS[0]), linewidth=1.6)
            ax.axhline(0.0, color="0.3", linewidth=0.7)
            ax.set_xlabel("lag in samples")
            ax.set_title(f"{title}: {outside.sum()} of {lags.size} outside 95 %, p = {p_value:.2g}", size="medium")
        axes[0].set_ylabel("correlation of residuals")
        return self
