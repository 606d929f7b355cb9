"""Where the gap lies: its share by time, position, velocity, reversal, drive and frequency.

The p-value is that of the between-bin share of power under circular shifts of the gap against the
axis, which keep the dependence within each (Politis and Romano 1992).  A shifted trend over time is
still a trend, so along time whole blocks are permuted instead.  The p-values are adjusted over the
axes by the method of Benjamini and Hochberg 1995.

Constants of the base model that drift are found by recursive least squares with forgetting, like
Young's state-dependent parameters (Young 2011, Recursive Estimation and Time-Series Analysis, ch. 11): where something
is missing, the most similar constant changes with the signal on which the missing effect depends.  All of this shows
where to look and names nothing.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import false_discovery_control

from whsklearn.effects.base import rms
from whsklearn.gap.calibration import N_BLOCKS
from whsklearn.gap.diagnosis import Place
from whsklearn.gap.plant import WORTH_A_WORD, Gap
from whsklearn.gap.record import Array

NOWHERE = "The gap follows none of the signals that were examined."
N_BINS = 20  # of equally many samples along each signal
N_SHIFTS = 199  # the smallest p-value is 1 / 200, or a twentieth after the adjustment over ten signals
LEVEL = 0.02  # of the p-value of a place or a drift, on which no name depends
TIME_CONSTANT = 1.0  # s, of forgetting
SETTLED = 3.0  # time constants before the estimates count


def locate(axes: dict[str, tuple[Array, str]], gap: Array, rng: np.random.Generator) -> list[Place]:
    """All axes that were examined, the most informative first.

    ``axes``: name -> (signal of shape (n,), unit). ``gap`` (n,): what is missing, at the same samples. ``rng``: draws
    the shifts.
    """
    found = [_one_axis(name, x, unit, gap, rng) for name, (x, unit) in axes.items() if np.ptp(x) > 0]
    adjusted = false_discovery_control([p.p_value for p in found]) if found else []
    places = [replace(p, p_value=float(a)) for p, a in zip(found, adjusted, strict=True)]
    return sorted(places, key=lambda p: (p.p_value, -p.share / max(p.width, 1e-9)))


class Bins:
    """A signal x of shape (n,) in bins of equally many samples.

    >>> angle = np.linspace(0.0, 6.28, 400)
    >>> bins = Bins(angle)
    >>> bins.between(np.sin(angle)) > 0.95, bins.between(np.cos(200.0 * angle)) < 0.1
    (True, True)
    """

    def __init__(self, x: Array):
        self.edges = np.unique(np.quantile(x, np.linspace(0, 1, N_BINS + 1)))
        n = max(self.edges.size - 1, 1)  # a constant has one bin
        self.at = np.clip(np.searchsorted(self.edges, x, side="right") - 1, 0, n - 1)
        self.count = np.bincount(self.at, minlength=n)

    def sums(self, values: Array) -> Array:
        """Sum of values of shape (n,) in every bin."""
        return np.asarray(np.bincount(self.at, values, self.count.size))

    def between(self, values: Array) -> float:
        """Share of the variance of values that lies between the bins."""
        centred = values - values.mean()
        return float(self._share(self.sums(centred)[:, None], centred)[0])

    def _share(self, sums: Array, centred: Array) -> Array:
        """The same from sums of shape (bins, m)."""
        power = np.sum(sums**2 / np.maximum(self.count, 1)[:, None], axis=0)
        return np.asarray(power / max(float(centred @ centred), 1e-300))

    @cached_property
    def _indicators(self) -> Array:
        """Fourier transforms of the indicators of the bins."""
        return np.fft.rfft(self.at == np.arange(self.count.size)[:, None], axis=1)

    def shifted(self, values: Array, shifts: NDArray[np.intp]) -> Array:
        """`between` of the values rolled by each shift, all at once: the sums are circular correlations.

        >>> x, y = np.random.default_rng(0).standard_normal((2, 300))
        >>> bins = Bins(x)
        >>> bool(np.allclose(bins.shifted(y, np.array([0, 7])), [bins.between(y), bins.between(np.roll(y, 7))]))
        True
        """
        centred = values - values.mean()
        every = np.fft.irfft(self._indicators * np.conj(np.fft.rfft(centred)), centred.size, axis=1)
        return self._share(every[:, shifts], centred)

    def chance(
        self, paths: tuple[Array, ...], rng: np.random.Generator, *, along_time: bool, n_blocks: int = N_BLOCKS
    ) -> tuple[float, float]:
        """(sum of the shares of paths between the bins, its p-value under rearrangements of short segments)."""
        observed, n = sum(map(self.between, paths)), paths[0].size
        if along_time:
            orders = _rearranged(n, n_blocks, rng)
            drawn = np.array([sum(self.between(p[o]) for p in paths) for o in orders])
        else:
            least = max(1, n // 50)
            shifts = rng.integers(least, n - least, N_SHIFTS)
            drawn = np.sum([self.shifted(p, shifts) for p in paths], axis=0)
        return observed, float(1 + np.sum(drawn >= observed)) / (1 + N_SHIFTS)


def _one_axis(name: str, x: Array, unit: str, gap: Array, rng: np.random.Generator) -> Place:
    bins, power = Bins(x), gap**2
    _, p = bins.chance((gap, power), rng, along_time=name == "time")
    edges, count, inside = bins.edges, np.maximum(bins.count, 1), bins.sums(power)
    mean = bins.sums(gap) / count
    first, last = _densest(inside, bins.count)
    return Place(
        name, float(edges[first]), float(edges[last + 1]), float(inside[first : last + 1].sum() / inside.sum()),
        float(bins.count[first : last + 1].sum() / x.size), float(p), unit, 0.5 * (edges[1:] + edges[:-1]), mean,
        np.sqrt(np.maximum(inside / count - mean**2, 0) / np.maximum(bins.count / 8, 1)),
    )  # fmt: skip


def _rearranged(n: int, n_blocks: int, rng: np.random.Generator) -> Iterator[NDArray[np.intp]]:
    """Permutations of the samples that keep short segments whole but not their neighbours."""
    for _ in range(N_SHIFTS):
        starts = rng.integers(0, max(1, n // n_blocks)) + np.arange(0, n, max(1, n // n_blocks))
        parts = np.split(np.arange(n), starts[starts < n])
        yield np.concatenate([parts[i] for i in rng.permutation(len(parts))])


def _densest(power: Array, count: Array) -> tuple[int, int]:
    """The consecutive bins with the largest share of power beyond their share of samples."""
    excess = power / power.sum() - count / count.sum()
    best, start, total, where = -1.0, 0, 0.0, (0, power.size - 1)
    for i, e in enumerate(excess):
        if total <= 0:
            start, total = i, 0.0
        total += e
        if total > best:
            best, where = total, (start, i)
    return where


def spectrum(gap: Array, rate: float) -> tuple[Array, Array]:
    """Frequencies in Hz and amplitudes of the gap."""
    from scipy.signal import periodogram

    f, p = periodogram(gap, rate, window="hann", scaling="spectrum")
    return f[1:], np.sqrt(2 * p[1:])


def order_spectrum(gap: Array, angle: Array, orders: Array) -> Array:
    """Amplitude of the gap at every order of the angle (periods per turn); two or more orders, evenly spaced."""
    out = np.empty(orders.size)
    wave, turn = np.exp(-1j * orders[0] * angle), np.exp(-1j * (orders[1] - orders[0]) * angle)
    for i in range(orders.size):
        out[i] = 2 * np.abs(gap @ wave) / gap.size
        wave *= turn  # from one order to the next: a thousand exponentials took a fifth of a second
    return out


def spectra(before: Array, after: Array, step: float, angle: Array, orders: Array, first: int = 0) -> dict[str, Any]:
    """Two gaps sampled every ``step`` seconds and their spectra by frequency and by order, as the page draws them.

    The spectra by frequency exclude the samples up to ``first``.
    """
    (f, a0), (_, a1) = (spectrum(gap[first:], 1.0 / step) for gap in (before, after))
    return {
        "gap_before": before, "gap_after": after, "frequency": f, "spectrum": (a0, a1), "orders": orders,
        "order_spectrum": tuple(order_spectrum(gap, angle, orders) for gap in (before, after)),
    }  # fmt: skip


def since_reversal(speed: Array, dt: float, quiet: float) -> Array:
    """Seconds since the velocity last changed its sign."""
    n = np.arange(speed.size)
    last = np.maximum.accumulate(np.where(np.abs(speed) > quiet, n, -1))  # sample at which a direction was seen
    sign = np.where(last < 0, 0.0, np.sign(speed[last]))
    reversal = np.maximum.accumulate(np.where(np.diff(sign, prepend=0.0) != 0.0, n, -1))
    return np.concatenate([[0.0], np.cumsum(np.full(n.size, dt))])[n - reversal]


def sentence(places: list[Place]) -> str:
    """Where the gap lies, in words."""
    telling = [p for p in places if p.p_value <= LEVEL]
    if not telling:
        return NOWHERE
    p = max(telling, key=lambda p: p.share - p.width)
    share, width = 100 * p.share, 100 * p.width
    if p.signal == "reversal":
        when = f"between {p.low:.2g} and {p.high:.2g} s after a reversal"
        return f"{share:.0f} % of the gap lies {when} ({width:.0f} % of the time)."
    if p.share - p.width < WORTH_A_WORD:
        return f"The gap follows {p.signal}, and is spread over its whole range."
    where = f"{p.signal} is between {p.low:.3g} and {p.high:.3g} {p.unit}"
    return f"{share:.0f} % of the gap lies where {where} ({width:.0f} % of the time)."


def paths(g: Gap) -> tuple[dict[str, tuple[float, Array, float]], slice, float]:
    """(name -> (constant, its change along the record, share of the gap that the change explains), samples, step in s).

    One constant at a time is freed, for the missing torque along the motion that the observer tracked.  Viscous and dry
    friction together cannot be separated within a second, and smoothed derivatives would bias them.
    """
    from scipy.signal import lfilter

    columns, gap, step = g.columns, g.left, g.step
    at = slice(min(int(SETTLED * TIME_CONSTANT / step), gap.size // 2), None)
    forgetting = float(np.exp(-step / TIME_CONSTANT))

    def remembered(z: Array, start: float) -> Array:
        return np.asarray(lfilter([1.0], [1.0, -forgetting], z, zi=[forgetting * start])[0])

    out = {}
    for name, (value, x) in columns.items():
        scale = rms(x) + 1e-300
        row = x / scale
        # least squares with one number and forgetting is a ratio of two sums; a prior worth one sample of the usual
        # size holds the constant while the axis does not excite it
        change = remembered(row * gap, 0.0) / remembered(row**2, 1.0)
        left = gap[at] - (change * row)[at]
        taken = 1.0 - float(left @ left) / max(float(gap[at] @ gap[at]), 1e-300)
        out[name] = (value, change[at] / scale, taken)
    return out, at, step


def drift(g: Gap, rng: np.random.Generator) -> list[dict]:
    """For every constant: its mean, its drift, and the signal that it follows most; the largest drift first."""
    constants, at, step = paths(g)
    if not constants:
        return []
    signals = g.signals
    n = next(iter(constants.values()))[1].size
    n_blocks = int(np.clip(n * step / (2 * TIME_CONSTANT), 5, N_BLOCKS))
    out = []
    for name, (value, change, taken) in constants.items():
        row: dict[str, Any] = {
            "name": name, "mean": value, "spread": float(np.std(change)) / max(abs(value), 1e-300), "taken": taken,
            "follows": "", "share": 0.0, "p_value": 1.0,
        }  # fmt: skip
        for signal, (x, _) in signals.items():
            bins = Bins(x[at])
            if bins.edges.size < 3:
                continue
            share, p = bins.chance((change,), rng, along_time=signal == "time", n_blocks=n_blocks)
            if p <= LEVEL and share > row["share"]:
                row |= {"follows": signal, "share": share, "p_value": p}
        out.append(row)
    return sorted(out, key=lambda r: -r["taken"])


def drift_sentence(rows: list[dict]) -> str:
    """The parameter that drifts most, in words; empty if none follows a signal."""
    telling = [r for r in rows[:1] if r["follows"] and r["share"] > WORTH_A_WORD and r["taken"] > WORTH_A_WORD]
    if not telling:
        return ""
    r = telling[0]
    name = r["name"].replace("_", " ")
    much = f"{100 * r['spread']:.1f} % of itself" if r["spread"] < 1 else "more than itself"  # a mean near zero
    return (
        f"Identified with a memory of {TIME_CONSTANT:.0f} s, {name} drifts: it changes by {much}, "
        f"{100 * r['share']:.0f} % of that with {r['follows']}."
    )
