"""The identified model, its learned attributes, and its summary on one page."""

from __future__ import annotations

import html
import warnings
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from sklearn.base import BaseEstimator
from sklearn.utils.validation import check_is_fitted

from whsklearn.effects import as_law
from whsklearn.effects.base import Array
from whsklearn.effects.law import flat_parameters
from whsklearn.estimators import _model as wh
from whsklearn.lags.wiener_hammerstein import WienerHammersteinLags

if TYPE_CHECKING:
    from pandas import DataFrame


QUANTILE = 1.959963984540054  # of the normal distribution: 95 % lie within


@dataclass(frozen=True)
class Summary:
    """What `summary` of an estimator returns; ``print`` it, or let a notebook show it."""

    title: str  # the estimator and the kind of model
    facts: dict[str, str]  # structure, samples, poles and noise, in words
    # one row per parameter: ``value``, ``standard_error``, and ``low`` and ``high`` of the 95 % interval
    table: DataFrame

    def __str__(self) -> str:
        width = max(map(len, self.facts))
        lines = [f"{name:{width}}  {value}" for name, value in self.facts.items()]
        return "\n".join([self.title, "", *lines, "", self._shown().to_string(float_format=_number)])

    __repr__ = __str__

    def _repr_html_(self) -> str:
        rows = "".join(f"<tr><th>{html.escape(k)}</th><td>{html.escape(v)}</td></tr>" for k, v in self.facts.items())
        table = self._shown().to_html(float_format=_number, border=0)
        return f"<p><b>{html.escape(self.title)}</b></p><table>{rows}</table>{table}"

    def _shown(self) -> DataFrame:
        names = {"standard_error": "standard error", "low": "95 % from", "high": "to"}
        return self.table.rename(columns=names)


def described(model: Any, noise_variance: float) -> Summary:
    """The summary of a fitted estimator."""
    from pandas import DataFrame

    is_chain = model._is_wiener_hammerstein
    kind = "Wiener-Hammerstein chain" if is_chain else "linear regression on rows"
    facts = {"samples": f"{int(model.state_['seen']):,}"}
    if is_chain:
        facts = _chain_facts(model) | facts
        values, errors = map(flat_parameters, (model.parameters_, model.parameter_standard_errors_))
    else:
        if model.lags is not None:
            facts = {"rows": type(model.lags).__name__} | facts
        values, errors = model.parameters_, model.parameter_standard_errors_
    kind_of_error = "free-run" if model._fits_free_run else "one-step"
    facts["noise"] = f"{_number(np.sqrt(noise_variance))} (standard deviation of the {kind_of_error} error)"
    value = np.array(list(values.values()), dtype=float)
    error = np.array([errors[name] for name in values], dtype=float)
    table = DataFrame(
        {"value": value, "standard_error": error, "low": value - QUANTILE * error, "high": value + QUANTILE * error},
        index=list(values),
    )
    return Summary(f"{type(model).__name__}: {kind}", facts, table)


def _chain_facts(model: Any) -> dict[str, str]:
    """Orders, law, delays and poles."""
    s, lags = model._structure(), model._lags
    na, nb, nc, nd = (int(n) for n in s.dims[:4])
    _, b, _, _, d = (model._natural()[i] for i in s.slices())
    inputs = f", {s.n_inputs} inputs" if s.n_inputs > 1 else ""
    return {
        "L1": f"n_a = {na // s.n_inputs}, n_b = {nb}, delay {lags.delays[0]}{inputs}; {_poles(b)}",
        "law": ", ".join(s.law.labels),
        "L2": f"n_c = {nc}, n_d = {nd}, delay {lags.delays[1]}; {_poles(d)}",
    }


def _poles(denominator: Any) -> str:
    """The poles; a conjugate pair is listed once."""
    if not denominator.size:
        return "no poles"
    roots = np.roots(np.append(1.0, denominator))
    shown = []
    for r in roots[np.argsort(-np.abs(roots), kind="stable")]:
        if abs(r.imag) < 1e-12:
            shown.append(f"{r.real:.4g}")
        elif r.imag > 0:
            shown.append(f"{r.real:.4g} +- {r.imag:.4g}j")
    return f"pole{'s' if roots.size > 1 else ''} {', '.join(shown)}"


def _number(value: float) -> str:
    return f"{value:.4g}"


