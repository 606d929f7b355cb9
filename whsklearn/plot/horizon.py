"""Error against the prediction horizon."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from whsklearn.plot.look import COLOURS, TRUTH, Display
from whsklearn.validation import error_against_horizon

HORIZONS = (1, 2, 3, 5, 8, 13, 21, 34, 55)


class HorizonDisplay(Display):
    """NMSE against the prediction horizon, up to the free run: *the* validation picture.

    A model that is good one step ahead and poor in free run has learned the sensor's memory, not the axis.

    Parameters
    ----------
    horizons : array-like of shape (n,)
        Steps ahead.
    errors : mapping of str to array-like of shape (n,)
        NMSE at each, by model.
    free_run : mapping of str to float
        NMSE of the free run, by model.

    References
    ----------
    scikit-learn developer's guide, Developing with the plotting API;
    Ljung 1999, System Identification, 2nd ed., sec. 16.4, on k-step prediction as a validation.

    Examples
    --------
    >>> from whsklearn.plot import HorizonDisplay
    >>> display = HorizonDisplay([1, 10, 100], {"no friction": [1e-4, 0.02, 0.09]}, {"no friction": 0.1}).plot()
    >>> display.axes_[0].get_xlabel()
    'steps ahead'
    """

    def __init__(self, horizons: ArrayLike, errors: Mapping[str, ArrayLike], free_run: Mapping[str, float]):
        self.horizons = np.asarray(horizons)
        self.errors = {k: np.asarray(v, dtype=float) for k, v in errors.items()}
        self.free_run = dict(free_run)

    @classmethod
    def from_estimator(
        cls,
        estimator: Any,
        X: ArrayLike,
        y: ArrayLike,
        *,
        horizons: Sequence[int] = HORIZONS,
        name: str | None = None,
        ax: Any = None,
    ) -> HorizonDisplay:
        """Predict at every horizon with a fitted estimator.

        Parameters
        ----------
        estimator : estimator
            Fitted.
        X : array-like of shape (n, n_features)
            Input.
        y : array-like of shape (n,)
            Output.
        horizons : sequence of int
            In samples.
        name : str, optional
            In the legend; the class by default.
        ax : matplotlib axes, optional
            Where to draw; a new figure by default.
        """
        return cls.from_estimators({name or type(estimator).__name__: estimator}, X, y, horizons=horizons, ax=ax)

    @classmethod
    def from_estimators(
        cls,
        estimators: Mapping[str, Any],
        X: ArrayLike,
        y: ArrayLike,
        *,
        horizons: Sequence[int] = HORIZONS,
        ax: Any = None,
    ) -> HorizonDisplay:
        """Predict at every horizon with several fitted estimators.

        Parameters
        ----------
        estimators : mapping of str to estimator
            Fitted ones, by their names in the legend.
        X : array-like of shape (n, n_features)
            Input.
        y : array-like of shape (n,)
            Output.
        horizons : sequence of int
            In samples.
        ax : matplotlib axes, optional
            Where to draw; a new figure by default.
        """
        curves = {name: error_against_horizon(model, X, y, horizons) for name, model in estimators.items()}
        errors = {name: curve.nmse for name, curve in curves.items()}
        return cls(sorted(set(horizons)), errors, {n: c.free_run_nmse for n, c in curves.items()}).plot(ax)

    def plot(self, ax: Any = None) -> HorizonDisplay:
        """Draw the error of each horizon; the free run is the dashed line.

        Parameters
        ----------
        ax : matplotlib axes, optional
            Where to draw; a new figure by default.
        """
        (ax,) = self._axes(ax, 1, 1, (6.4, 4.2))[:1]
        for i, (name, error) in enumerate(self.errors.items()):
            colour = COLOURS[i % len(COLOURS)]
            ax.loglog(self.horizons, error, "o-", markersize=3.5, color=colour, label=name)
            ax.axhline(self.free_run[name], color=colour, linestyle=TRUTH, linewidth=1.0)
        ax.plot([], [], color="0.3", linestyle=TRUTH, label="free run")
        ax.set_xticks(self.horizons, [str(h) for h in self.horizons])
        ax.tick_params(axis="x", which="minor", bottom=False, labelbottom=False)
        ax.set(xlabel="steps ahead", ylabel="NMSE")
        ax.legend(frameon=False)
        return self
