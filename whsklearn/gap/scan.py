"""Where a candidate's first shape number is found by looking at all of them: order, frequency, time."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from whsklearn.gap import axis_kernel as k
from whsklearn.gap.bench import Bench
from whsklearn.gap.candidates import Candidate
from whsklearn.gap.inverse import column
from whsklearn.gap.lens import whiten

Array = NDArray[np.float64]


def scan_values(kind: Candidate, bench: Bench) -> Array:
    """The grid of a scan: steps of a quarter of the resolution that the record has."""
    s = bench.scene
    if kind.scanned == "time":
        return np.linspace(0.06, 0.94, 89) * s.seconds
    if kind.scanned == "frequency":
        highest = 2.0 * bench.lens.cutoff
        return np.arange(0.5 / s.seconds, highest, 0.35 / s.seconds)
    step = 0.25 * np.pi / s.reach
    fastest = 2 * np.pi * 2.0 * bench.lens.cutoff / max(s.speed, 1e-9)
    highest = float(np.clip(fastest, 3.0, 130.0))
    whole = np.arange(1.0, highest + 1)
    grid = np.arange(0.5, highest, max(step, highest / 700))
    return np.unique(np.concatenate([whole, grid]))


def scan(kind: Candidate, bench: Bench, residual: Array, base: Array, angle: Array, speed: Array) -> tuple[Array, Array]:
    """(values, drop of the sum of squares at each): linear, on the tracked motion.

    ``base`` are the sensitivities of the model in force on the training samples, which the columns
    are projected off.
    """
    values = scan_values(kind, bench)
    thin = max(1, bench.lens.every // 4)
    while bench.lens.every % thin:
        thin -= 1
    motion = [x[::thin] for x in (angle, speed, bench.record.drive)]
    time = (np.arange(len(bench.record)) * bench.scene.dt)[::thin]
    taps = bench.lens.smooth[bench.lens.half_width % thin :: thin]
    taps = taps / taps.sum()
    mask = bench.train & bench.usable
    q, _ = np.linalg.qr(base)
    r = residual - q @ (q.T @ residual)
    steps = change_columns(kind, bench, motion, time) if kind.scanned == "time" else None
    gains = np.zeros(values.size)
    for i, value in enumerate(values):
        if steps is None:
            x = column(kind, *motion, time, (float(value),))
        else:
            x = steps * (time >= value)[:, None]
        seen = _decimate(x, taps, bench.lens.every // thin, mask.size)
        z = whiten(seen, bench.ar)[mask]
        z = z - q @ (q.T @ z)
        c, *_ = np.linalg.lstsq(z.T @ z + 1e-9 * np.eye(z.shape[1]) * np.trace(z.T @ z), z.T @ r, rcond=None)
        gains[i] = float(r @ (z @ c))
    return values, gains


def change_columns(kind: Candidate, bench: Bench, motion: list[Array], time: Array) -> Array:
    """The signal whose weight steps."""
    angle, speed, drive = motion
    x = {
        k.CHANGE_INERTIA: np.gradient(speed, time),
        k.CHANGE_VISCOUS: speed,
        k.CHANGE_COULOMB: np.sign(speed),
        k.CHANGE_GAIN: drive,
    }[kind.code]
    return x[:, None]


def _decimate(x: Array, taps: Array, every: int, n: int) -> Array:
    from whsklearn.gap.lens import _apply

    out = _apply(x, taps, every)
    return out[:n] if out.shape[0] >= n else np.pad(out, [(0, n - out.shape[0]), (0, 0)], mode="edge")


def peaks(values: Array, gains: Array, n: int = 3) -> list[tuple[float, ...]]:
    """The n best separate maxima as starts."""
    order = np.argsort(gains)[::-1]
    chosen: list[int] = []
    for i in order:
        if all(abs(int(i) - j) > 6 for j in chosen):
            chosen.append(int(i))
        if len(chosen) == n:
            break
    return [(float(values[i]),) for i in chosen]
