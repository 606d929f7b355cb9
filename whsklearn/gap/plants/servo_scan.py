"""Where a candidate's first shape number is found by looking at all of them: order, frequency, time.

Behind a Gaussian of width sigma, cos(k q(t)) at the speed v is exp(-(k v sigma)^2 / 2) cos(k q), so
thousands of orders are tried on the decimated motion alone, all in one matrix product.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from whsklearn.effects.orders import waves
from whsklearn.gap.filters import CUTOFF_SIGMA, whiten
from whsklearn.gap.plants.servo_candidates import Candidate
from whsklearn.gap.plants.servo_columns import Signals

Array = NDArray[Any]
TOGETHER = 128  # orders in one matrix product


def scan_grids(kind: Candidate, view: Any) -> list[Array]:
    """The even grids of a scan: steps of a quarter of the resolution that the record has, and whole orders."""
    s = view.scene
    if kind.scanned == "step":
        return [np.linspace(*kind.ranged(s)[0], 181)]
    fastest = 2.0 * view.filter.cutoff
    if kind.scanned == "time":
        return [np.arange(kind.ranged(s)[0][0], fastest, 0.3 / s.duration)]
    low, most = kind.ranged(s)[0]
    highest = min(
        float(np.clip(2 * np.pi * fastest / max(s.speed, 1e-9), 3 * max(low, 1.0), 400 * max(low, 1.0))), most
    )
    step = max(0.2 * np.pi / s.reach, highest / 900)
    whole = [np.arange(np.ceil(low), highest + 1)] if highest < 300 else []
    return [*whole, np.arange(low, highest, step)]


def scan(
    kind: Candidate, view: Any, residual: Array, base: Array, angle: Array, speed: Array, grid: Array | None = None
) -> tuple[Array, Array]:
    """(values, drop of the sum of squares at each): linear, on the tracked motion.

    ``base`` are the sensitivities of the model in force on the training samples, which the columns
    are projected off; ``grid`` is an even one in place of the candidate's own.
    """
    grids = scan_grids(kind, view) if grid is None else [grid]
    mask = view.train & view.usable
    q, _ = np.linalg.qr(base)
    r = residual - q @ (q.T @ residual)
    signals, front = _seen(kind, view, angle, speed)
    gains = [
        _gains(kind, _columns(kind, view, part, signals, front), view.ar, mask, q, r)
        for g in grids for part in np.split(g, range(TOGETHER, g.size, TOGETHER))
    ]  # fmt: skip
    values, first = np.unique(np.concatenate(grids), return_index=True)
    return values, np.concatenate(gains)[first]


def _gains(kind: Candidate, columns: Array, ar: Array, mask: NDArray[np.bool_], q: Array, r: Array) -> Array:
    """Drop of the sum of squares by each column, or by each pair of cosine and sine, beyond the base ``q``."""
    z = whiten(columns, ar)[mask]
    q, r = q.astype(z.dtype), r.astype(z.dtype)
    z -= q @ (q.T @ z)
    if not kind.paired:
        return (z.T @ r) ** 2 / np.maximum(np.sum(z * z, axis=0), 1e-30)
    n = z.shape[1] // 2
    c, s = z[:, :n], z[:, n:]
    cc, ss, cs = (np.einsum("ij,ij->j", a, b) for a, b in ((c, c), (s, s), (c, s)))
    rc, rs = c.T @ r, s.T @ r
    ridge = 1e-6 * (cc + ss) + 1e-30
    det = (cc + ridge) * (ss + ridge) - cs**2
    return ((ss + ridge) * rc**2 - 2 * cs * rc * rs + (cc + ridge) * rs**2) / det


def _seen(kind: Candidate, view: Any, angle: Array, speed: Array) -> tuple[Signals, Array]:
    """(signals of the tracked motion, decimated; what stands before a wave, blurred: its column at order zero)."""
    f, dt = view.filter, view.scene.dt
    time, drive, acceleration = view.record.clock, view.record.drive, np.gradient(speed, dt)
    front = np.ones(0)
    if kind.paired:
        front = f.blur(kind.unit_columns((0.0,), Signals(time, angle, speed, acceleration, drive))[:, 0])
    seen = Signals(f.pick(time), f.pick(angle), f.pick(speed), f.blur(acceleration), f.blur(drive))
    return seen, front


def _columns(kind: Candidate, view: Any, values: Array, s: Signals, front: Array) -> Array:
    """Columns at every value of an even grid: of a wave all cosines, then all sines, behind the view's Gaussian."""
    if not kind.paired:
        return np.column_stack([kind.unit_columns((float(x),), s)[:, 0] for x in values])
    sigma = CUTOFF_SIGMA / (2 * np.pi * view.filter.cutoff)
    angle, rate = (s.position, s.velocity)
    if kind.scanned == "time":
        angle, rate = 2 * np.pi * s.time, np.full(s.time.size, 2 * np.pi)
    step = float(values[1] - values[0]) if values.size > 1 else 0.0
    # In single precision: a scan ranks thousands of columns and spends its time moving them; the best are run again.
    out = np.empty((angle.size, 2 * values.size), dtype=np.float32)
    waves(out, angle, sigma * rate, front * np.ones(angle.size), float(values[0]), step)
    return out


def peaks(values: Array, gains: Array, n: int = 3) -> list[float]:
    """The n best separate maxima."""
    chosen: list[int] = []
    for i in np.argsort(gains)[::-1]:
        if all(abs(int(i) - j) > 6 for j in chosen):
            chosen.append(int(i))
        if len(chosen) == n:
            break
    return [float(values[i]) for i in chosen]


def zoom(
    kind: Candidate,
    view: Any,
    residual: Array,
    base: Array,
    motion: tuple[Array, Array],
    values: Array,
    gains: Array,
) -> list[tuple[float, ...]]:
    """The best maxima of a scan, each looked at again ten times finer."""
    step = float(np.median(np.diff(values)))
    out: list[tuple[float, ...]] = []
    for centre in peaks(values, gains):
        low, high = max(centre - 1.2 * step, values[0]), min(centre + 1.2 * step, values[-1])
        fine, again = scan(kind, view, residual, base, *motion, grid=np.linspace(low, high, 25))
        out.append((float(fine[np.argmax(again)]),))
    return out
