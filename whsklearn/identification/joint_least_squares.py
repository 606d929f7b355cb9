"""Least squares over the rows of all joints: numbers, their covariance by blocks of the record, held-out errors, and
what another record knows.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular

from whsklearn.effects import InputOffset
from whsklearn.effects.base import Array
from whsklearn.lags.arm_rows import ArmRows
from whsklearn.models.arm import ArmModel
from whsklearn.systems.base_parameters import ROUNDING, whitening

# Blocks of a record, each omitted once for the spread of the numbers. Between two records of 14 unchanged arms of six
# joints, numbers differ by 0.9 standard errors (rms), or by 1.9 if errors are taken to be white, with one in 37 beyond
# five (`benchmarks.blind_arms --numbers`).
N_LEFT_OUT = 20
# Standard errors above zero at which friction is said to grow with the torque, or to act along two joints: Student's t
# over 20 blocks is beyond it once in 25,000 joints that have none.
GROWS = 5.0
SAME = 1e-9  # of the largest singular value: below it, columns are combinations of each other
DIGITS = 4  # of the numbers of a model without standard errors
PRIOR = 1e6  # variance of a number that no row tells, in units of the residual's: as that of `RLSRegressor`
BLOCKS = 10  # blocks of a joint's motion; every second one is held out, and then the others


def with_blocks(rows: ArmRows, weights: Array) -> tuple[Array, Array]:
    """Weights of the columns, and their covariance by leaving out blocks of the record."""
    keep = rows.keep
    theta, white = fitted(rows.phi, rows.target, keep, weights)
    error = (rows.target - rows.phi @ theta) * weights
    return theta, block_covariance((rows.phi * weights[:, None])[keep], error[keep], blocks_of(keep), white)


def blocks_of(keep: NDArray[np.bool_]) -> NDArray[np.int64]:
    """The block of the record, of `N_LEFT_OUT`, to which each used row belongs."""
    block = np.arange(len(keep)) * N_LEFT_OUT // len(keep)
    return np.broadcast_to(block[:, None], keep.shape)[keep]


def fitted(
    phi: Array, target: Array, keep: NDArray[np.bool_], weights: Array, known: Array | None = None
) -> tuple[Array, Array]:
    """Weights of the columns and their covariance, by weighted least squares over the used rows.

    ``known`` (r, p) are further rows with target zero (`Known`).
    """
    rows = (np.concatenate([phi, target[:, :, None]], axis=2) * weights[:, None])[keep]
    if known is not None:
        rows = np.vstack([rows, np.pad(known, ((0, 0), (0, 1)))])
    p, prior = phi.shape[2], np.eye(phi.shape[2], phi.shape[2] + 1) / np.sqrt(PRIOR)
    r: Array = np.asarray(np.linalg.qr(np.vstack([rows, prior]), mode="r"))
    inverse = solve_triangular(r[:p, :p], np.eye(p))
    variance = float(r[p, p] ** 2) / (len(rows) - p) if len(rows) > p else np.nan
    return inverse @ r[:p, p], variance * inverse @ inverse.T


def block_covariance(rows: Array, error: Array, block: NDArray[np.int64], white: Array) -> Array:
    """Covariance of least-squares weights for errors that are neither white nor normal, because those of a real arm
    repeat.

    Each block of rows is omitted in turn, and the covariance is the spread of the fits to the others. It is at least
    ``white`` in every direction, because there are fewer blocks than weights.

    ``rows`` (m, p): weighted. ``error`` (m,): residuals of the fit. ``block`` (m,): to which each row belongs.
    ``white`` (p, p): covariance if the errors were independent.

    References
    ----------
    Kunsch 1989, The jackknife and the bootstrap for general stationary observations, Annals of Statistics 17(3),
    1217-1241.

    Examples
    --------
    >>> import numpy as np
    >>> rng = np.random.default_rng(0)
    >>> x, slow = np.ones((4000, 1)), np.repeat(rng.standard_normal(80), 50)
    >>> white = np.array([[slow.var() / 4000]])
    >>> wide = block_covariance(x, slow - slow.mean(), np.arange(4000) // 200, white)
    >>> bool(20.0 < wide[0, 0] / white[0, 0] < 100.0)  # 80 independent errors, not 4000
    True
    """
    deviation = np.sqrt(error @ error / max(len(error) - rows.shape[1], 1))
    scale = 1.0 / deviation if deviation > 0.0 else 0.0
    unit = _root(white)  # with these weights the rows are orthonormal
    return _wider(unit, _spread(rows @ unit * scale, error * scale, block))


def _root(covariance: Array) -> Array:
    """A matrix whose product with its transpose is the covariance, (p, p)."""
    size = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
    values, vectors = np.linalg.eigh(covariance / np.outer(size, size))
    return np.asarray(size[:, None] * vectors * np.sqrt(np.maximum(values, 0.0)))


def _spread(rows: Array, error: Array, block: NDArray[np.int64]) -> Array:
    """Covariance (p, p) of weights whose total information is the identity, by leaving out each block of rows in
    turn.
    """
    moved = []
    for b in np.unique(block):
        own = rows[block == b]
        others = np.eye(rows.shape[1]) - own.T @ own
        moved.append(np.linalg.lstsq(others, -own.T @ error[block == b], rcond=1e-9)[0])
    apart = np.array(moved) - np.mean(moved, axis=0)
    return np.asarray(apart.T @ apart * (len(moved) - 1.0) / len(moved))


def _wider(unit: Array, spread: Array) -> Array:
    """The covariance ``unit unit'``, widened in every direction in which ``spread`` exceeds one."""
    values, turned = np.linalg.eigh(spread)
    half = unit @ turned * np.sqrt(np.maximum(values, 1.0))
    return np.asarray(half @ half.T)


class Known(NamedTuple):
    """Prior knowledge of the weights from another record: ``root`` (r, p) times (weights - values) has unit variance.

    ``covariance`` (p, p) is that of the values, zero where nothing is known; ``unexplained`` the rms of what they left
    of each joint's drive in that record (Nm or N), by joint, and ``varied`` the standard deviation of that drive.

    >>> import numpy as np
    >>> from whsklearn.datasets import default_arm
    >>> numbers = {"pitch.coulomb": 1.0, "pitch.input_offset": 5.0}
    >>> model = ArmModel(default_arm(), numbers, dt=0.01, logged="position", covariance=np.diag([0.04, 1.0]))
    >>> Known.of(model, list(numbers)).root.round(1).tolist()
    [[5.0, 0.0]]
    """

    values: Array
    covariance: Array
    root: Array
    unexplained: Mapping[str, float]
    varied: Mapping[str, float]

    @classmethod
    def of(cls, model: ArmModel, names: Sequence[str]) -> Known:
        """From a model, in the order of ``names``; nothing is known of drive offsets, which differ between records.

        A model without a covariance is taken to be correct in its first `DIGITS` digits.
        """
        own = list(model.numbers)
        if missing := [n for n in names if n not in model.numbers]:
            raise ValueError(
                f"The model has no number {missing[0]!r}; give one that identify wrote of this robot and law."
            )
        at, values = [own.index(n) for n in names], np.array([model.numbers[n] for n in names], dtype=float)
        c = np.diag((10.0**-DIGITS * np.maximum(np.abs(values), ROUNDING)) ** 2)
        if model.covariance is not None:
            c = np.asarray(model.covariance, dtype=float)[np.ix_(at, at)]
        kept = np.array([not n.endswith(f".{InputOffset.name}") for n in names])
        c = c * np.outer(kept, kept)
        root = np.zeros((int(kept.sum()), len(c)))
        root[:, kept] = whitening(c[np.ix_(kept, kept)])
        return cls(values, c, root, model.unexplained, model.varied)


def updated(rows: Array, target: Array, block: NDArray[np.int64], known: Array) -> tuple[Array, Array, float]:
    """Weights of the columns of a record combined with the prior knowledge from another record; their covariance; its
    inflation.

    The inflation is the factor of the variances over those of independent errors that agree with the other record.

    A number that this record determines better is moved, and one that it hardly determines is kept. Errors that repeat
    within the record reduce the effective number of rows. If the two records disagree by more than their errors, all
    errors are widened.

    ``rows`` (m, p): weighted. ``target`` (m,): minus the prediction from the other record. ``block`` (m,): to which
    each row belongs. ``known`` (r, p): its product with the weights is zero with unit variance (`Known`).

    References
    ----------
    Theil and Goldberger 1961, On pure and mixed statistical estimation in economics, Int. Economic Review 2(1), 65-78;
    Birge 1932, The calculation of errors by the method of least squares, Physical Review 40, 207-227.

    Examples
    --------
    >>> import numpy as np
    >>> rng = np.random.default_rng(0)
    >>> rows = rng.standard_normal((400, 3)) * [1.0, 1.0, 0.0]  # the third moves nothing
    >>> target = rows @ [1.0, 2.0, 3.0] + 0.1 * rng.standard_normal(400)
    >>> x, c, _ = updated(rows, target, np.arange(400) // 20, np.array([[0.0, 0.0, 2.0]]))
    >>> x.round(1).tolist(), float(np.sqrt(c[2, 2]).round(2))  # it stays where it was, +- 1/2
    ([1.0, 2.0, 0.0], 0.5)
    """
    scale = np.linalg.norm(np.vstack([rows, known]), axis=0)
    scale = np.where(scale > 0.0, scale, 1.0)
    rows, known = rows / scale, known / scale
    x = np.linalg.lstsq(rows, target, rcond=SAME)[0]
    left = target - rows @ x
    variance, repeats = max(float(left @ left) / max(len(left) - rows.shape[1], 1), 1e-300), 1.0
    for _ in range(2):  # errors taken as independent, and then as they repeat
        variance *= repeats
        all_rows = np.vstack([rows / np.sqrt(variance), known])
        u, s, vt = np.linalg.svd(all_rows, full_matrices=False)
        s = np.where(s > SAME * s[0], s, np.inf)
        x = (vt.T / s) @ (u[: len(rows)].T @ (target / np.sqrt(variance)))
        unit = vt.T / s
        seen, left = u[: len(rows)], (target - rows @ x) / np.sqrt(variance)
        spread = _spread(seen, left, block)
        repeats = max(repeats, float(np.trace(spread)) / max(float(np.sum(seen**2)), 1e-300))
    beside = u[len(rows) :]
    tested = len(known) - float(np.sum(beside**2))  # directions in which both records carry information
    apart = max(float(np.sum((known @ x) ** 2)) / max(tested, 1.0), 1.0)
    return x / scale, apart * _wider(unit, spread) / np.outer(scale, scale), apart * repeats


def halves(keep: NDArray[np.bool_]) -> list[NDArray[np.bool_]]:
    """Every second block of the used rows of each joint, and the others; both (m, n_joints).

    The blocks are those of a joint's own motion.  With blocks of the record, joints that move one after the other were
    fitted on parts without them, and an error of 0.1 % was told as 1,263 %.
    """
    used = np.cumsum(keep, axis=0)
    block = (used - 1) * BLOCKS // np.maximum(used[-1], 1)
    return [keep & (block % 2 == fold) for fold in range(2)]


def held_out(
    phi: Array, target: Array, keep: NDArray[np.bool_], weights: Array, drive: Array | None = None,
    known: Array | None = None,
) -> Array:  # fmt: skip
    """For each joint the rms error on blocks that were not fitted, as a share of its rms drive there; (n_joints,).

    NaN for a joint without used rows, because it does not move.

    ``phi``, ``target``, ``keep``, ``weights``: rows of all joints, as `RigidBodyLags.joint_rows` makes them. ``drive``
    (m, n_joints): the drives, if ``target`` is only a part of them. ``known`` (r, n_columns): see `fitted`.
    """
    whole = np.sum(np.where(keep, target if drive is None else drive, 0.0) ** 2, axis=0)
    left = np.zeros(target.shape[1])
    for test in halves(keep):
        theta, _ = fitted(phi, target, keep & ~test, weights, known)
        left += np.sum(np.where(test, target - phi @ theta, 0.0) ** 2, axis=0)
    return np.asarray(np.sqrt(left / np.where(whole > 0.0, whole, np.nan)))
