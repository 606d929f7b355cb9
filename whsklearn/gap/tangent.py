"""To first order, what every family of effects would explain in a record and in the model's own records.

Near a fitted model everything is linear: the residual is a vector, the model's own parameters span a subspace, and an
effect of given shape adds one column or a few.  So one scan serves a record and any number of null records at once:
project the subspace out, and compute how much of each vector the columns explain.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from whsklearn.gap.calibration import p_value
from whsklearn.gap.record import Array

# (shapes, columns, shares) of s shapes: the columns have shape (n, s, k), and the shares (s,) are the factor by which
# each shape reduces the whole (one if it takes nothing off the drive)
Blocks = Iterator[tuple[Any, Array, Array | float]]
# Share of a column that must remain outside the span of the model's own: below it, only rounding errors are seen.
VISIBLE = 1e-3
# Share of the power of two columns that is added to the diagonal: a wave over less than a period is a line and a
# parabola.
RIDGE = 1e-5
AT_ONCE = 64  # shapes whose columns are held at once
ALL = slice(None)


@dataclass(frozen=True)
class Family:
    """One candidate with all shapes that are tried."""

    name: str  # canonical name of the effect; empty for the nameless basis
    blocks: Callable[[Tangent], Blocks]
    start: Callable[[Any, Array], Any]  # (shape, sizes of shape (k,)) -> the start of a refit
    n_numbers: int = 1  # free numbers, shape included
    positive: bool = False  # whether its one size must be positive
    offset: bool = False  # whether the columns are not scaled, because the effect has no size: it is present or absent
    rows: slice = field(default_factory=lambda: ALL)  # rows on which the columns are not zero
    # where the effect acts; effects without a common place are not rivals. If empty, it acts everywhere.
    place: frozenset[str] = frozenset()
    signal: str = ""  # the one signal of which it is a function; empty if of several


@dataclass(frozen=True)
class Look:
    """What one family explains at its best shape."""

    name: str
    gain: float  # g = n ln(RSS without / RSS with) of the record
    null: Array = field(repr=False)  # (m,): the same for the model's own records, each at its own best shape
    start: Any = None  # the start of a refit
    n_numbers: int = 1
    size: float = 0.0  # rms of what it explains, in the unit of the residual
    visible: float = 1.0  # share of its columns outside the span of the model's own
    p_value: float = 1.0  # probability that chance reaches the gain, corrected for the number of families
    place: frozenset[str] = frozenset()
    signal: str = ""  # of its family
    degrees: float = 0.0  # see `whsklearn.gap.calibration.p_value`
    # whether the gain is that of a regression the other way round (`whsklearn.gap.plants.servo_families`)
    swapped: bool = False
    diluted: float = 1.0  # by how much what the samples tell makes `size` smaller (`undiluted`)
    # (n,): what it explains of the record, outside the subspace
    explained: Array | None = field(default=None, repr=False)

    @property
    def whole(self) -> float:
        """Rms of what it explains if all samples count alike: weights show what is certain, and not how large it is."""
        return self.size / self.diluted

    @property
    def score(self) -> float:
        """g - 2 mean g* (Ishiguro, Sakamoto and Kitagawa 1997, Ann. Inst. Stat. Math. 49(3), 411-434)."""
        return self.gain - 2.0 * float(np.mean(self.null))


@dataclass
class Tangent:
    """The residuals of a model in a record and in records of its own, with its own columns projected out."""

    left: Array  # (n,): residual of the fitted model in the record
    null: Array  # (m, n): its residuals in records that it simulated itself
    columns: Array  # (n, p): derivatives by its own numbers
    n: float  # independent samples among the n
    weight: Array | None = None  # (n,): of every sample; zero if it is excluded
    # (r, p): rows from another record: their product with the model's own numbers is zero with the variance of a
    # weighted sample. The numbers then explain less than everything in their span, as in any generalised least squares.
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
        """The power (s, 1 + m) that columns of s shapes explain in every row, least-squares sizes (s, k), and the share
        (s,) of the columns outside the subspace.
        """
        n, s, k = columns.shape
        z = self._weighted(columns, family.rows)
        flat = z.reshape(n, s * k)
        own = products(z)
        whole = np.trace(own, axis1=1, axis2=2)
        inside = (self.plane[family.rows].T @ flat).reshape(-1, s, k)
        cross = (flat.T @ self.rows[family.rows]).reshape(s, k, -1)
        gram = own - products(inside)
        seen = np.maximum(np.trace(gram, axis1=1, axis2=2), 0.0)
        visible = np.sqrt(seen / np.maximum(whole, 1e-300))
        ok = visible > VISIBLE
        held = (RIDGE if k > 1 else 0.0) * seen + n * np.finfo(float).eps * whole + 1e-300
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
        """The family at its best shape; None if it has no shape that the record can show."""
        return looks_at(family, self)[0]


class _Scan:
    """One tangent's look at a family, block by block."""

    def __init__(self, tangent: Tangent, family: Family) -> None:
        self.tangent, self.family = tangent, family
        self.best = np.zeros(tangent.rows.shape[1])
        self.found: tuple[Any, Array] | None = None
        self.explained = np.zeros(tangent.left.size)
        self.seen, self.n_shapes, self.degrees = 0.0, 0, 0.0

    def take(self, shapes: Any, columns: Array, shares: Array) -> None:
        """Some of the shapes; see `Family.blocks`."""
        family, whole = self.family, self.tangent.power
        power, sizes, visible = self.tangent.taken(family, columns)
        # the residual counts as a share of the remaining whole: a limit reduces the drive and everything with it
        power = whole - (whole - power) / shares[:, None] ** 2
        self.seen = max(self.seen, float(visible.max()))
        self.n_shapes += columns.shape[1]
        self.degrees = 0.5 if family.positive else float(columns.shape[2])
        i = int(np.argmax(power[:, 0]))
        if self.found is None or power[i, 0] > self.best[0]:
            self.found = shapes[i], sizes[i]
            self.explained[family.rows] = self.tangent._weighted(columns[:, i] @ sizes[i], family.rows)
        self.best = np.maximum(self.best, power.max(axis=0))

    def look(self) -> Look | None:
        """What was found; None if there was no shape."""
        if self.found is None:
            return None
        family, tangent = self.family, self.tangent
        gains = -tangent.n * np.log1p(-self.best / np.maximum(tangent.power, 1e-300))
        return Look(
            family.name, float(gains[0]), gains[1:], family.start(*self.found), family.n_numbers,
            float(np.sqrt(self.best[0] / tangent.left.size)), self.seen, place=family.place, signal=family.signal,
            degrees=self.degrees if self.n_shapes == 1 and not family.offset else 0.0,
            explained=self.explained - tangent.plane @ (tangent.plane.T @ self.explained),
        )  # fmt: skip


