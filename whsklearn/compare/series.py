"""More than two records: where a number changes, whether it has a trend, and the spread between equal axes."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from scipy.stats import chi2
from scipy.stats import t as student

from whsklearn.compare.comparison import Change
from whsklearn.compare.estimate import Estimate, Summand, degrees_of
from whsklearn.compare.hypotheses import LEAST, Difference
from whsklearn.compare.pair import between, changes_between
from whsklearn.compare.rows import Array, Regression


def spread(values: Array, variances: Array) -> tuple[float, float, float]:
    """The mean, the deviation between records beyond that within them, and the p-value that there is none.

    References
    ----------
    DerSimonian and Laird 1986, Controlled Clinical Trials 7(3), 177-188.
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


class Course(NamedTuple):
    """How a number goes from record to record: ``trend``, ``change point`` or ``neither``; its slope a record.

    Examples
    --------
    >>> course(np.array([1.0, 1.2, 1.4, 1.6, 1.8]), np.full(5, 1e-4), 0.01).word
    'trend'
    """

    word: str
    slope: float
    standard_error: float
    p_value: float


def course(values: Array, variances: Array, alpha: float) -> Course:
    """A line through the records in their order, against a step between two of them and against neither.

    Errors of the slope are widened by Birge's ratio, so that records which scatter show no trend.  Of a line and a step
    the one with the lower BIC is told; a step has one number more, its place.

    ``values``, ``variances`` (n_records,): in the order of time. ``alpha``: probability of a word other than
    ``neither`` although the number stays.

    References
    ----------
    Birge 1932, The calculation of errors by the method of least squares, Physical Review 40(2), 207-227; Schwarz 1978,
    Annals of Statistics 6(2), 461-464.
    """
    n = values.size
    place = np.arange(n, dtype=float)
    weighed = [_line(values, variances, x) for x in (place, *(np.float64(place >= k) for k in range(1, n)))]
    slope, variance, left = weighed[0]
    step, of_step, left_by_step = min(weighed[1:], key=lambda fit: fit[2])

    def p(size: float, spread: float, rest: float, asked: int) -> float:
        z = abs(size) / np.sqrt(spread * max(1.0, rest / (n - 2.0)))
        return float(min(1.0, asked * 2.0 * student.sf(z, n - 2.0)))

    of_line, of_a_step = p(slope, variance, left, 1), p(step, of_step, left_by_step, n - 1)
    word = "trend" if left < left_by_step + np.log(n) else "change point"
    if (of_line if word == "trend" else of_a_step) > alpha:
        word = "neither"
    return Course(word, slope, float(np.sqrt(variance * max(1.0, left / (n - 2.0)))), of_line)


def _line(values: Array, variances: Array, x: Any) -> tuple[float, float, float]:
    """(slope over ``x``, its variance, chi-squared of the rest) of a weighted line."""
    w = 1.0 / variances
    beside = x - (w @ x) / w.sum()
    slope = float(w @ (beside * values) / (w @ beside**2))
    rest = values - (w @ values) / w.sum() - slope * beside
    return slope, float(1.0 / (w @ beside**2)), float(w @ rest**2)


def change_point(rows: list[Regression], parts: list[Estimate], alpha: float) -> tuple[list[Change], Difference]:
    """What changed between two consecutive records and stayed, and the difference in which it was found.

    The records of each side must agree better than the two sides do: their scatter counts as noise.
    """
    splits = range(1, len(parts))
    best: tuple[list[Change], Difference] | None = None
    for k in splits:
        inside = np.maximum(scattered(parts[:k]), scattered(parts[k:]))
        between_them = Summand(np.diag(inside), max(len(parts) - 2.0, 1.0))
        noisy = [replace(e, parts=(*e.parts, between_them)) for e in parts]
        d = between(rows, noisy[:k], noisy[k:])
        at = (parts[k - 1].label, parts[k].label)
        found = changes_between(d, rows[0].units, alpha / len(splits))
        found = [replace(c, between=at, p_value=min(1.0, c.p_value * len(splits))) for c in found]
        if best is None or (found and (not best[0] or found[0].p_value < best[0][0].p_value)):
            best = found, d
    assert best is not None
    return best


def scatter(rows: list[Regression], parts: list[Estimate], alpha: float) -> list[Change]:
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
