"""What is drawn of records and models, and the parameters by name that some of it shows."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sklearn.base import clone
from sklearn.utils import Bunch

from whsklearn.effects.base import Effect, signals_of
from whsklearn.effects.law import flat_parameters
from whsklearn.metrics.indices import nmse, parameter_error
from whsklearn.plot.look import COLOURS, STYLES, TRUTH, Display
from whsklearn.validation import cross_correlation_test, error_against_horizon, whiteness_test


def parameter_paths(
    estimator: Any, X: ArrayLike, y: ArrayLike, *, every: int = 10
) -> tuple[NDArray[np.int64], dict[str, NDArray[np.float64]]]:
    """Feed a fresh clone the record in blocks of `every` samples and note its parameters after each.

    Parameters
    ----------
    estimator : estimator
        With `partial_fit`; it stays as it is.
    X : array-like of shape (n, n_features)
    y : array-like of shape (n,)
    every : int, default=10
        Samples between two notes.

    Returns
    -------
    steps : ndarray of shape (n_blocks,)
        Samples seen.
    paths : dict of str to ndarray of shape (n_blocks,)
        One path a parameter of `flat_parameters`.

    Examples
    --------
    >>> import numpy as np
    >>> from whsklearn import RLSRegressor, WienerHammersteinLags
    >>> from whsklearn.plot import parameter_paths
    >>> X = np.random.default_rng(0).normal(size=(40, 1))
    >>> lags = WienerHammersteinLags(n_a=1, n_b=0, n_c=1, n_d=0, law="linear")
    >>> model = RLSRegressor(lags, gradient="pseudolinear")
    >>> steps, paths = parameter_paths(model, X, np.r_[0.0, 0.0, 2.0 * X[:-2, 0]], every=20)
    >>> steps.tolist(), paths["x1"].round(3)[-1]
    ([20, 40], np.float64(2.0))
    """
    X, y, model = np.asarray(X), np.asarray(y), clone(estimator)
    ends = np.unique([*range(every, len(y), every), len(y)])
    rows, start = [], 0
    for end in ends:
        model.partial_fit(X[start:end], y[start:end])
        rows.append(flat_parameters(model.parameters_))
        start = end
    return ends, {name: np.array([row[name] for row in rows]) for name in rows[0]}


def block_of(name: str) -> str:
    """The block of the chain that a name of `flat_parameters` belongs to: L1, L2 or friction."""
    if not name[1:].replace("_", "").isdigit():
        return "friction"
    return {"a": "L1", "b": "L1", "c": "L2", "d": "L2"}.get(name[0], "friction")


class TrackingDisplay(Display):
    """Measured and simulated output over time, above their difference.

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
    Paper, Fig. 3 and Fig. 6.

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

        ``X`` (n, n_features), ``y`` (n,): the record that the fitted ``estimator`` predicts. ``name``: in the legend;
        the class by default. ``axes``: array of matplotlib axes; a new figure by default. ``**kwargs``: further
        arguments of `TrackingDisplay`.
        """
        return cls(y, {name or type(estimator).__name__: estimator.predict(X)}, **kwargs).plot(axes)

    def plot(self, axes: Any = None) -> TrackingDisplay:
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


class ConvergenceDisplay(Display):
    """Parameter paths against samples seen: L1, friction, L2 and delta, one panel each; the truth is dashed.

    Parameters
    ----------
    paths : mapping of str to (steps, mapping of str to array)
        For each model its steps and its paths, as `parameter_paths` gives them.
    truth : mapping of str to float, optional
        True values by the same names; drawn dashed, and then the last panel shows delta.

    References
    ----------
    Paper, Fig. 2 and Fig. 5.

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

        ``estimator``: with `partial_fit`; it stays as it is. ``X`` (n, n_features), ``y`` (n,): the record. ``truth``:
        true parameters, drawn dashed. ``every``: samples between two points. ``name``, ``axes``: as for
        `TrackingDisplay.from_estimator`.
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
        panels = ("L1", "friction", "L2", "delta") if self.truth else ("L1", "friction", "L2")
        shape = (2, 2) if self.truth else (1, 3)
        axes = self._axes(axes, *shape, (10.0, 6.4) if self.truth else (12.0, 3.6), sharex=True)
        for panel, ax in zip(panels[:3], axes, strict=False):
            self._plot_block(ax, panel)
        for i, (model, delta) in enumerate(self.errors().items()):
            axes[3].semilogy(self.paths[model][0], delta, STYLES[i % 3], color="black", linewidth=1.3)
        if self.truth:
            axes[3].set(title="parameter error", ylabel="delta")
        for ax in axes[2:] if self.truth else axes:  # the lower row
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


HORIZONS = (1, 2, 3, 5, 8, 13, 21, 34, 55)