def undiluted(look: Look, told: Array | None) -> Look:
    """The look with what makes its size smaller than its effect is: the weights ``told``, shape (n,), of 0 to 1."""
    if told is None or look.explained is None or not look.explained.any():
        return look
    whole = np.divide(look.explained, told, out=np.zeros_like(told), where=told > 0.0)
    return replace(look, diluted=float(np.linalg.norm(look.explained) / np.linalg.norm(whole)))


def looks_at(family: Family, *tangents: Tangent) -> list[Look | None]:
    """The looks of tangents of the same samples at one family, whose columns are made once, for the first of them."""
    scans = [_Scan(tangent, family) for tangent in tangents]
    for block in _joined(family.blocks(tangents[0])):
        for scan in scans:
            scan.take(*block)
    return [scan.look() for scan in scans]


def _joined(blocks: Blocks) -> Iterator[tuple[list[Any], Array, Array]]:
    """The finite blocks, small ones joined: the null rows are read once for `AT_ONCE` shapes, not for each of them."""
    held: list[tuple[Any, Array, Array]] = []
    n = 0
    for shapes, columns, shares in blocks:
        if columns.shape[1] == 0 or not np.all(np.isfinite(columns)):
            continue
        held.append((shapes, columns, np.broadcast_to(shares, columns.shape[1])))
        n += columns.shape[1]
        if n >= AT_ONCE:
            yield _one(held)
            held, n = [], 0
    if held:
        yield _one(held)


