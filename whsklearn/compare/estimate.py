"""The numbers of one record, with a covariance that is valid for coloured or uneven errors and for a wrong model.

Three looks at the same spread, none of which is enough alone.  The spectrum of what is left gives the covariance under
stationary noise, whatever its colour.  Leaving out one block at a time shows where the errors are uneven.  The halves
of a record, which must agree, show what a wrong model makes of another part of the path.  Each may only widen.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from whsklearn.compare.rows import SLOWER, Rows
from whsklearn.gap.calibration import smoothed_power

Array = NDArray[Any]

# Variance of the mean over a record that a drift within it stands for, over the power of that drift.  Of a random walk
# the means of two records in a row lie twice the drift's rms apart, which is two times its power for either; the power
# is known from two or three half waves only, and Student's law of so few has tails twice as far out.
WANDERS = 8.0
# A model that leaves a tenth of the drive has columns that are wrong by a part of it, the same all over a record and
# another on another path, which no resampling of one record shows.
RIDGE = 1e-9  # of the samples, on columns of unit rms: rounding, and a number that no sample shows gets no value
PARTS = (2, 4)  # of a record that must agree: whose own spread shows model error of a quarter of a record and longer
SHOWN = 1e-3  # of the mean square of columns of unit rms: a direction in which a part moves less is not asked of it
LEAST_ERROR = 0.0015  # of the rms drive, of every column
OF_WHAT_IS_LEFT = 0.1


@dataclass(frozen=True)
class Estimate:
    """Numbers of a record.

    Attributes
    ----------
    label : str
    values : ndarray of shape (p,)
    covariance : ndarray of shape (p, p)
    degrees : float
        Degrees of freedom of the covariance: the number of blocks minus one.
    left : float
        Rms of the residual, as a share of the rms drive.
    drift : dict
        Number -> rms by which it drifts within the record, beyond noise.
    """

    label: str
    values: Array
    covariance: Array
    degrees: float
    left: float
    drift: dict[int, float]


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
    inverse = np.linalg.inv(z.T @ z + RIDGE * rows.target.size * np.eye(z.shape[1]))
    fit = inverse @ (z.T @ rows.target)
    left = (rows.target - z @ fit) * np.sqrt(z.shape[0] / max(z.shape[0] - z.shape[1], 1))  # the fit took its share
    p = rows.columns.shape[1]
    covariance = _stationary(z @ inverse, left, rows)
    covariance = _wider(covariance, _by_block(z, rows)) * _disagreement(z, rows, left)
    drift = _drift(fit[p:], np.diag(covariance)[p:], rows.of, size[p:], size[:p])
    covariance = covariance[:p, :p]
    for i, walk in drift.items():
        covariance[i, i] += WANDERS * walk**2
    covariance = covariance + np.diag(_of_the_model(left, rows))
    size = size[:p]
    return Estimate(
        rows.label, fit[:p] / size, covariance / np.outer(size, size), float(rows.block.max()),
        float(np.sqrt(np.mean(left**2)) / np.linalg.norm(rows.scale)), {i: w / size[i] for i, w in drift.items()},
    )  # fmt: skip


def _of_the_model(left: Array, rows: Rows) -> Array:
    """Variance of every number by errors of the model, columns of unit rms: what is left where the number is paid."""
    n, least = rows.target.size, []
    for those, drive in zip(rows.channels(), rows.scale.tolist(), strict=True):
        fast = _fast(left, rows, those) * np.sqrt(those.size / n)
        least.append(max(OF_WHAT_IS_LEFT * fast, LEAST_ERROR * drive))
    return np.asarray(np.array(least) ** 2 @ rows.paid())


def _fast(left: Array, rows: Rows, those: NDArray[np.intp]) -> float:
    """Rms of what is left that is no slower than the motion: a walk of the offset is no error of the model."""
    at = rows.at[those] - rows.at[those[0]]
    grid = np.zeros(int(at[-1]) + 1)
    grid[at] = left[those]
    power = np.abs(np.fft.rfft(grid)) ** 2
    fast = np.fft.rfftfreq(grid.size, rows.step) >= rows.slowest / SLOWER
    return float(np.sqrt(np.mean(left[those] ** 2) * power[fast].sum() / max(float(power.sum()), 1e-300)))


def _stationary(weights: Array, left: Array, rows: Rows) -> Array:
    """Covariance of ``weights.T @ noise`` for noise of the spectrum of what is left; gaps in the grid hold zeros."""
    out = np.zeros((weights.shape[1], weights.shape[1]))
    for those in rows.channels():
        at = rows.at[those] - rows.at[those[0]]
        n = int(at[-1]) + 1
        noise, w = np.zeros(n), np.zeros((n, weights.shape[1]))
        noise[at] = left[those]
        w[at] = weights[those]
        spectrum = smoothed_power(noise) / at.size
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


def _by_block(z: Array, rows: Rows) -> Array:
    """Covariance by the jackknife over blocks."""
    parts = [np.flatnonzero(rows.block == k) for k in np.unique(rows.block)]
    grams = np.array([z[s].T @ z[s] for s in parts])
    crosses = np.array([z[s].T @ rows.target[s] for s in parts])
    total, cross = grams.sum(axis=0), crosses.sum(axis=0)
    ridge = RIDGE * rows.target.size * np.eye(z.shape[1])
    without = np.array([np.linalg.solve(total - g + ridge, cross - c) for g, c in zip(grams, crosses, strict=True)])
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


def _drift(fit: Array, variance: Array, of: tuple[int, ...], size: Array, unit: Array) -> dict[int, float]:
    """Rms by which each number walks, beyond what noise makes of its half waves; scaled as the numbers are."""
    power: dict[int, float] = {}
    for i, c, v, s in zip(of, fit, variance, size, strict=False):  # behind them come the shapes
        power[i] = power.get(i, 0.0) + 0.5 * float((c**2 - v) * (unit[i] / s) ** 2)
    return {i: float(np.sqrt(x)) for i, x in power.items() if x > 0.0}


def pooled(parts: list[Estimate]) -> Estimate:
    """Several records combined into one: their mean, weighted by information."""
    if len(parts) == 1:
        return parts[0]
    weights = [np.linalg.inv(e.covariance) for e in parts]
    covariance = np.linalg.inv(np.sum(weights, axis=0))
    values = covariance @ np.sum([w @ e.values for w, e in zip(weights, parts, strict=True)], axis=0)
    return Estimate(
        ", ".join(e.label for e in parts), values, covariance, float(sum(e.degrees for e in parts)),
        float(np.sqrt(np.mean([e.left**2 for e in parts]))), {},
    )  # fmt: skip
