"""Parameter drift: which constant of the base model moves along the record, and with which signal.

The base model is identified along the record by recursive least squares with forgetting (`RLSRegressor`), as
Young's state-dependent parameters are looked for (Young 2011, Recursive Estimation and Time-Series Analysis,
ch. 11): where something is missing, the nearest constant moves with the signal that the missing effect depends on.
It tells where to look and names nothing.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from whsklearn.gap import evidence as rules
from whsklearn.gap.localisation import dependence
from whsklearn.gap.plant import Gap
from whsklearn.gap.record import rms

Array = NDArray[Any]
TIME_CONSTANT = 1.0  # s, of forgetting
SETTLED = 3.0  # time constants before the path counts


def paths(g: Gap) -> tuple[dict[str, tuple[float, Array, float]], slice, float]:
    """(name -> (constant, its change along the record, share of the gap that this takes up), samples, seconds each).

    One constant at a time is let go, on the missing torque and the motion that the observer tracked: viscous and dry
    friction together cannot be separated within a second, and smoothed derivatives would bias them.
    """
    from whsklearn.estimators.rls import RLSRegressor

    columns, gap, step = g.columns, g.left, g.step
    at = slice(min(int(SETTLED * TIME_CONSTANT / step), gap.size // 2), None)
    out = {}
    for name, (value, x) in columns.items():
        scale = rms(x) + 1e-300
        rows = np.ascontiguousarray((x / scale)[:, None])
        # a prior worth one sample of the usual size keeps the constant where the axis shows nothing of it
        recursion = RLSRegressor(forgetting=float(np.exp(-step / TIME_CONSTANT)), P0=1.0)
        change = np.empty(gap.size)
        for i in range(gap.size):
            change[i] = recursion.partial_fit(rows[i : i + 1], gap[i : i + 1]).theta_[0]
        left = gap[at] - (change * rows[:, 0])[at]
        taken = 1.0 - float(left @ left) / max(float(gap[at] @ gap[at]), 1e-300)
        out[name] = (value, change[at] / scale, taken)
    return out, at, step


def drift(g: Gap, rng: np.random.Generator) -> list[dict]:
    """For every constant: its mean, how far it moves, and the signal that it follows most; the most drifting first."""
    constants, at, step = paths(g)
    if not constants:
        return []
    signals = g.signals
    n = next(iter(constants.values()))[1].size
    n_blocks = int(np.clip(n * step / (2 * TIME_CONSTANT), 5, 30))
    out = []
    for name, (value, change, taken) in constants.items():
        row: dict[str, Any] = {
            "name": name, "mean": value, "spread": float(np.std(change)) / max(abs(value), 1e-300), "taken": taken,
            "follows": "", "share": 0.0, "p_value": 1.0,
        }  # fmt: skip
        for signal, (x, _) in signals.items():
            share, p = dependence(x[at], change, rng, along_time=signal == "time", n_blocks=n_blocks)
            if p < rules.DRIFT_LEVEL and share > row["share"]:
                row |= {"follows": signal, "share": share, "p_value": p}
        out.append(row)
    return sorted(out, key=lambda r: -r["taken"])


def sentence(rows: list[dict]) -> str:
    """The parameter that drifts most, in words; empty if none follows a signal."""
    telling = [
        r for r in rows[:1] if r["follows"] and r["share"] > rules.DRIFT_SHARE and r["taken"] > rules.DRIFT_SHARE
    ]
    if not telling:
        return ""
    r = telling[0]
    name = r["name"].replace("_", " ")
    return (
        f"Identified with a memory of {TIME_CONSTANT:.0f} s, {name} drifts: it moves by "
        f"{100 * r['spread']:.1f} % of itself, {100 * r['share']:.0f} % of that with {r['follows']}."
    )