# --- the identified model and its learned attributes -----------------------------------------------------------------
class FittedModel(BaseEstimator):
    """A fitted model: its structure, its parameters with standard errors, and a text summary of both.

    A subclass learns in ``fit`` and leaves ``state_``, a dict of arrays, from which `_theta` and `_covariance` read the
    estimate in the paper's order, or `_natural` and `_natural_covariance` that of the natural parameters.
    """

    lags: Any
    _states_errors: ClassVar[bool] = True  # False if the method has no covariance, as its docstring says
    # whether the blocks may respond without the paper's delay of one sample each
    _takes_direct_paths: ClassVar[bool] = False
    _fits_free_run = False  # whether the error minimised is that of the free run, not the one-step error

    # -- what the model is ---------------------------------------------------------------

    @property
    def _is_wiener_hammerstein(self) -> bool:
        """Whether the rows are built from u and past y inside the estimator."""
        return hasattr(self.lags, "key_term")

    @property
    def _answers_several(self) -> bool:
        """Whether y has one column per joint, as for the lags of an arm."""
        return bool(getattr(self.lags, "multi_output", False))

    @property
    def _given_lags(self) -> WienerHammersteinLags:
        """The transformer that holds orders and law, as the user gave it."""
        return self.lags

    @property
    def _lags(self) -> WienerHammersteinLags:
        """The transformer as it was when learning started: changing ``lags`` later does not change a fitted model."""
        return self.__dict__.get("lags_", self._given_lags)

    def _structure(self) -> wh.Structure:
        """Orders and law in the form that the kernels take."""
        lags = self._lags
        try:
            key = lags.key_term()
        except ValueError:
            key = -1
        return wh.Structure(lags.dims(self.n_features_in_), self.n_features_in_, as_law(lags.law), key, lags.advance())

    def _theta(self) -> Array:
        return wh.paper_vector(self._natural(), self._structure())

    def _natural(self) -> Array:
        return wh.natural_vector(self._theta(), self._structure())

    def _covariance(self) -> Array:
        """By the delta method, as the other one."""
        jacobian = wh.paper_jacobian(self._natural(), self._structure())
        return jacobian @ self._natural_covariance() @ jacobian.T

    def _natural_covariance(self) -> Array:
        jacobian = np.linalg.pinv(wh.paper_jacobian(self._natural(), self._structure()))
        return jacobian @ self._covariance() @ jacobian.T

    def _noise_variance(self) -> float:
        """Variance of the error that was minimised; NaN if it is not known."""
        return float("nan")

    # -- what was learned ----------------------------------------------------------------

    @property
    def theta_(self) -> Array:
        """Estimate of shape (n_parameters,), in the paper's order, (6)."""
        check_is_fitted(self, "state_")
        return self._theta()

    @property
    def covariance_(self) -> Array:
        """Covariance of `theta_`, shape (n_parameters, n_parameters)."""
        check_is_fitted(self, "state_")
        return self._covariance()

    @property
    def standard_errors_(self) -> Array:
        """Standard errors of `theta_`, shape (n_parameters,); NaN, with a warning, if the record cannot give them."""
        return self._told(np.sqrt(np.maximum(np.diag(self.covariance_), 0.0)))

    @property
    def parameters_(self) -> dict[str, Any]:
        """``a``, ``b``, ``c``, ``d`` and one weight per term of the law; for given rows, one weight per column."""
        check_is_fitted(self, "state_")
        if self._is_wiener_hammerstein:
            return wh.named(self._natural(), self._structure())
        return dict(zip(self._column_names(), self._theta().tolist(), strict=True))

    @property
    def parameter_standard_errors_(self) -> dict[str, Any]:
        """Standard errors in the layout of `parameters_`; NaN, with a warning, if the record cannot give them."""
        check_is_fitted(self, "state_")
        if self._is_wiener_hammerstein:
            return wh.named_errors(self._told(np.diag(self._natural_covariance())), self._structure())
        return dict(zip(self._column_names(), self.standard_errors_.tolist(), strict=True))

    def _told(self, values: Array) -> Array:
        """The same values, with a warning if some are NaN."""
        if self._states_errors and not np.isfinite(values).all():
            warnings.warn(
                "Some standard errors are NaN, because the samples so far do not determine them: there was too little "
                "motion for these parameters; give a longer record of a moving axis.",
                UserWarning,
                stacklevel=3,
            )
        return values

    def _column_names(self) -> list[str]:
        """Names of the weights for given rows."""
        if self.lags is not None:
            return [str(n) for n in self.lags_.get_feature_names_out()]
        names = getattr(self, "feature_names_in_", [f"x{i}" for i in range(self.n_features_in_)])
        return [str(n) for n in names]

    # -- in words, and for other tools -----------------------------------------------------

    def summary(self) -> Summary:
        """Structure, parameters with 95 % intervals, poles and noise, to print or to show in a notebook.

        >>> import numpy as np
        >>> from whsklearn import RLSRegressor
        >>> X = np.random.default_rng(0).standard_normal((100, 2))
        >>> RLSRegressor().fit(X, X @ [1.0, -2.0] + 0.1 * X[:, 0] ** 2).summary().table.index.tolist()
        ['x0', 'x1']
        """
        check_is_fitted(self, "state_")
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # the table shows which errors are NaN
            return described(self, self._noise_variance())

    def to_dlti(self, dt: float = 1.0) -> tuple[Any, Any]:
        """L1 and L2 as linear systems in discrete time; the law between them is in `parameters_`.

        ``dt``: sampling interval in seconds. Returns u to x and v to y, with their delays. With several inputs the
        first is a tuple of systems, one per input. Raises ValueError if the estimator works on rows and has no blocks,
        or if ``dt`` is not a positive number.

        >>> from whsklearn import RMILSRegressor, WienerHammersteinLags
        >>> from whsklearn.datasets import make_wiener_hammerstein
        >>> X, y = make_wiener_hammerstein(400, snr_db=40, random_state=0)
        >>> first, second = RMILSRegressor(WienerHammersteinLags(), random_state=0).fit(X, y).to_dlti(dt=0.01)
        >>> first.num.round(1), first.den.round(1)
        (array([1. , 2.2]), array([1. , 1. , 0.5]))
        """
        check_is_fitted(self, "state_")
        if not self._is_wiener_hammerstein:
            raise ValueError(
                f"This {type(self).__name__} was fitted on rows and has no linear blocks; give "
                "lags=WienerHammersteinLags()."
            )
        return wh.linear_blocks(self._natural(), self._structure(), self._lags.delays, dt)