class HorizonDisplay(Display):
    """NMSE against the prediction horizon; the free run is the dashed line: *the* validation picture.

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
        axes: Any = None,
    ) -> HorizonDisplay:
        """Predict at every horizon with a fitted estimator, or with several.

        ``estimator``: a fitted one, or a mapping of names in the legend to these. ``X`` (n, n_features), ``y`` (n,):
        the record. ``horizons``: in samples. ``name`` (of one alone) and ``axes``: as for
        `TrackingDisplay.from_estimator`.
        """
        several = estimator if isinstance(estimator, Mapping) else {name or type(estimator).__name__: estimator}
        curves = {name: error_against_horizon(model, X, y, horizons) for name, model in several.items()}
        errors = {name: curve.nmse for name, curve in curves.items()}
        return cls(sorted(set(horizons)), errors, {n: c.free_run_nmse for n, c in curves.items()}).plot(axes)

    def plot(self, axes: Any = None) -> HorizonDisplay:
        ax = self._axes(axes, 1, 1, (6.4, 4.2))[0]
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

        ``estimator``: a fitted one. ``X`` (n, n_features), ``y`` (n,): the record. ``max_lag``: in samples. ``axes``:
        as for `TrackingDisplay.from_estimator`.
        """
        residuals = np.asarray(y, dtype=float).ravel() - estimator.predict_ahead(X, y, horizon=1)
        return cls(residuals, np.asarray(X)[:, 0], max_lag=max_lag).plot(axes)

    def plot(self, axes: Any = None) -> ResidualDisplay:
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


# What an effect is drawn against, where that is not the usual one of its place.
_USUAL = {"friction": "velocity", "drive": "drive", "position": "position", "sensor": "position", "time": "time"}
_AGAINST = {
    "position_friction": "position",
    "presliding_hysteresis": "position",
    "friction_drift": "time",
    "input_offset": "time",
    "torque_ripple": "position",
    "output_drift": "time",
}
_LABELS = {"velocity": "velocity, rad/s", "drive": "drive, Nm", "position": "position, rad", "time": "time, s"}
_THIN = 4000  # points; more only make a picture heavy


class EffectDisplay(Display):
    """An effect along a simulated run, against the signal that it depends on.

    Effects that are a function of one signal are drawn against it. A transmission is drawn by its twist over time,
    a late drive and a sensor's lattice by the signal before (grey) and after, over a few samples.

    Parameters
    ----------
    x, values : array-like of shape (n,)
        Abscissa and effect.
    xlabel, ylabel : str
        Their names with units.
    before : array-like of shape (n,), optional
        The signal that the effect changes, drawn grey.
    line : bool, default=False
        Draw a line; points by default, as an effect along a run may have several values at one abscissa.

    References
    ----------
    scikit-learn developer's guide, Developing with the plotting API.

    Examples
    --------
    >>> import numpy as np
    >>> from whsklearn import ServoAxis
    >>> from whsklearn.effects import Cogging
    >>> from whsklearn.plot import EffectDisplay
    >>> cogging = Cogging(0.05, order=12.0)
    >>> run = ServoAxis(effects=[cogging]).simulate_drive(0.5 * np.sin(np.arange(500) / 50), noise=False)
    >>> display = EffectDisplay.from_run(cogging, run)
    >>> display.xlabel, bool(np.abs(display.values).max() <= 0.05)
    ('position, rad', True)
    """

    def __init__(
        self,
        x: ArrayLike,
        values: ArrayLike,
        xlabel: str,
        ylabel: str,
        *,
        before: ArrayLike | None = None,
        line: bool = False,
    ):
        self.x, self.values = np.asarray(x, dtype=float), np.asarray(values, dtype=float)
        self.xlabel, self.ylabel, self.line = xlabel, ylabel, line
        self.before = None if before is None else np.asarray(before, dtype=float)

    @classmethod
    def from_run(cls, effect: Effect, run: Bunch, *, axes: Any = None) -> EffectDisplay:
        """Draw an ``effect`` along the run of an axis that has it.

        ``run``: what `ServoAxis.simulate` or `ServoAxis.simulate_drive` returned. ``axes``: where to draw; a new figure
        by default.
        """
        return cls._of(effect, run).plot(axes)

    @classmethod
    def _of(cls, effect: Effect, run: Bunch) -> EffectDisplay:
        n = run.time.size
        late = slice(n // 4, n // 4 + min(n // 2, 1500))  # after the start
        few = slice(n // 4, n // 4 + min(n // 2, 60))
        if effect.place == "transmission":
            twist = 1e3 * (run.true_position - run.load_position)[late]
            return cls(run.time[late], twist, _LABELS["time"], "twist, mrad", line=True)
        if effect.name in ("input_delay", "actuator_lag"):
            return cls(run.time[few], run.torque[few], _LABELS["time"], "torque, Nm", before=run.drive[few], line=True)
        if effect.name == "quantization":
            true = run.true_position[few]
            return cls(run.time[few], run.position[few], _LABELS["time"], "position, rad", before=true, line=True)
        signals = signals_of(run)
        against = _AGAINST.get(effect.name, _USUAL.get(effect.place, "velocity"))
        windows = {"presliding_hysteresis": late, "disturbance_tone": slice(0, min(n, 1000))}
        window = windows.get(effect.name, slice(None, None, max(1, n // _THIN)))
        ylabel = "position, rad" if effect.port == "output" else "torque, Nm"
        return cls(signals[against][window], effect.contribution(signals)[window], _LABELS[against], ylabel)

    def plot(self, axes: Any = None) -> EffectDisplay:
        ax = self._axes(axes, 1, 1, (4.8, 2.8))[0]
        if self.before is not None:
            ax.step(self.x, self.before, where="post", color="0.6", linewidth=1.0)
        if self.line:
            ax.plot(self.x, self.values, color=COLOURS[0], linewidth=1.2)
        else:
            ax.plot(self.x, self.values, ".", color=COLOURS[0], markersize=1.5)
        if np.ptp(self.values) == 0.0 and self.values[0] != 0.0:  # a constant is seen by its distance from zero
            ax.set_ylim(sorted((0.0, 1.5 * self.values[0])))
        ax.set(xlabel=self.xlabel, ylabel=self.ylabel)
        return self
