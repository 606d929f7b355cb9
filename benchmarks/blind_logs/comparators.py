"""What common practice names on the same logs: regression on measured states with BIC, FROLS, and SINDy.

All regress the drive on smoothed measured motion with a library of the torque effects; the naive one
adds the term with the best BIC, FROLS the one with the largest error reduction ratio (Billings 2013,
Nonlinear System Identification, ch. 3) above 0.1 %, and SINDy the largest coefficient that PySINDy's sequentially
thresholded least squares keeps on the residual (Brunton, Proctor, Kutz 2016, PNAS 113(15)), with its default threshold
and columns and residual scaled to unit rms.
"""

from __future__ import annotations

import numpy as np
import pandas as pd


def _library(frame: pd.DataFrame) -> tuple[np.ndarray, np.ndarray, dict[str, np.ndarray]]:
    from scipy.signal import butter, filtfilt

    t, u, y = (frame[c].to_numpy() for c in ("time_s", "torque_nm", "position_rad"))
    dt = t[1] - t[0]
    b, a = butter(4, min(0.9, 2 * 25 * dt))
    q = filtfilt(b, a, y)
    v = np.gradient(q, dt)
    acc = np.gradient(v, dt)
    us = filtfilt(b, a, u)
    cut = slice(int(0.5 / dt), -int(0.5 / dt), max(1, int(0.01 / dt)))
    s = np.sign(v)
    base = np.column_stack([acc, v, s])[cut]
    pool = {
        "input_offset": [np.ones_like(v)], "asymmetric_viscous": [np.abs(v)], "quadratic_drag": [v * np.abs(v)],
        "stribeck": [s * np.exp(-np.abs(v) / 0.3)], "load_friction": [np.abs(us) * s], "cable_spring": [q],
        "hardening_spring": [q**3], "gravity_imbalance": [np.sin(q), np.cos(q)], "friction_drift": [s * t],
        "input_delay": [np.gradient(us, dt)], "dead_zone": [np.clip(us, -0.1, 0.1)],
        "saturation": [us - np.clip(us, -0.6 * np.abs(us).max(), 0.6 * np.abs(us).max())],
    }  # fmt: skip
    for k in range(2, 31):
        pool[f"cogging {k}"] = [np.sin(k * q), np.cos(k * q)]
        pool[f"torque_ripple {k}"] = [us * np.sin(k * q), us * np.cos(k * q)]
    for k in range(1, 9):
        pool[f"position_friction {k}"] = [s * np.sin(k * q), s * np.cos(k * q)]
    return us[cut], base, {k: np.column_stack(v)[cut] for k, v in pool.items()}


def _drops(target: np.ndarray, base: np.ndarray, pool: dict[str, np.ndarray]) -> tuple[dict[str, float], float]:
    q, _ = np.linalg.qr(base)
    r = target - q @ (q.T @ target)
    drops = {}
    for name, x in pool.items():
        z, _ = np.linalg.qr(x - q @ (q.T @ x))
        drops[name] = float(np.sum((z.T @ r) ** 2))
    return drops, float(r @ r)


def naive(frame: pd.DataFrame) -> str:
    """The name that BIC prefers, empty if it prefers none."""
    target, base, pool = _library(frame)
    drops, total = _drops(target, base, pool)
    n = target.size
    score = {
        k: n * np.log(total / max(total - d, 1e-12 * total)) - pool[k].shape[1] * np.log(n) for k, d in drops.items()
    }
    best = max(score, key=score.__getitem__)
    return best.split()[0] if score[best] > 10 else ""


def frols(frame: pd.DataFrame) -> str:
    """The name with the largest error reduction ratio, empty if none reaches 0.1 % of the drive's power."""
    target, base, pool = _library(frame)
    drops, _ = _drops(target, base, pool)
    best = max(drops, key=drops.__getitem__)
    return best.split()[0] if drops[best] > 1e-3 * float(target @ target) else ""


def sindy(frame: pd.DataFrame) -> str:
    """The name of the largest coefficient that thresholding keeps, empty if none survives; needs ``pysindy``."""
    from pysindy.optimizers import STLSQ

    target, base, pool = _library(frame)
    q, _ = np.linalg.qr(base)
    residual = target - q @ (q.T @ target)
    names = [name for name, x in pool.items() for _ in range(x.shape[1])]
    columns = np.column_stack(list(pool.values()))
    columns = columns - q @ (q.T @ columns)
    scale = np.sqrt(np.mean(columns**2, axis=0)) + 1e-300
    optimizer = STLSQ(threshold=0.1, alpha=1e-6)
    optimizer.fit(columns / scale, residual[:, None] / np.sqrt(np.mean(residual**2)))
    kept = np.abs(np.asarray(optimizer.coef_).ravel())
    return names[int(np.argmax(kept))].split()[0] if kept.max() > 0 else ""
