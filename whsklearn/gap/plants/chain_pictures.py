"""Series of a chain's diagnosis that the page draws, and its tests of residuals."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from whsklearn.gap.localisation import spectra
from whsklearn.gap.plants.chain_model import AR_ORDER, SKIP, ChainModel, Setting, chain, free_run
from whsklearn.gap.plants.chain_objections import beside_turned
from whsklearn.gap.plants.chain_remainder import whiteness

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from whsklearn.gap.plants.chain_view import ChainView

    Array = NDArray[np.float64]

LAGS = 20  # of the test of whiteness
WINDOW = 200  # samples of the overlay


def axes(s: Setting, m: ChainModel) -> dict[str, tuple[Array, str]]:
    """The signals that the gap may follow, one sample late as L2 is."""
    x, _, y_hat = chain(s, m, free=True)
    dx = np.diff(x, prepend=x[:1])
    out: dict[str, tuple[Any, str]] = {"time": (np.arange(s.u.size) * s.dt, "s" if s.dt != 1.0 else "samples")}
    out |= {k: (np.concatenate([v[:1], v[:-1]]), "") for k, v in {"input": s.u, "x": x, "dx": dx}.items()}
    return out | {"output": (y_hat, "")}


def residual_tests(view: ChainView, base: ChainModel, model: ChainModel) -> list[dict[str, Any]]:
    """Ljung-Box of the one-step errors without outliers, and generic functions at every port, before and after."""
    out = []
    for word, m in (("before", base), ("after", model)):
        w = whiteness(view.gap(m)[view.setting.fit], LAGS, AR_ORDER)
        left = view.left(m)
        out.append({"test": f"Ljung-Box, {LAGS} lags, outliers left out, {word}", "statistic": w.statistic,
                    "p_value": w.p_value, "largest": float(np.abs(w.r).max()), "band": w.band})  # fmt: skip
        out.append({"test": f"generic functions at every port, {word}", "statistic": left.share,
                    "p_value": left.p_value, "largest": left.share, "band": 0.0})  # fmt: skip
    return out


def pictures(view: ChainView, base: ChainModel, model: ChainModel) -> dict[str, Any]:
    """Overlay, gap over time, its spectra by frequency and by order of x, and its axes."""
    s = view.setting
    time = np.arange(s.u.size) * s.dt
    orders = np.linspace(0.3, 12.0, 160) / view.scales.x
    return {
        "time": time, "measured": s.y, "runs": {"before": free_run(s, base), "after": free_run(s, model)},
        "held": s.held >= 0, "beside_turned": beside_turned(s, base, model),
        "gap_time": time, "usable": np.arange(s.u.size) >= SKIP, "floor": view.floor(model),
        "axes": axes(s, base), "units": ("", ""), "what": "one-step prediction error",
        "output": "output", "window": WINDOW, "clock": "s" if s.dt != 1.0 else "samples",
        **spectra(view.gap(base), view.gap(model), s.dt, chain(s, base)[0], orders, SKIP),
    }  # fmt: skip
