"""Which constant refuses to be constant, and as a function of what.

The base model is identified along the record by recursive least squares with forgetting (`RLSRegressor`), as
Young's state-dependent parameters are looked for (Young 2011, Recursive Estimation and Time-Series Analysis,
ch. 11): where something is missing, the nearest constant moves with the signal that the missing effect depends on.
It tells where to look and names nothing.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from whsklearn.gap.inverse import column
from whsklearn.gap.locate import dependence

Array = NDArray[Any]
MEMORY = 1.0  # s
TELLING = 0.1  # share of the gap that a constant must take up to be spoken of
LEVEL = 0.02  # of the p-value
SETTLED = 3.0  # memories before the path counts


def paths(bench: Any, model: Any) -> tuple[dict[str, tuple[float, Array, float]], Array]:
    """(name -> (constant, its change along the record of shape (n,), share of the gap that this takes up), samples).

    One constant at a time is let go, on the missing torque and the motion that the observer tracked: viscous and dry
    friction together cannot be told apart within a second, and smoothed derivatives would bias them.
    """
    from whsklearn.estimators.rls import RLSRegressor

    scene, lens = bench.scene, bench.lens
    _, angle, speed = bench.follow(model)
    time = np.arange(speed.size) * scene.dt
    gap = bench.missing(model)
    base = model.terms[: model.n_base]
    columns = {"inertia": np.gradient(speed, scene.dt)}
    for b in base:
        columns[b.kind.name] = column(b.kind, angle, speed, bench.record.drive, time, b.q[b.kind.linear :])[:, 0]
    known = [model.inertia, *(b.q[0] for b in base)]
    at = np.flatnonzero(bench.usable)
    at = at[int(SETTLED * MEMORY / (scene.dt * lens.every)) :]
    out = {}
    for (name, signal), value in zip(columns.items(), known, strict=True):
        x = lens.blur(signal)
        scale = float(np.sqrt(np.mean(x**2))) + 1e-300
        rows = np.ascontiguousarray((x / scale)[:, None])
        # a prior worth one sample of the usual size keeps the constant where the axis shows nothing of it
        recursion = RLSRegressor(forgetting=float(np.exp(-scene.dt * lens.every / MEMORY)), P0=1.0)
        change = np.empty(gap.size)
        for i in range(gap.size):
            change[i] = recursion.partial_fit(rows[i : i + 1], gap[i : i + 1]).theta_[0]
        left = gap[at] - (change * rows[:, 0])[at]
        taken = 1.0 - float(left @ left) / max(float(gap[at] @ gap[at]), 1e-300)
        out[name] = (float(value), change[at] / scale, taken)
    return out, at


def restless(bench: Any, model: Any, axes: dict[str, tuple[Array, str]], rng: np.random.Generator) -> list[dict]:
    """For every constant: its mean, how far it moves, and the signal that it follows most; the most restless first.

    Parameters
    ----------
    bench, model
        The record's bench and the base model.
    axes : dict
        Name -> (signal at the lens's samples, unit).
    rng : Generator
        Of the shifts.
    """
    constants, at = paths(bench, model)
    seconds = at.size * bench.lens.every * bench.scene.dt
    n_blocks = int(np.clip(seconds / (2 * MEMORY), 5, 30))
    out = []
    for name, (value, change, taken) in constants.items():
        row: dict[str, Any] = {
            "name": name, "mean": value, "spread": float(np.std(change)) / max(abs(value), 1e-300), "taken": taken,
            "follows": "", "share": 0.0, "p_value": 1.0,
        }  # fmt: skip
        for signal, (x, _) in axes.items():
            share, p = dependence(x[at], change, rng, along_time=signal == "time", n_blocks=n_blocks)
            if p < LEVEL and share > row["share"]:
                row |= {"follows": signal, "share": share, "p_value": p}
        out.append(row)
    return sorted(out, key=lambda r: -r["taken"])


def sentence(rows: list[dict]) -> str:
    """The most restless constant in words; empty if none follows a signal."""
    telling = [r for r in rows[:1] if r["follows"] and r["share"] > 0.1 and r["taken"] > TELLING]
    if not telling:
        return ""
    r = telling[0]
    name = r["name"].replace("_", " ")
    return (
        f"Identified with a memory of {MEMORY:.0f} s, the constant that refuses to be constant is {name}: it moves by "
        f"{100 * r['spread']:.1f} % of itself, {100 * r['share']:.0f} % of that with {r['follows']}."
    )
