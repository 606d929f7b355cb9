"""To first order, what every family of effects would explain in a record and in the model's own records.

Near a fitted model everything is linear: the residual is a vector, the model's own parameters span a subspace, and an
effect of given shape adds one column or a few.  So one scan answers both questions for a record and for any number of
null records at once: project the plane out, and see how much of each vector the columns take.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from whsklearn.gap.calibration import p_value

Array = NDArray[Any]

# Share of a column that must be left beside the model's own: below it, rounding is all that is seen.
VISIBLE = 1e-3
# Of the power of two columns, added to the diagonal: a wave over less than a period is a line and a parabola.
RIDGE = 1e-5
ROUNDING = 1e-14  # of the power of columns, far below what is `VISIBLE` of them
ALL = slice(None)


@dataclass(frozen=True)
class Family:
    """One candidate with all shapes in which it is looked for.

    Attributes
    ----------
    name : str
        Canonical name of the effect; empty for the nameless basis.
    blocks : callable
        (tangent) -> triples of (shapes, columns, shares): s shapes, their columns of shape (n, s, k), and by how much
        each makes the whole smaller than it was, shape (s,) (one, where nothing is taken off the drive).
    start : callable
        (shape, sizes of shape (k,)) -> what a refit starts from.
    n_numbers : int
        Free numbers, shape included.
    positive : bool
        Whether its one size must be positive.
    offset : bool
        Whether the columns are not scaled: the effect has no size of its own, it is there or it is not.
    rows : slice
        On which the columns lie; they are zero elsewhere.
    place : frozenset of str
        Where the effect acts; effects without a place in common are no rivals.  Empty: everywhere.
    """

    name: str
    blocks: Callable[[Tangent], Iterable[tuple[Any, Array, Array | float]]]
    start: Callable[[Any, Array], Any]
    n_numbers: int = 1
    positive: bool = False
    offset: bool = False
    rows: slice = field(default_factory=lambda: ALL)
    place: frozenset[str] = frozenset()


@dataclass(frozen=True)
class Look:
    """What one family explains at its best shape.

    Attributes
    ----------
    name : str
    gain : float
        g = n ln(RSS without / RSS with) of the record.
    null : ndarray of shape (m,)
        The same of the model's own records, each at its own best shape.
    start : object
        What a refit starts from.
    n_numbers : int
    size : float
        Rms of what it explains, in the unit of the residual.
    visible : float
        Share of its columns that is left beside the model's own numbers.
    p_value : float
        That chance reaches the gain, the number of families taken into account.
    place : frozenset of str
        Of its family.
    degrees : float
        See `whsklearn.gap.calibration.p_value`.
    swapped : bool
        Whether the gain is that of a regression the other way round (`whsklearn.gap.plants.servo_families`).
    """

    name: str
    gain: float
    null: Array = field(repr=False)
    start: Any = None
    n_numbers: int = 1
    size: float = 0.0
    visible: float = 1.0
    p_value: float = 1.0
    place: frozenset[str] = frozenset()
    degrees: float = 0.0
    swapped: bool = False

    @property
    def score(self) -> float:
        """g - 2 mean g* (Ishiguro, Sakamoto and Kitagawa 1997, Ann. Inst. Stat. Math. 49(3), 411-434)."""
        return self.gain - 2.0 * float(np.mean(self.null))


@dataclass
class Tangent:
    """What a model leaves of a record, and of records of its own, beside its own columns.

    Parameters
    ----------
    left : ndarray of shape (n,)
        What the fitted model leaves of the record.
    null : ndarray of shape (m, n)
        What it leaves of records that it made itself.
    columns : ndarray of shape (n, p)
        Derivatives by its own numbers.
    n : float
        Independent samples among the n.
    weight : ndarray of shape (n,), optional
        Of every sample; zero where one is excluded.
    known : ndarray of shape (r, p), optional
        Times the model's own numbers it is zero with the variance of a weighted sample: what another record knows of
        them.  They then take less than everything that lies in their span, as in any generalised least squares.
    """

    left: Array
    null: Array
    columns: Array
    n: float
    weight: Array | None = None
    known: Array | None = None

    def __post_init__(self) -> None:
        norm = np.linalg.norm(self.columns, axis=0)
        used = norm > 1e-12 * max(float(norm.max(initial=0.0)), 1e-300)
        scaled = self._weighted(self.columns[:, used] / norm[used])
        n = len(scaled)
        if self.known is not None:
            scaled = np.vstack([scaled, self.known[:, used] / norm[used]])
            both = np.linalg.norm(scaled, axis=0)
            scaled = scaled[:, both > 0.0] / both[both > 0.0]  # a column of zeros has no direction
        self.plane: Array = np.linalg.qr(scaled)[0][:n] if scaled.size else np.zeros((self.left.size, 0))
        rows = self._weighted(np.vstack([self.left[None, :], self.null]).T)
        self.rows = rows - self.plane @ (self.plane.T @ rows)  # (n, 1 + m), the record first
        self.power = np.sum(self.rows * rows, axis=0)

    def _weighted(self, x: Array, rows: slice = ALL) -> Array:
        return x if self.weight is None else x * self.weight[rows].reshape(-1, *([1] * (x.ndim - 1)))

    def taken(self, family: Family, columns: Array) -> tuple[Array, Array, Array]:
        """What columns of s shapes take of every row.

        Returns
        -------
        power : ndarray of shape (s, 1 + m)
            That goes.
        sizes : ndarray of shape (s, k)
            Least-squares sizes in the record.
        visible : ndarray of shape (s,)
            Share of the columns beside the plane.
        """
        n, s, k = columns.shape
        z = self._weighted(columns, family.rows)
        flat = z.reshape(n, s * k)
        whole = np.sum(flat**2, axis=0).reshape(s, k).sum(axis=1)
        inside = (self.plane[family.rows].T @ flat).reshape(-1, s, k)
        cross = (flat.T @ self.rows[family.rows]).reshape(s, k, -1)
        gram = np.einsum("nsi,nsj->sij", z, z) - np.einsum("psi,psj->sij", inside, inside)
        seen = np.maximum(np.trace(gram, axis1=1, axis2=2), 0.0)
        visible = np.sqrt(seen / np.maximum(whole, 1e-300))
        ok = visible > VISIBLE
        held = (RIDGE if k > 1 else 0.0) * seen + ROUNDING * whole + 1e-300
        gram = gram + held[:, None, None] * np.eye(k)
        sizes = np.ones_like(cross) if family.offset else np.linalg.solve(gram, cross)
        if family.offset:
            power = 2.0 * cross.sum(axis=1) - gram.sum(axis=(1, 2))[:, None]
        else:
            power = np.einsum("ski,ski->si", sizes, cross)
        if family.positive and k == 1:
            power = np.where(sizes[:, 0, :] > 0.0, power, 0.0)
        power[~ok] = 0.0
        return np.clip(power, 0.0, (1.0 - 1e-12) * self.power), sizes[:, :, 0], visible

    def look(self, family: Family) -> Look | None:
        """The family at its best shape; None where it has no shape to look at."""
        best = np.full(self.rows.shape[1], 0.0)
        found: tuple[Any, Array] | None = None
        seen, n_shapes, degrees = 0.0, 0, 0.0
        for shapes, columns, shares in family.blocks(self):
            if columns.shape[1] == 0 or not np.all(np.isfinite(columns)):
                continue
            power, sizes, visible = self.taken(family, columns)
            # the residual counts as a share of the remaining whole: a limit reduces the drive and everything with it
            power = self.power - (self.power - power) / np.reshape(shares, (-1, 1)) ** 2
            seen = max(seen, float(visible.max()))
            n_shapes += columns.shape[1]
            degrees = 0.5 if family.positive else float(columns.shape[2])
            i = int(np.argmax(power[:, 0]))
            if found is None or power[i, 0] > best[0]:
                found = shapes[i], sizes[i]
            best = np.maximum(best, power.max(axis=0))
        if found is None:
            return None
        gains = -self.n * np.log1p(-best / np.maximum(self.power, 1e-300))
        start = family.start(*found)
        size = float(np.sqrt(best[0] / self.left.size))
        return Look(
            family.name, float(gains[0]), gains[1:], start, family.n_numbers, size, seen, place=family.place,
            degrees=degrees if n_shapes == 1 and not family.offset else 0.0,
        )  # fmt: skip


def with_p_values(looks: list[Look], least: float = 0.0) -> list[Look]:
    """The looks with their p-values, of as many families as were asked, the best score first.

    Parameters
    ----------
    looks : list of Look
    least : float
        Size below which an effect is not worth naming, in the unit of `Look.size`; not asked of nameless functions.
        The hypothesis that is tested is then an effect of at most this size, not of none: own records of a model hold
        what a model can know, so that with enough samples anything is significant, a hundredth of a percent of the
        drive too.  Of the gain of an effect of size s, which grows with its square, what goes beyond the largest of
        the hypothesis is g (1 - least / s)^2.

    References
    ----------
    Hodges and Lehmann 1954, Testing the approximate validity of statistical hypotheses, JRSS B 16(2), 261-268.
    """
    return sorted((replace(k, p_value=chance(k, k.null, len(looks), least)) for k in looks), key=lambda k: -k.score)


def chance(look: Look, null: Array, families: int, least: float) -> float:
    """The p-value of a look among so many families by these null gains; see `with_p_values`."""
    asked = least if look.name else 0.0  # nameless functions answer whether anything at all follows the motion
    beyond = max(0.0, 1.0 - asked / look.size) ** 2 if asked > 0.0 and look.size > 0.0 else 1.0
    return p_value(look.gain * beyond, null, families, look.degrees) if beyond > 0.0 else 1.0
