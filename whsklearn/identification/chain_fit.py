"""The Wiener-Hammerstein candidate, from `PEMRegressor` with the simulation error."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from whsklearn.effects import as_law
from whsklearn.estimators import PEMRegressor
from whsklearn.models import ChainModel

if TYPE_CHECKING:
    from whsklearn.identification.view import View


def fit_chain(log: View) -> ChainModel:
    """Orders and law as the fit finds them."""
    groups = np.repeat(np.arange(log.bounds.size - 1), np.diff(log.bounds)) if log.starts else None
    model = PEMRegressor(criterion="simulation").fit(log.u[:, None], log.target, groups=groups)
    return chain_model(model, dt=log.dt, logged=log.logged)


def chain_model(model: Any, **shared: Any) -> ChainModel:
    """A fitted Wiener-Hammerstein estimator of one input as a `ChainModel`."""
    p, e, lags = model.parameters_, model.parameter_standard_errors_, model.structure_
    first, second = (np.zeros(d) for d in lags.delays)
    law = as_law(lags.law)
    law = law.reweighted([p[label] for label in law.labels])
    errors = {label: e[label] for label in law.labels}
    for block, delay, up, down in (("1", first.size, "a", "b"), ("2", second.size, "c", "d")):
        errors |= {f"b{block}_{i + delay}": s for i, s in enumerate(e[up]) if s > 0}
        errors |= {f"f{block}_{i + 1}": s for i, s in enumerate(e[down])}
    return ChainModel(
        (*first, *p["a"]),
        (1.0, *p["b"]),
        law,
        (*second, *p["c"]),
        (1.0, *p["d"]),
        standard_errors={k: float(v) for k, v in errors.items()},
        **shared,
    )
