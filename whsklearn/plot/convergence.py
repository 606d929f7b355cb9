"""Parameter paths against samples seen."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from whsklearn.metrics.indices import parameter_error
from whsklearn.plot.look import COLOURS, STYLES, TRUTH, Display
from whsklearn.plot.parameters import block_of, parameter_paths


class ConvergenceDisplay(Display):
    """Parameter paths against samples seen, truth dashed (Fig. 2 and Fig. 5 of the paper).

    Parameters
    ----------
    paths : mapping of str to (steps, mapping of str to array)
        For each model its steps and its paths, as `parameter_paths` gives them.
    truth : mapping of str to float, optional
        True values by the same names; drawn dashed, and then the last panel shows delta.

    References
    ----------
    scikit-learn developer's guide, Developing with the plotting API;
    paper, Fig. 2 and Fig. 5.

    Examples
    --------
    >>> from whsklearn.plot import ConvergenceDisplay
    >>> paths = {"rls": ([10, 20], {"viscous": [0.4, 0.5], "coulomb": [0.6, 0.7]})}
    >>> display = ConvergenceDisplay(paths, truth={"viscous": 0.5, "coulomb": 0.7})
    >>> display.errors()["rls"].round(3).tolist()
    [0.164, 0.0]
    """

    def __init__(
        self, paths: Mapping[str, tuple[ArrayLike, Mapping[str, ArrayLike]]], truth: Mapping[str, float] | None = None
    ):
        self.paths = {m: (np.asarray(s), {k: np.asarray(v) for k, v in p.items()}) for m, (s, p) in paths.items()}
        self.truth = dict(truth) if truth else None

    @classmethod
    def from_estimator(
        cls,
        estimator: Any,
        X: ArrayLike,
        y: ArrayLike,
        *,
        truth: Mapping[str, float] | None = None,
        every: int = 10,
        name: str | None = None,
        axes: Any = None,
    ) -> ConvergenceDisplay:
        """Stream the record through a clone of `estimator` and draw what it learns.

        Parameters
        ----------
        estimator : estimator
            With `partial_fit`; it stays as it is.
        X : array-like of shape (n, n_features)
            Input.
        y : array-like of shape (n,)
            Output.
        truth : mapping of str to float, optional
            True parameters, drawn dashed.
        every : int, default=10
            Samples between two points.
        name : str, optional
            In the legend; the class by default.
        axes : array of matplotlib axes, optional
            Where to draw; a new figure by default.
        """
        paths = parameter_paths(estimator, X, y, every=every)
        return cls({name or type(estimator).__name__: paths}, truth).plot(axes)

    def errors(self) -> dict[str, NDArray[np.float64]]:
        """Delta after every step, by model (Fig. 2 d)."""
        if not self.truth:
            return {}
        true = list(self.truth.values())
        return {
            m: np.array([parameter_error(row, true) for row in np.column_stack([p[k] for k in self.truth])])
            for m, (_, p) in self.paths.items()
        }

    def plot(self, axes: Any = None) -> ConvergenceDisplay:
        """Draw L1, friction, L2 and delta, one panel each.

        Parameters
        ----------
        axes : array of matplotlib axes, optional
            Where to draw; a new figure by default.
        """
        panels = ("L1", "friction", "L2", "delta") if self.truth else ("L1", "friction", "L2")
        shape = (2, 2) if self.truth else (1, 3)
        axes = self._axes(axes, *shape, (10.0, 6.4) if self.truth else (12.0, 3.6), sharex=True)
        for panel, ax in zip(panels[:3], axes, strict=False):
            self._plot_block(ax, panel)
        if self.truth:
            for i, (model, delta) in enumerate(self.errors().items()):
                axes[3].semilogy(self.paths[model][0], delta, STYLES[i % 3], color="black", linewidth=1.3)
            axes[3].set(title="parameter error", ylabel="delta", xlabel="samples seen")
            axes[2].set_xlabel("samples seen")
        else:
            for ax in axes[:3]:
                ax.set_xlabel("samples seen")
        lines = [axes[0].plot([], [], STYLES[j % 3], color="black", label=m)[0] for j, m in enumerate(self.paths)]
        truth = [axes[0].plot([], [], color="0.5", linestyle=TRUTH, label="truth")[0]] if self.truth else []
        self.figure_.legend(handles=lines + truth, loc="outside lower center", ncols=4, frameon=False)
        return self

    def _plot_block(self, ax: Any, panel: str) -> None:
        """The paths of one block: a colour a parameter, a line style a model."""
        for j, (steps, paths) in enumerate(self.paths.values()):
            names = [k for k in paths if block_of(k) == panel]
            for i, name in enumerate(names):
                label = name if j == 0 else None
                ax.plot(steps, paths[name], STYLES[j % 3], color=COLOURS[i % len(COLOURS)], label=label, linewidth=1.3)
                if self.truth and j == 0:
                    ax.axhline(self.truth[name], color=COLOURS[i % len(COLOURS)], linestyle=TRUTH, linewidth=0.9)
        low, high = self._limits(panel)
        ax.set(title=panel, ylabel="estimate", ylim=(low, high))
        if ax.get_legend_handles_labels()[0]:
            ax.legend(frameon=False, ncols=3, fontsize="small", loc="upper right")

    def _limits(self, panel: str) -> tuple[float, float]:
        """Axis limits that the first few wild estimates do not spoil."""
        values = [v[len(v) // 10 :] for _, p in self.paths.values() for k, v in p.items() if block_of(k) == panel]
        values += [np.atleast_1d(v) for k, v in (self.truth or {}).items() if block_of(k) == panel]
        low, high = (float(q) for q in np.nanquantile(np.concatenate(values or [np.zeros(1)]), [0.005, 0.995]))
        low = min([low, *[float(v.min()) for v in values if v.size == 1]])
        high = max([high, *[float(v.max()) for v in values if v.size == 1]])
        margin = 0.12 * (high - low) or 0.5
        return low - margin, high + 2 * margin  # room for the legend
