"""A record as a comparison sees it: a regression with named numbers, and the slow drift that may accompany them.

torque = X theta + nuisances + rest, sample by sample behind one filter.  An axis and a joint of an arm come to this
form (`whsklearn.compare.axis`, `whsklearn.compare.arm`); the rest of the code does not distinguish them.
"""

from __future__ import annotations

from collections.abc import Set
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.fft import dct

Array = NDArray[Any]

MOST_BLOCKS, FEWEST_BLOCKS = 10, 5
# Half waves of drift over a record: an offset follows up to four, Coulomb friction two, viscous friction one.
HALF_WAVES = {"input_offset": 4, "coulomb": 2, "viscous": 1}
SLOWER = 2.0  # times, than the motion: what drifts is slower, or the motion itself would be called a drift
SLOW_SHARE = 0.05  # of the path's variance lies below its slowest frequency
ALIKE = 0.06  # of the path's deviation: below it two records took the same path, and share the model's errors
OVERLAP = 0.8  # of the shorter record that must lie on the same path


@dataclass(frozen=True)
class Regression:
    """One record as a linear regression.

    >>> t = np.arange(0.0, 20.0, 0.01)
    >>> rows = Regression(
    ...     "a.csv", ("viscous",), ("Nm s/rad",), np.cos(t)[:, None], 0.2 * np.cos(t), np.arange(t.size), 0.01, t,
    ...     np.sin(t), blocks_between(np.array([]), t.size), np.zeros((t.size, 0)), (), np.array([0.14]), 0.16, {},
    ... )
    >>> rows.sizes.round(1), rows.drives  # rms of the column, and of the drive in which its number appears
    (array([0.7]), array([0.14]))
    """

    label: str  # name of the record
    names: tuple[str, ...]  # names, units: names and units of the p numbers; several numbers may share a name
    units: tuple[str, ...]
    columns: Array  # (n, p): drive per unit of each number
    target: Array  # (n,): the logged drive
    at: NDArray[np.intp]  # (n,): indices of these samples on an even grid
    step: float  # step of that grid (s)
    time: Array  # time, path (n,): time since the record's start (s) and position
    path: Array
    block: NDArray[np.intp]  # (n,): parts of the record between reversals, numbered from zero
    nuisances: Array  # (n, m): slow changes of some numbers along the record
    of: tuple[int, ...]  # the number that each nuisance belongs to
    # (n_joints,): root of the mean over all samples of each joint's drive squared; of an axis its rms drive
    scale: Array
    slowest: float  # frequency (Hz) below which there is practically no motion
    # name -> names of numbers that change with it: a spring changes the offset too, by its rest position
    covers: dict[str, tuple[str, ...]]
    positive: frozenset[str] = frozenset()  # names of numbers that must be positive by physics
    to_si: tuple[float, ...] = ()  # factor from each unit to SI; empty if all are SI
    # (n,): the joint that each sample belongs to, one joint after the other; an axis has one
    channel: NDArray[np.intp] | None = None
    # name -> directions (p, k) in which a change moves the numbers; if empty, every named number may change
    changes: dict[str, Array] = field(default_factory=dict)
    # variance of a sample's step of an offset that walks, over that of the noise; empty if it stays
    walk: tuple[float, ...] = ()
    # what tells numbers of one name apart, such as ``cos 12 q`` of a wave; empty if nothing needs to
    parts: tuple[str, ...] = ()
    own: tuple[str, ...] = ()  # effects among the nuisances: each record has its own numbers of them

    def without(self, names: Set[str]) -> Regression:
        """The same rows with the numbers of these effects among the nuisances: fitted, and not compared.

        >>> x = np.ones((4, 2))
        >>> rows = Regression(
        ...     "a.csv", ("viscous", "cogging"), ("Nm s/rad", "Nm"), x, x[:, 0], np.arange(4), 0.01, x[:, 0], x[:, 0],
        ...     np.zeros(4, dtype=int), np.zeros((4, 0)), (), np.array([1.0]), 0.16, {}, parts=("", "cos 6 q"),
        ... ).without({"cogging"})
        >>> rows.names, rows.nuisances.shape, rows.own
        (('viscous',), (4, 1), ('cogging',))
        """
        kept = [i for i, n in enumerate(self.names) if n not in names]
        others = [i for i, n in enumerate(self.names) if n in names]

        def of_kept(values: tuple[Any, ...]) -> tuple[Any, ...]:
            return tuple(values[i] for i in kept) if values else values

        return replace(
            self, names=of_kept(self.names), units=of_kept(self.units), columns=self.columns[:, kept],
            nuisances=np.column_stack([self.nuisances, self.columns[:, others]]),
            of=tuple(kept.index(i) for i in self.of), to_si=of_kept(self.to_si), parts=of_kept(self.parts),
            own=tuple(dict.fromkeys(self.names[i] for i in others)),
        )  # fmt: skip

    def channels(self) -> list[NDArray[np.intp]]:
        """Samples of every joint."""
        if self.channel is None:
            return [np.arange(self.target.size)]
        return [np.flatnonzero(self.channel == j) for j in np.unique(self.channel)]

    def paid(self) -> Array:
        """Power of every number's column at each joint, as a share of that where it is most, shape (n_joints, p)."""
        power = np.array([np.sum(self.columns[those] ** 2, axis=0) for those in self.channels()])
        return np.asarray(power / np.maximum(power.max(axis=0), 1e-300))

    @property
    def drives(self) -> Array:
        """Rms of the drives in which each number appears, shape (p,)."""
        return np.asarray(np.maximum(np.sqrt(self.scale**2 @ self.paid()), 1e-300))

    @property
    def sizes(self) -> Array:
        """Rms of every column, shape (p,)."""
        return np.maximum(np.sqrt(np.mean(self.columns**2, axis=0)), 1e-300)


