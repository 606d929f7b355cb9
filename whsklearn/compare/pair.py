"""The difference between two records, or two groups of records, and what changed, as shown to the reader."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from whsklearn.compare.comparison import Change
from whsklearn.compare.estimate import Estimate, degrees_of, estimate, from_a_cold_start, pooled
from whsklearn.compare.hypotheses import Difference, FittedHypothesis, hypotheses, load_of, moved
from whsklearn.compare.rows import Array, Regression, difference


def between(rows: list[Regression], first: list[Estimate], second: list[Estimate]) -> Difference:
    """The difference of two groups of estimates, or of two single records themselves if they share one path.

    ``rows``: rows of all records.
    """
    a, b = pooled(first), pooled(second)
    every = pooled([a, b])
    sizes, drives = (np.sqrt(np.mean(x, axis=0)) for x in ([r.sizes**2 for r in rows], [r.drives**2 for r in rows]))
    same = difference(rows[0], rows[1], every.values) if len(rows) == 2 else None
    if same is not None:
        b = estimate(same)
    elif len(first) == len(second) == 1:
        a, b = from_a_cold_start(a, b)
    return Difference(
        rows[0].names, rows[0].covers, a, b, every.values, every.errors, sizes / drives, rows[0].changes,
        one_path=same is not None,
    )  # fmt: skip


def changes_between(d: Difference, units: tuple[str, ...], alpha: float) -> list[Change]:
    """What changed, as shown to the reader."""
    found = moved(d, alpha)
    if not found:
        return []
    n_asked = len(hypotheses(d))
    basis = np.column_stack([f.hypothesis.basis for f, _ in found])
    after = found[-1][0].after
    inverse = np.linalg.pinv(basis.T @ after.weight @ basis, rcond=1e-10, hermitian=True)
    to = inverse @ basis.T @ after.weight
    step = to @ after.values
    start = after.before(after.values - basis @ step)
    step = step + np.concatenate([f.taken for f, _ in found])
    out, i = [], 0
    for best, rivals in found:
        k = best.step.size
        at = slice(i, i + k)
        nu = degrees_of(after.parts, to[at])
        out.append(_told(d, best, rivals, ChangeFit(start, step[at], inverse[at, at], nu), units, n_asked))
        i += k
    return out


class ChangeFit(NamedTuple):
    """The first numbers (p,), the step of one change (k,) with its covariance (k, k), and degrees of freedom."""

    start: Array
    step: Array
    covariance: Array
    degrees: float


def _told(
    d: Difference,
    best: FittedHypothesis,
    rivals: list[FittedHypothesis],
    fit: ChangeFit,
    units: tuple[str, ...],
    asked: int,
) -> Change:
    """One change with its numbers from the joint fit of all of them."""
    start, step, covariance, degrees = fit
    h = best.hypothesis
    p_value = min(1.0, best.p_value * asked)
    names = [f.hypothesis.name for f in rivals]
    if h.name.partition(" at ")[0] == "gain":
        ratio = 1.0 + float(step[0])  # of the numbers: twice the gain halves all of them
        error = float(np.sqrt(covariance[0, 0])) / ratio**2
        return Change(h.name, 1.0, 1.0 / ratio, error, degrees, "1", p_value, names, best.size)
    if h.body is not None:
        size, error = load_of(h.name, step, covariance)
        unit = "kg" if h.name.startswith("mass") else "kg m"
        return Change(h.name, 0.0, size, error, degrees, unit, p_value, names, best.size)
    at = [i for i, n in enumerate(d.names) if n == h.name]
    if not at:  # one with other numbers: only its change is known
        error = float(np.sqrt(covariance[0, 0]))
        return Change(h.name, 0.0, float(step[0]), error, degrees, "kg m²", p_value, names, best.size)
    unit = units[at[0]]
    step, covariance = step[: len(at)], covariance[: len(at), : len(at)]  # what it covers comes behind
    a, b = start[at], start[at] + step
    if len(at) == 1:
        error = float(np.sqrt(covariance[0, 0]))
        return Change(h.name, float(a[0]), float(b[0]), error, degrees, unit, p_value, names, best.size)
    size_a, size_b = float(np.linalg.norm(a)), float(np.linalg.norm(b))
    along = (b if size_b > size_a else a) / max(size_a, size_b, 1e-300)
    error = float(np.sqrt(along @ covariance @ along))
    turn = float(np.arctan2(a[0] * b[1] - a[1] * b[0], a @ b)) if len(at) == 2 else 0.0
    across = float(np.sqrt(np.trace(covariance) - error**2)) / max(min(size_a, size_b), 1e-300)
    direction = (turn, across) if len(at) == 2 and across < 1.0 else None
    return Change(h.name, size_a, size_b, error, degrees, unit, p_value, names, best.size, direction)
