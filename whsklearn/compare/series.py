"""More than two records: the record at which a number changes, and the spread between records of equal axes."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from whsklearn.compare.comparison import Change
from whsklearn.compare.estimate import Estimate, Part, degrees_of
from whsklearn.compare.hypotheses import LEAST, Difference
from whsklearn.compare.pair import between, changes_between
from whsklearn.compare.rows import Rows

Array = NDArray[Any]


def spread(values: Array, variances: Array) -> tuple[float, float, float]:
    """The mean, the deviation between records beyond that within them, and the p-value that there is none.

    References
    ----------
    DerSimonian and Laird 1986, Controlled Clinical Trials 7(3), 177-188.

    Examples
    --------
    >>> mean, apart, p = spread(np.array([1.0, 1.2, 0.8, 1.0]), np.full(4, 1e-4))
    >>> round(mean, 3), round(apart, 2), p < 1e-6
    (1.0, 0.16, True)
    >>> spread(np.array([1.0, 1.001, 0.999]), np.full(3, 1e-4))[1]
    0.0
    """
    w = 1.0 / variances
    mean = float(w @ values / w.sum())
    q = float(w @ (values - mean) ** 2)
    tau2 = max(0.0, (q - (values.size - 1.0)) / float(w.sum() - w @ w / w.sum()))
    if tau2 > 0.0:
        mean = float((1.0 / (variances + tau2)) @ values / (1.0 / (variances + tau2)).sum())
    return mean, float(np.sqrt(tau2)), float(chi2.sf(q, values.size - 1))


def scattered(parts: list[Estimate]) -> Array:
    """Variance of every number between records beyond that within them, shape (p,)."""
    if len(parts) < 2:
        return np.zeros(parts[0].values.size)
    values, variances = np.array([e.values for e in parts]), np.array([np.diag(e.covariance) for e in parts])
    return np.array([spread(v, s)[1] ** 2 for v, s in zip(values.T, variances.T, strict=True)])


def change_point(rows: list[Rows], parts: list[Estimate], alpha: float) -> tuple[list[Change], Difference]:
    """What changed between two consecutive records and stayed, and the difference in which it was found.

    The records of each side must agree better than the two sides do: their scatter counts as noise.
    """
    splits = range(1, len(parts))
    best: tuple[list[Change], Difference] | None = None
    for k in splits:
        inside = np.maximum(scattered(parts[:k]), scattered(parts[k:]))
        between_them = Part(np.diag(inside), max(len(parts) - 2.0, 1.0))
        noisy = [replace(e, parts=(*e.parts, between_them)) for e in parts]
        d = between(rows, noisy[:k], noisy[k:])
        at = (parts[k - 1].label, parts[k].label)
        found = changes_between(d, rows[0].units, alpha / len(splits))
        found = [replace(c, between=at, p_value=min(1.0, c.p_value * len(splits))) for c in found]
        if best is None or (found and (not best[0] or found[0].p_value < best[0][0].p_value)):
            best = found, d
    assert best is not None
    return best


def scatter(rows: list[Rows], parts: list[Estimate], alpha: float) -> list[Change]:
    """Numbers that vary between records without any order, each with its lowest and highest record."""
    out = []
    for i, name in enumerate(rows[0].names):
        values, variances = np.array([e.values[i] for e in parts]), np.array([e.covariance[i, i] for e in parts])
        _, apart, p = spread(values, variances)
        share = apart * float(np.mean([r.sizes[i] / r.drives[i] for r in rows]))
        if p * len(rows[0].names) <= alpha and share > LEAST:
            a, b = int(np.argmin(values)), int(np.argmax(values))
            error = float(np.sqrt(variances[a] + variances[b]))
            nu = degrees_of((*parts[a].parts, *parts[b].parts), np.eye(len(rows[0].names))[[i]])
            out.append(Change(
                name, float(values[a]), float(values[b]), error, nu, rows[0].units[i],
                min(1.0, p * len(rows[0].names)), [], share, between=(parts[a].label, parts[b].label),
            ))  # fmt: skip
    return sorted(out, key=lambda c: c.p_value)
