"""Correlation of one-step residuals."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from whsklearn._displays.look import COLOURS, Z95, Display

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray


class ResidualDisplay(Display):
    """Correlation of one-step residuals with themselves and with the input, with 95 % bands of 1.96 / sqrt(N).

    Parameters
    ----------
    residuals : array-like of shape (n,)
        One-step residuals e.
    u : array-like of shape (n,), optional
        Input, for the second panel.
    max_lag : int
        Largest lag shown.

    Examples
    --------
    >>> import numpy as np
    >>> from whsklearn.plot import ResidualDisplay
    >>> e = np.random.default_rng(0).normal(size=400)
    >>> round(ResidualDisplay(e, max_lag=20).band, 3)
    0.098
    """

    def __init__(self, residuals: ArrayLike, u: ArrayLike | None = None, *, max_lag: int = 25):
        self.residuals = np.asarray(residuals, dtype=float).ravel()
        n = self.residuals.size
        if not 1 <= max_lag < n:
            raise ValueError(f"max_lag is {max_lag} for {n} residuals; expected 1 to {n - 1}.")
        self.band = Z95 / float(np.sqrt(n))
        self.auto = _correlation(self.residuals, self.residuals, max_lag)[max_lag:]
        self.cross = None if u is None else _correlation(self.residuals, np.asarray(u, dtype=float).ravel(), max_lag)

    @classmethod
    def from_estimator(
        cls, estimator: Any, X: ArrayLike, y: ArrayLike, *, max_lag: int = 25, axes: Any = None
    ) -> ResidualDisplay:
        """Draw the one-step residuals of a fitted estimator."""
        residuals = np.asarray(y, dtype=float).ravel() - estimator.predict_ahead(X, y, horizon=1)
        return cls(residuals, np.asarray(X)[:, 0], max_lag=max_lag).plot(axes)

    def plot(self, axes: Any = None) -> ResidualDisplay:
        """Draw the autocorrelation, and the cross-correlation where there is an input."""
        panels = [("with themselves", np.arange(1, self.auto.size), self.auto[1:])]
        if self.cross is not None:
            lags = np.arange(self.cross.size) - self.cross.size // 2
            panels.append(("with the input", lags, self.cross))
        axes = self._axes(axes, 1, len(panels), (5.2 * len(panels), 3.6), sharey=True)
        for ax, (title, lags, values) in zip(axes, panels, strict=False):
            outside = np.abs(values) > self.band
            ax.axhspan(-self.band, self.band, color="0.88", linewidth=0)
            ax.vlines(lags, 0.0, values, color=np.where(outside, COLOURS[1], COLOURS[0]), linewidth=1.6)
            ax.axhline(0.0, color="0.3", linewidth=0.7)
            ax.set(xlabel="lag in samples", title=f"{title}: {outside.sum()} of {lags.size} outside the 95 % band")
            ax.title.set_fontsize("medium")
        axes[0].set_ylabel("correlation of residuals")
        return self


def _correlation(e: NDArray[np.float64], u: NDArray[np.float64], max_lag: int) -> NDArray[np.float64]:
    """Correlation of e(t) with u(t - lag) for lags of -max_lag to max_lag, biased as is usual."""
    e, u = e - e.mean(), u - u.mean()
    scale = np.sqrt((e @ e) * (u @ u)) or 1.0
    n = e.size
    return (
        np.array([e[max(0, k) : n + min(0, k)] @ u[max(0, -k) : n - max(0, k)] for k in range(-max_lag, max_lag + 1)])
        / scale
    )