def _one(blocks: list[tuple[Any, Array, Array]]) -> tuple[list[Any], Array, Array]:
    shapes, columns, shares = zip(*blocks, strict=True)
    return [s for some in shapes for s in some], np.concatenate(columns, axis=1), np.concatenate(shares)


def products(columns: Array) -> Array:
    """Inner products of the columns of every shape: (n, s, k) to (s, k, k)."""
    by_shape = columns.transpose(1, 2, 0)
    return np.asarray(by_shape @ by_shape.transpose(0, 2, 1))


def strongest_lines(rows: Array, kept: Array, step: float, low: float, high: float) -> list[float]:
    """Frequencies (Hz) of the strongest line of every row of residuals, each once: where a tone may be.

    ``rows`` (n, m): `Tangent.rows`. ``kept``: samples of an even grid to which they belong; the others count as zero.
    ``step``: of that grid (s). ``low``, ``high``: lowest and highest frequency (Hz).
    """
    whole = np.zeros((rows.shape[1], kept.size))
    whole[:, kept] = rows.T
    n = 4 * kept.size
    frequency = np.fft.rfftfreq(n, step)
    inside = np.flatnonzero((frequency >= low) & (frequency <= high))
    if inside.size == 0:
        return []
    power = np.abs(np.fft.rfft(whole, n)) ** 2
    best = np.clip(inside[np.argmax(power[:, inside], axis=1)], 1, frequency.size - 2)
    below, here, above = (power[np.arange(best.size), best + k] for k in (-1, 0, 1))
    bend = 2.0 * here - below - above
    # the vertex of the parabola through three lines; at an end of the band there may be none
    off = np.clip(np.divide(0.5 * (above - below), bend, out=np.zeros(best.size), where=bend > here * 1e-9), -0.5, 0.5)
    return [float(f) for f in np.unique(np.clip((best + off) * frequency[1], low, high))]


def lines(rows: Array, kept: Array, step: float, low: float, high: float, time: Array) -> Blocks:
    """A cosine and a sine of ``time`` (n,) at each of the `strongest_lines`."""
    if best := strongest_lines(rows, kept, step, low, high):
        phase = 2 * np.pi * time[:, None] * np.array(best)
        yield [(f,) for f in best], np.stack([np.cos(phase), np.sin(phase)], axis=2), 1.0


def with_p_values(looks: list[Look], least: float = 0.0) -> list[Look]:
    """The looks with their p-values, corrected for the number of families, the best score first.

    ``least``: size below which an effect is not worth naming, in the unit of `Look.whole`; not used for nameless
    functions. The null hypothesis is then an effect of at most this size, not of size zero. A model's own records
    contain only what the model describes, so with enough samples anything becomes significant, even a hundredth of a
    percent of the drive. The gain of an effect of size s grows with its square; the part beyond the largest effect of
    the hypothesis is g (1 - least / s)^2.

    References
    ----------
    Hodges and Lehmann 1954, Testing the approximate validity of statistical hypotheses, JRSS B 16(2), 261-268.
    """
    return sorted((replace(k, p_value=chance(k, k.null, len(looks), least)) for k in looks), key=lambda k: -k.score)


def chance(look: Look, null: Array, families: int, least: float) -> float:
    """The p-value of a look among so many families from these null gains; see `with_p_values`."""
    asked = least if look.name else 0.0  # nameless functions show whether anything at all follows the motion
    beyond = max(0.0, 1.0 - asked / look.whole) ** 2 if asked > 0.0 and look.size > 0.0 else 1.0
    return p_value(look.gain * beyond, null, families, look.degrees) if beyond > 0.0 else 1.0