def blocks_between(reversals: NDArray[np.intp], n: int) -> NDArray[np.intp]:
    """5 to 10 blocks of about equal length that end at reversals; equal blocks if reversals are too rare.

    ``reversals``: samples before which the speed changes sign. ``n``: total number of samples.
    """
    count = int(np.clip(reversals.size + 1, FEWEST_BLOCKS, MOST_BLOCKS))
    edges = np.arange(1, count) * n / count
    if reversals.size >= FEWEST_BLOCKS:
        turns = np.unique(reversals[np.argmin(np.abs(reversals[:, None] - edges), axis=0)])
        edges = turns if turns.size >= FEWEST_BLOCKS - 1 else edges
    return np.searchsorted(edges, np.arange(n), side="right").astype(np.intp)


def reversals_of(speed: Array, slowest: float) -> NDArray[np.intp]:
    """Samples before which an axis that is faster than ``slowest`` has turned, shape (number of turns,)."""
    fast = np.flatnonzero(np.abs(speed) > slowest)
    return fast[1:][np.diff(np.sign(speed[fast])) != 0.0]


def slowest_of(path: Array, time: Array) -> float:
    """Frequency (Hz) below which a twentieth of the path's variance lies, in cosine half waves over the record.

    >>> t = np.arange(0.0, 30.0, 0.01)
    >>> [round(slowest_of(np.cos(2 * np.pi * f * t), t), 3) for f in (0.5, 1 / 60)]  # one way once is half a cycle
    [0.5, 0.017]
    """
    power = dct(path - np.mean(path)) ** 2  # in half waves: a path that goes one way once is half a cycle
    line = int(np.searchsorted(np.cumsum(power), SLOW_SHARE * power.sum()))
    return 0.5 * line / max(float(time[-1] - time[0]), 1e-300)


def drifting(columns: Array, names: tuple[str, ...], time: Array, slowest: float) -> tuple[Array, tuple[int, ...]]:
    """Slow changes of offset and friction: the column times cosine half waves over the record.

    ``columns`` is (n, p). ``time`` is (n,). ``slowest``: frequency (Hz) of the slowest motion. Returns ``nuisances``
    (n, m). Returns ``of``: the number that each belongs to.
    """
    span = max(float(np.ptp(time)), 1e-300)
    phase = np.pi * (time - time.min()) / span
    parts, of = [], []
    for name, most in HALF_WAVES.items():
        for i in (k for k, other in enumerate(names) if other.partition(" at ")[0] == name):
            for j in range(1, min(most, int(2.0 * span * slowest / SLOWER)) + 1):
                parts.append(columns[:, i] * np.cos(j * phase))
                of.append(i)
    return (np.column_stack(parts) if parts else np.zeros((time.size, 0))), tuple(of)


def difference(a: Regression, b: Regression, values: Array) -> Regression | None:
    """The second record's drive minus the first's, if both follow the same path; None if they do not.

    What no model explains is the same in both records and cancels.

    ``a``, ``b``: with the same columns. ``values`` (p,): numbers about which both records are linearised.
    """
    pairs = list(zip(a.channels(), b.channels(), strict=True))
    shift = _shift(a, b, pairs)
    if shift is None:
        return None
    columns, target, inside = np.array(a.columns), np.array(a.target), np.zeros(a.target.size, dtype=bool)
    for i, j in pairs:
        now, then = a.time[i] + shift, b.time[j]
        near = np.abs(now - then[np.clip(np.searchsorted(then, now), 0, then.size - 1)]) < 2.0 * b.step
        inside[i] = near & (now >= then[0]) & (now <= then[-1])
        x = np.column_stack([np.interp(now, then, c) for c in b.columns[j].T])
        columns[i] = 0.5 * (a.columns[i] + x)
        left = np.interp(now, then, b.target[j] - b.columns[j] @ values)
        target[i] = left - (a.target[i] - a.columns[i] @ values)
    return replace(
        a, columns=columns[inside], target=target[inside], at=a.at[inside], time=a.time[inside], path=a.path[inside],
        block=a.block[inside], nuisances=a.nuisances[inside],
        channel=None if a.channel is None else a.channel[inside],
    )  # fmt: skip


def _shift(a: Regression, b: Regression, pairs: list[tuple[Array, Array]]) -> float | None:
    """Delay of the second record along the same path of all joints (s); None if any path differs."""
    step, n_a, n_b = max(a.step, b.step), float(a.time.max()), float(b.time.max())
    grids = [np.arange(0.0, n, step) for n in (n_a, n_b)]
    paths = [
        [np.interp(t, r.time[k], r.path[k]) for t, r, k in zip(grids, (a, b), both, strict=True)] for both in pairs
    ]
    scales = [float(np.std(p)) for p, _ in paths]
    if min(scales) <= 0.0:
        return None
    if any(abs(float(np.std(q)) / s - 1.0) > 3.0 * ALIKE for (_, q), s in zip(paths, scales, strict=True)):
        return None
    n = grids[0].size + grids[1].size
    lag = sum(
        np.fft.irfft(np.conj(np.fft.rfft((p - p.mean()) / s, n)) * np.fft.rfft((q - q.mean()) / s, n), n)
        for (p, q), s in zip(paths, scales, strict=True)
    )
    k = int(np.argmax(lag))
    k -= n if k > n // 2 else 0
    i, j = max(0, -k), max(0, k)
    m = min(grids[0].size - i, grids[1].size - j)
    if m < OVERLAP * min(grids[0].size, grids[1].size):
        return None
    apart = [np.sqrt(np.mean((q[j : j + m] - p[i : i + m]) ** 2)) / s for (p, q), s in zip(paths, scales, strict=True)]
    return k * step if max(apart) < ALIKE else None
