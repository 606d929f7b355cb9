"""Measured and simulated output over time."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from whsklearn.metrics.indices import nmse
from whsklearn.plot.look import COLOURS, Display


class TrackingDisplay(Display):
    """Measured and simulated output over time, and their difference (Fig. 3 and Fig. 6 of the paper).

    Parameters
    ----------
    y : array-like of shape (n,)
        Measured output.
    predictions : mapping of str to array-like of shape (n,)
        Simulated outputs by model.
    time : array-like of shape (n,), optional
        Seconds; samples are counted where it is missing.
    output : str
        Name and unit of the output for the axis.
    window : slice, optional
        The samples to draw; the NMSE in the legend is of the whole record, drawn or not.
    skip : int, default=0
        Samples at the start that the NMSE leaves out, as in `whsklearn.metrics.indices.nmse`.

    References
    ----------
    scikit-learn developer's guide, Developing with the plotting API;
    paper, Fig. 3 and Fig. 6.

    Examples
    --------
    >>> from whsklearn.plot import TrackingDisplay
    >>> display = TrackingDisplay([0.0, 1.0, 2.0], {"model": [0.0, 1.0, 1.9]}, output="position in rad").plot()
    >>> display.axes_[0].get_ylabel()
    'position in rad'
    """

    def __init__(
        self,
        y: ArrayLike,
        predictions: Mapping[str, ArrayLike],
        *,
        time: ArrayLike | None = None,
        output: str = "y",
        window: slice | None = None,
        skip: int = 0,
    ):
        self.y = np.asarray(y, dtype=float).ravel()
        self.predictions = {k: np.asarray(v, dtype=float).ravel() for k, v in predictions.items()}
        self.time = np.arange(self.y.size) if time is None else np.asarray(time, dtype=float).ravel()
        self.time_label = "sample" if time is None else "time in s"
        self.output = output
        self.window = slice(None) if window is None else window
        self.skip = skip

    @classmethod
    def from_estimator(
        cls, estimator: Any, X: ArrayLike, y: ArrayLike, *, name: str | None = None, axes: Any = None, **kwargs: Any
    ) -> TrackingDisplay:
        """Draw the free run of a fitted estimator.

        Parameters
        ----------
        estimator : estimator
            Fitted.
        X : array-like of shape (n, n_features)
            Input.
        y : array-like of shape (n,)
            Output.
        name : str, optional
            In the legend; the class by default.
        axes : array of matplotlib axes, optional
            Where to draw; a new figure by default.
        **kwargs
            Further arguments of `TrackingDisplay`.
        """
        return cls(y, {name or type(estimator).__name__: estimator.predict(X)}, **kwargs).plot(axes)

    def plot(self, axes: Any = None) -> TrackingDisplay:
        """Draw the overlay above the error.

        Parameters
        ----------
        axes : array of matplotlib axes, optional
            Where to draw; a new figure by default.
        """
        top, bottom = self._axes(axes, 2, 1, (10.0, 5.6), sharex=True, height_ratios=[2, 1])[:2]
        time, y = self.time[self.window], self.y[self.window]
        top.plot(time, y, color="black", linewidth=1.6, label="measured")
        for i, (name, y_hat) in enumerate(self.predictions.items()):
            colour = COLOURS[i % len(COLOURS)]
            label = f"{name}, NMSE {nmse(self.y, y_hat, skip=self.skip):.2g}"
            top.plot(time, y_hat[self.window], color=colour, linewidth=1.2, linestyle=(0, (5, 2)), label=label)
            bottom.plot(time, y - y_hat[self.window], color=colour, linewidth=0.9)
        top.set_ylabel(self.output)
        bottom.set(ylabel="error", xlabel=self.time_label)
        bottom.axhline(0.0, color="0.3", linewidth=0.7)
        top.margins(x=0)
        top.legend(frameon=False, ncols=3, loc="lower left", bbox_to_anchor=(0, 1.0), fontsize="small")
        return self
