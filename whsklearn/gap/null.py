"""The null: the best score that any candidate reaches on records in which nothing is missing."""

from __future__ import annotations

from typing import Any

import numpy as np


def twin_scores(bench: Any, model: Any, n_twins: int, rng: np.random.Generator) -> tuple[float, list[float]]:
    """(best delta BIC on any twin, rms of missing torque on each): the whole line on logs of the fitted model.

    Only candidates that one linear look can score are tried, which is nearly all.
    """
    best, floors = 0.0, []
    for _ in range(n_twins):
        other = bench.twin(model, rng)
        other.weigh(bench.floor())
        fitted, fit = other.fit(model, max_iterations=3)
        d = other.missing(fitted)
        floors.append(other.rms(d, "all"))
        n = fit.residual.size
        for trial in other.screen(fitted, fit, other.cheap_kinds(fitted)):
            left = max(fit.cost - trial.screened, 1e-3 * fit.cost)
            looks = trial.scanned[0].size if trial.scanned is not None else 1
            score = n * np.log(fit.cost / left) - trial.n_parameters * np.log(n)
            best = max(best, float(score) - (2 * float(np.log(looks)) if looks > 1 else 0.0))
    return best, floors


def explainable(bench: Any, missing: Any, model: Any) -> float:
    """Cross-validated share of the gap that follows the motion, whatever the law: bins and waves.

    At most zero for coloured noise; clearly above it if something is missing that has no name here.
    """
    d = missing
    basis = bench.generic_basis(model)
    train, held = bench.train & bench.usable, (bench.held >= 0) & bench.usable
    shares = []
    for block in basis:
        mean, scale = block[train].mean(axis=0), block[train].std(axis=0) + 1e-12
        x = (block - mean) / scale
        gram = x[train].T @ x[train] + 0.01 * train.sum() * np.eye(x.shape[1])
        weights = np.linalg.solve(gram, x[train].T @ (d[train] - d[train].mean()))
        left = d[held] - d[train].mean() - x[held] @ weights
        shares.append(1.0 - float(left @ left) / float(d[held] @ d[held]))
    return max(shares)
