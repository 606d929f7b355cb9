"""A fitted estimator on one page: structure, parameters with intervals, poles, noise."""

from __future__ import annotations

import html
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

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
        values, errors = (_flat(p) for p in (model.parameters_, model.parameter_standard_errors_))
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


def _flat(parameters: dict[str, Any]) -> dict[str, float]:
    """a, b, c, d entry by entry, numbered as in (1) and (2); a_1 and c_1 are one by definition and are omitted."""
    out: dict[str, float] = {}
    for name, value in parameters.items():
        if np.ndim(value) == 0:
            out[name] = float(value)
            continue
        for i, row in enumerate(np.atleast_1d(value), start=1):
            for k, v in enumerate(np.atleast_1d(row), start=1):
                column = f",{k}" if np.ndim(value) == 2 else ""
                if not (name in "ac" and i == 1 and k == 1):
                    out[f"{name}_{i}{column}"] = float(v)
    return out


def _number(value: float) -> str:
    return f"{value:.4g}"
