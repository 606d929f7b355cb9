"""Series of a chain's diagnosis that the page draws, and its tests of residuals."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from whsklearn.gap.localisation import spectra
from whsklearn.gap.plants.chain_model import AR_ORDER, SKIP, ChainModel, Record, clipped, left, simulate
from whsklearn.gap.record import rms
from whsklearn.validation.residuals import whiteness_test

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

LAGS = 20  # of the test of whiteness
WINDOW = 200  # samples of the overlay


def axes(s: Record, m: ChainModel, units: tuple[str, str]) -> dict[str, tuple[Array, str]]:
    """The signals that the gap may follow, one sample late as L2 is."""
    x, _, y_hat = simulate(s, m)
    dx = np.diff(x, prepend=x[:1])
    out: dict[str, tuple[Any, str]] = {"time": (np.arange(s.u.size) * s.dt, "s" if s.dt != 1.0 else "samples")}
    late = {"input": (s.u, units[0]), "x": (x, ""), "dx": (dx, "")}
    out |= {k: (np.concatenate([v[:1], v[:-1]]), unit) for k, (v, unit) in late.items()}
    return out | {"output": (y_hat, units[1])}


def residual_tests(s: Record, base: ChainModel, model: ChainModel) -> list[dict[str, Any]]:
    """Ljung-Box of the whitened errors, outliers held, before and after."""
    out = []
    for word, m in (("before", base), ("after", model)):
        w = whiteness_test(clipped(left(s, m)[s.fit]), LAGS, AR_ORDER)
        out.append({"test": f"Ljung-Box, {LAGS} lags, outliers held, {word}", "statistic": w.statistic,
                    "p_value": w.p_value, "largest": float(np.abs(w.r).max()), "band": w.band})  # fmt: skip
    return out


def pictures(s: Record, base: ChainModel, model: ChainModel, unit: float) -> dict[str, Any]:
    """Measured output, the gap over time, its spectra by frequency and by order of x."""
    time = np.arange(s.u.size) * s.dt
    x = simulate(s, base)[0]
    before, after = (unit * clipped(left(s, m)) for m in (base, model))
    return {
        "gap_time": time, "usable": np.arange(s.u.size) >= SKIP, "units": ("", ""), "what": "whitened error",
        "output": "output", "window": WINDOW, "clock": "s" if s.dt != 1.0 else "samples",
        **spectra(before, after, s.dt, x, np.linspace(0.3, 12.0, 160) / max(rms(x), 1e-12), SKIP),
    }  # fmt: skip
