"""The record itself: whether it can be used, the grid of its readings, and the pictures of the page."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from whsklearn.gap.data_check import DataProblem, flat_share
from whsklearn.gap.localisation import spectra
from whsklearn.gap.plants.chain_model import (
    AR_ORDER,
    SKIP,
    ChainModel,
    Record,
    clip_at,
    clipped,
    left,
    simulate,
    variance_of,
)
from whsklearn.gap.record import lattice, rms
from whsklearn.validation.residuals import whiteness_test

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

# --- what a record must have (`tests/gap/plants/test_chain_record.py`) -----------------------------

FEWEST = 400  # samples: about twenty numbers are fitted to 60 % of them
STANDING = 0.98  # share of samples that may repeat the one before; a signal that repeats more often is constant
# Share of samples at an extreme above which the output is clipped, and the number of distinct values below which it is
# a signal with a few levels and not a clipped one.
CLIPPED, LEVELS = 0.02, 50
FAR = 40.0  # multiple of the 0.99 quantile of the distance from the median; samples beyond are outliers of the file
COARSE_READING = 0.003  # rms of rounding errors as a share of the output's: a finer grid is that of a normal converter
ROUNDING = 0.15  # share of the errors' mean square that rounding must make up to be mentioned

LAGS = 20  # of the whiteness test
WINDOW = 200  # samples of the overlay


def check_chain(u: Array, y: Array) -> list[DataProblem]:
    """Problems of a record; all of them are fatal.

    Examples
    --------
    >>> import numpy as np
    >>> [p.code for p in check_chain(np.ones(1000), np.random.default_rng(0).normal(size=1000))]
    ['data-no-drive']
    """
    bad = [name for name, x in (("input", u), ("output", y)) if not np.all(np.isfinite(x))]
    if bad:
        text = f"The {' and the '.join(bad)} holds values that are missing or not finite; repair or remove them."
        return [DataProblem("data-not-finite", "Missing values", text)]
    if u.size < FEWEST:
        text = f"{u.size} samples; at least {FEWEST} are needed to distinguish an effect from noise. Log longer."
        return [DataProblem("data-too-short", "Record too short", text)]
    if np.ptp(u) == 0 or np.mean(np.diff(u) == 0) > STANDING:
        text = "The input is constant or changes in fewer than 2 % of the samples; pick the input that was applied."
        return [DataProblem("data-no-drive", "The input does not change", text)]
    if np.ptp(y) == 0 or np.mean(np.diff(y) == 0) > STANDING:
        text = "The output is constant or changes in fewer than 2 % of the samples; pick the measured output."
        return [DataProblem("data-not-moving", "The output does not change", text)]
    out = []
    share = flat_share(y)
    if share > CLIPPED and np.unique(y).size > LEVELS:
        text = (
            f"The output is at its extreme for {100 * share:.0f} % of the record. Either the log clips it, or the "
            "plant stops there, like a tank that overflows. A chain of this kind does not: pass the part before it."
        )
        out.append(DataProblem("data-clipped-position", "The output stops at its extreme", text))
    jumps = np.abs(y - np.median(y))
    spikes = int(np.sum(jumps > FAR * (np.quantile(jumps, 0.99) + 1e-300)))
    if spikes:
        text = f"{spikes} samples of the output are far away from all others; repair the outliers."
        out.append(DataProblem("data-spikes", "Outliers in the output", text))
    return out


def coarse_grid(s: Record, m: ChainModel) -> float:
    """Step of the grid of the readings if rounding is a considerable part of the residual, otherwise 0."""
    step = lattice(s.y[s.seen])
    if not step or step / math.sqrt(12.0) < COARSE_READING * rms(s.y[s.seen]):
        return 0.0
    gain = 1.0 + float(m.ar @ m.ar)  # of A(q) on white rounding errors
    return step if gain * step**2 / 12.0 > ROUNDING * variance_of(left(s, m)[s.fit]) else 0.0


def axes(s: Record, m: ChainModel, units: tuple[str, str]) -> dict[str, tuple[Array, str]]:
    """The signals that the gap may follow, delayed by one sample like the output of L2."""
    x, _, y_hat = simulate(s, m)
    dx = np.diff(x, prepend=x[:1])
    out: dict[str, tuple[Any, str]] = {"time": (np.arange(s.u.size) * s.dt, "s" if s.dt != 1.0 else "samples")}
    late = {"input": (s.u, units[0]), "x": (x, ""), "dx": (dx, "")}
    out |= {k: (np.concatenate([v[:1], v[:-1]]), unit) for k, (v, unit) in late.items()}
    return out | {"output": (y_hat, units[1])}


def residual_tests(s: Record, base: ChainModel, model: ChainModel) -> list[dict[str, Any]]:
    """Ljung-Box test of the whitened errors with outliers clipped, before and after."""
    out = []
    for word, m in (("before", base), ("after", model)):
        w = whiteness_test(clipped(left(s, m)[s.fit]), LAGS, AR_ORDER)
        out.append({"test": f"Ljung-Box, {LAGS} lags, outliers clipped, {word}", "statistic": w.statistic,
                    "p_value": w.p_value, "largest": float(np.abs(w.r).max()), "band": w.band})  # fmt: skip
    return out


def pictures(s: Record, base: ChainModel, model: ChainModel, unit: float) -> dict[str, Any]:
    """Measured output, the gap over time, and its spectra by frequency and by order of x."""
    time = np.arange(s.u.size) * s.dt
    x = simulate(s, base)[0]
    drawn = s.fit | (np.arange(s.u.size) < SKIP)  # the spectra skip the first ones themselves
    errors = (left(s, m) * drawn for m in (base, model))
    before, after = (unit * np.clip(e, -clip_at(e[drawn]), clip_at(e[drawn])) for e in errors)
    return {
        "gap_time": time, "usable": s.fit, "units": ("", ""), "what": "whitened error",
        "output": "output", "window": WINDOW, "clock": "s" if s.dt != 1.0 else "samples",
        **spectra(before, after, s.dt, x, np.linspace(0.3, 12.0, 160) / max(rms(x), 1e-12), SKIP),
    }  # fmt: skip
