"""The numbers of one record, with a covariance that is valid for coloured or uneven errors and for a wrong model.

Three estimates of the same spread, none of which is sufficient alone. The spectrum of the residual gives the covariance
under stationary noise, whatever its colour.  Leaving out one block at a time shows where the errors are uneven.  The
halves of a record, which must agree, show what a wrong model makes of another part of the path.  Each may only widen.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from whsklearn.compare.rows import Rows
from whsklearn.gap.calibration import n_effective, smoothed_power

Array = NDArray[Any]

# Variance of the mean over a record that a drift within it stands for, over the power of that drift: of a random walk,
# the means of two records in a row lie twice the drift's rms apart, which is two times its power for either.
WANDERS = 2.0
RIDGE = 1e-9  # of the samples, on columns of unit rms: rounding
AT_MOST = 3.0  # times the rms drive: one standard deviation of any number before the record is seen
PARTS = (2, 4)  # of a record that must agree: whose own spread shows model error of a quarter of a record and longer
SHOWN = 1e-3  # of the mean square of columns of unit rms: a direction in which a part moves less is not asked of it
LEAST_ERROR = 0.0015  # of the rms drive, of every column
# Independent samples.  Over 63 pairs of real equal records (`benchmarks.compare --real`), the numbers of one leave 0.81
# of what its own leave of the other more than they do, rms; a tenth of its power for each of six or seven numbers.
WORTH = 10.0
JUDGED = 8.0  # degrees of freedom of what is set and not estimated: right to a quarter (GUM 2008, eq. G.3)


class Part(NamedTuple):
    """A summand of a covariance, shape (p, p), and the degrees of freedom with which it is known.

    ``walker`` is the number that a drift lets walk; -1 of any other summand.
    """

    covariance: Array
    degrees: float
    walker: int = -1


def degrees_of(parts: Sequence[Part], to: Array) -> float:
    """Degrees of freedom of the covariance of ``to @ values``, shape (k, p), as a whole.

    1 / nu = sum of q_j^2 / nu_j, where q_j is the share of summand j in the covariance.

    References
    ----------
    Satterthwaite 1946, Biometrics Bulletin 2(6), 110-114; Welch 1947, Biometrika 34, 28-35.

    Examples
    --------
    >>> known, guessed = Part(np.eye(2), 100.0), Part(np.diag([0.0, 1.0]), 4.0)
    >>> [round(degrees_of([known, guessed], unit[None]), 1) for unit in np.eye(2)]
    [100.0, 15.4]
    """
    each = [to @ part.covariance @ to.T for part in parts]
    inverse = np.linalg.pinv(np.sum(each, axis=0), rcond=1e-10, hermitian=True)
    shares = np.array([np.sum(inverse * one) for one in each]) / to.shape[0]
    return float(1.0 / max(float(np.sum(shares**2 / [p.degrees for p in parts])), 1e-9))


@dataclass(frozen=True)
class Estimate:
    """Numbers of a record.

    Attributes
    ----------
    label : str
    values : ndarray of shape (p,)
    parts : tuple of Part
        Of the covariance.
    left : float
        Rms of the residual, as a share of the rms drive.
    drift : dict
        Number -> rms by which it drifts within the record, beyond noise.
    courses : dict
        Number -> its half waves along the record, as fitted, from the longest on.
    """

    label: str
    values: Array
    parts: tuple[Part, ...]
    left: float
    drift: dict[int, float]
    courses: dict[int, Array] = field(default_factory=dict)

    @cached_property
    def covariance(self) -> Array:
        """Of the values, shape (p, p)."""
        return np.asarray(np.sum([part.covariance for part in self.parts], axis=0))

    @cached_property
    def errors(self) -> Array:
        """Standard errors, shape (p,)."""
        return np.sqrt(np.diag(self.covariance))


def estimate(rows: Rows) -> Estimate:
    """Least squares of one record, with drift projected out.

    References
    ----------
    Newey and West 1987, Econometrica 55(3), 703-708, for errors of any colour; Quenouille 1956 and Tukey 1958 for the
    jackknife; Kuensch 1989, Annals of Statistics 17(3), 1217-1241, for its blocks.
    """
    z = np.column_stack([rows.columns, rows.nuisances])
    size = np.maximum(np.sqrt(np.mean(z**2, axis=0)), 1e-300)
    z = z / size
    prior = AT_MOST * float(np.linalg.norm(rows.scale))
    ridge = _ridge(z, rows, prior)
    inverse = np.linalg.inv(z.T @ z + ridge * np.eye(z.shape[1]))
    fit = inverse @ (z.T @ rows.target)
    left = (rows.target - z @ fit) * np.sqrt(z.shape[0] / max(z.shape[0] - z.shape[1], 1))  # the fit took its share
    p = rows.columns.shape[1]
    noise = _wider(_stationary(z @ inverse, left, rows), _by_block(z, rows, ridge)) * _disagreement(z, rows, left)
    wider = _wider(noise, _stationary(z @ inverse, left, rows, most=WORTH))
    wider = wider + (ridge * prior) ** 2 * (inverse @ inverse)
    wider[:p, :p] += np.diag((LEAST_ERROR * rows.scale) ** 2 @ rows.paid())
    power = _walks(fit[p:], rows.of, size[p:], size[:p])
    by_noise = _walks(np.sqrt(np.diag(noise)[p:]), rows.of, size[p:], size[:p])
    drift = {i: float(np.sqrt(w - by_noise[i])) / size[i] for i, w in power.items() if w > by_noise[i]}
    unit = np.outer(size[:p], size[:p])
    parts = (
        Part(noise[:p, :p] / unit, float(rows.block.max())),
        Part((wider - noise)[:p, :p] / unit, JUDGED),
        *(Part(np.diag(WANDERS * w * np.eye(p)[i]) / unit, float(rows.of.count(i)), i) for i, w in power.items()),
    )
    share = float(np.sqrt(np.mean(left**2)) / np.linalg.norm(rows.scale))
    waves = fit[p:] / size[p:]
    courses = {i: waves[: len(rows.of)][[j == i for j in rows.of]] for i in power}
    return Estimate(rows.label, fit[:p] / size[:p], parts, share, drift, courses)


def _ridge(z: Array, rows: Rows, prior: float) -> float:
    """Noise over the prior of every number, columns of unit rms: numbers without data get a large error."""
    left = rows.target - z @ np.linalg.lstsq(z, rows.target, rcond=RIDGE)[0]
    noise = float(left @ left) / n_effective(left)
    return max(noise / prior**2, RIDGE * rows.target.size)


def _stationary(weights: Array, left: Array, rows: Rows, most: float = np.inf) -> Array:
    """Covariance of ``weights.T @ noise`` for noise with the residual's spectrum; holes in the grid are zeros.

    What noise of the sensors does not explain counts as ``most`` independent samples at the most, however long the
    record: the errors of a model come again with every motion.
    """
    out = np.zeros((weights.shape[1], weights.shape[1]))
    for those in rows.channels():
        at = rows.at[those] - rows.at[those[0]]
        n = int(at[-1]) + 1
        noise, w = np.zeros(n), np.zeros((n, weights.shape[1]))
        noise[at] = left[those]
        w[at] = weights[those]
        spectrum = smoothed_power(noise) / at.size
        by_sensors = min(1.0, rows.floor**2 / max(float(np.mean(left[those] ** 2)), 1e-300))
        spectrum *= by_sensors + (1.0 - by_sensors) * max(1.0, n_effective(left[those]) / most)
        f = np.fft.rfft(w, axis=0)
        twice = np.full(f.shape[0], 2.0)
        twice[0] = 1.0
        if n % 2 == 0:
            twice[-1] = 1.0
        out += np.real((f.conj().T * (twice * spectrum)) @ f) / n
    return out


def _wider(a: Array, b: Array) -> Array:
    """The covariance ``a``, wider in every direction in which ``b`` is wider.

    Not number by number: without one of its blocks a record may not separate two numbers any more, and still know their
    sum.
    """
    values, vectors = np.linalg.eigh(a)
    root = vectors * np.sqrt(np.maximum(values, values[-1] * RIDGE))
    inverse = np.linalg.pinv(root)
    more, along = np.linalg.eigh(inverse @ b @ inverse.T)
    turned = root @ along
    return np.asarray((turned * np.maximum(more, 1.0)) @ turned.T)


def _by_block(z: Array, rows: Rows, ridge: float) -> Array:
    """Covariance by the jackknife over blocks."""
    parts = [np.flatnonzero(rows.block == k) for k in np.unique(rows.block)]
    grams = np.array([z[s].T @ z[s] for s in parts])
    crosses = np.array([z[s].T @ rows.target[s] for s in parts])
    total, cross = grams.sum(axis=0), crosses.sum(axis=0)
    held = ridge * np.eye(z.shape[1])
    without = np.array([np.linalg.solve(total - g + held, cross - c) for g, c in zip(grams, crosses, strict=True)])
    apart, m = without - without.mean(axis=0), len(parts)
    return np.asarray((m - 1.0) / m * apart.T @ apart)


def _disagreement(z: Array, rows: Rows, left: Array) -> float:
    """Birge's ratio: by how much more the parts of a record disagree than its noise says; at least 1.

    Of halves or quarters, whichever is larger, each in the directions that it shows.  What drifts keeps its course: it
    is known from the whole record.
    """
    p, n = rows.columns.shape[1], rows.target.size
    most = 1.0
    for m in PARTS:
        beyond, information, asked = [], [], -p  # the mean of the parts takes p
        part = rows.block * m // (rows.block.max() + 1)
        for k in np.unique(part):
            at = part == k
            x = z[at, :p]
            power, along = np.linalg.eigh(x.T @ x / at.sum())
            shown = power > SHOWN
            weights = np.zeros((n, int(shown.sum())))
            weights[at] = x @ along[:, shown] / (power[shown] * at.sum())
            known = np.linalg.pinv(_stationary(weights, left, rows), hermitian=True)  # zero of a record and itself
            beyond.append(along[:, shown] @ (weights.T @ left))
            information.append(along[:, shown] @ known @ along[:, shown].T)
            asked += int(shown.sum())
        mean = np.linalg.pinv(np.sum(information, axis=0), rcond=RIDGE, hermitian=True) @ np.sum(
            [w @ v for w, v in zip(information, beyond, strict=True)], axis=0
        )
        chi2 = sum(float((v - mean) @ w @ (v - mean)) for v, w in zip(beyond, information, strict=True))
        most = max(most, chi2 / max(asked, 1))
    return most


def _walks(fit: Array, of: tuple[int, ...], size: Array, unit: Array) -> dict[int, float]:
    """Mean square by which each number moves along its half waves; scaled as the numbers are."""
    power: dict[int, float] = {}
    for i, c, s in zip(of, fit, size, strict=False):  # behind them come the shapes
        power[i] = power.get(i, 0.0) + 0.5 * float((c * unit[i] / s) ** 2)
    return power


def from_a_cold_start(a: Estimate, b: Estimate) -> tuple[Estimate, Estimate]:
    """Two records with what drifts alike in both taken for a course that each began anew, as warming does.

    What a drift leaves open is by how much a number may have wandered from one record to the other.  It is the drift in
    which they differ that says so: a course that comes again in the second record ends where it ended in the first.
    Only where the second record goes on where the first has ended may all of the drift be what lies between them.
    """
    kept: dict[int, Array] = {}
    for i, first in a.courses.items():
        n = min(first.size, b.courses.get(i, first[:0]).size)
        if n:
            first, second = first[:n], b.courses[i][:n]
            ends, begins = float(first @ (-1.0) ** np.arange(1, n + 1)), float(second.sum())
            moved = float(b.values[i] - a.values[i])
            if abs(moved + begins - ends) > abs(moved):
                kept[i] = np.diag(WANDERS / 4.0 * np.sum((second - first) ** 2) * np.eye(a.values.size)[i])

    def held(e: Estimate) -> Estimate:
        parts = (p._replace(covariance=kept[p.walker]) if p.walker in kept else p for p in e.parts)
        return replace(e, parts=tuple(parts))

    return held(a), held(b)


def pooled(parts: list[Estimate]) -> Estimate:
    """Several records combined into one: their mean, weighted by information."""
    if len(parts) == 1:
        return parts[0]
    weights = [np.linalg.inv(e.covariance) for e in parts]
    covariance = np.linalg.inv(np.sum(weights, axis=0))
    shares = [covariance @ w for w in weights]
    return Estimate(
        ", ".join(e.label for e in parts),
        np.sum([s @ e.values for s, e in zip(shares, parts, strict=True)], axis=0),
        tuple(Part(s @ p.covariance @ s.T, p.degrees) for s, e in zip(shares, parts, strict=True) for p in e.parts),
        float(np.sqrt(np.mean([e.left**2 for e in parts]))), {},
    )  # fmt: skip
