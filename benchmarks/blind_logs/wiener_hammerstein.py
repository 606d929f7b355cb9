"""u-y records of Wiener-Hammerstein systems with a hidden effect, from the equations alone.

Nothing of the library is used: blocks are direct-form loops, the law and the effects are written here once
more, sizes are found by bisection on the output.  What a finder may see is ``frame`` (u, y and time_s).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
import pandas as pd
from numba import njit

STATIC = (
    "asymmetric_coulomb asymmetric_viscous stribeck quadratic_drag load_friction position_friction "
    "presliding_hysteresis friction_drift cogging gravity_imbalance cable_spring hardening_spring end_stop "
    "disturbance_tone parameter_change"
).split()
DRIVE = "dead_zone saturation input_delay actuator_lag torque_ripple".split()
TRANSMISSION = ["backlash"]
SENSOR = "output_offset output_drift sensor_rectification encoder_eccentricity quantization".split()
EFFECTS = (*STATIC, *DRIVE, *TRANSMISSION, *SENSOR)
FOREIGN = ("cubic_input", "product", "even_spring", "square_wave_time", "second_kink", "rate_limit", "bilinear_output")
INVISIBLE = ("input_offset",)
OWN = ("magnet",)  # of a user's own: c exp(-(x/w)^2), drawn by `benchmarks.own_effect` only
ALIASES = (
    frozenset({"output_offset", "asymmetric_coulomb", "input_offset"}),
    frozenset({"input_delay", "actuator_lag"}),
)
NUMBER = {name: i for i, name in enumerate((*EFFECTS, *FOREIGN, *INVISIBLE, *OWN))}
INPUTS = ("white", "multisine", "coloured")
NOISES = (15.0, 25.0, 35.0)  # dB
COLUMNS = {"input": "u", "output": "y"}


@dataclass
class Case:
    """One record and what it hides."""

    frame: pd.DataFrame
    truth: tuple[str, ...]
    kind: str  # named, none, coloured, foreign, pair
    seed: int
    size: float
    snr_db: float
    excitation: str
    strength: float  # size over noise, times root n
    parameters: list[dict[str, float]] = field(default_factory=list)
    system: dict[str, list[float]] = field(default_factory=dict)


@njit(cache=True)
def _play(x, gap, last):
    if x - gap / 2 > last:
        return x - gap / 2
    if x + gap / 2 < last:
        return x + gap / 2
    return last


@njit(cache=True)
def _at_law(k, s, h, g, x, dx, sg, u, t, dt, z, j):
    """What effect j adds to v; ``z`` holds the bristles' states."""
    if k == 0:
        return s * abs(sg)
    if k == 1:
        return s * abs(dx)
    if k == 2:
        return s * math.exp(-((dx / h) ** 2)) * sg
    if k == 3:
        return s * dx * abs(dx)
    if k == 4:
        return s * abs(u) * sg
    if k == 5:
        return s * math.cos(h * x + g) * sg
    if k == 6:
        if sg != 0:
            z[j] = sg + (z[j] - sg) * math.exp(-abs(dx) / h)
        return s * z[j]
    if k == 7:
        return s * (1 - math.exp(-t * dt / h)) * sg
    if k == 8:
        return s * math.cos(h * x + g)
    if k == 9:
        return s * math.cos(x + g)
    if k == 10:
        return s * x
    if k == 11:
        return s * x**3
    if k == 12:
        return s * (max(x - h, 0.0) - max(-x - h, 0.0))
    if k == 13:
        return s * math.cos(2 * math.pi * h * t * dt + g)
    if k == 14:
        return s * (dx if g < 1 else sg) if t * dt > h else 0.0
    return _foreign_at_law(k, s, h, x, dx, t * dt)


@njit(cache=True)
def _foreign_at_law(k, s, h, x, dx, time):
    """The same for effects outside the catalogue."""
    if k == 27:
        return s * x * dx
    if k == 28:
        return s * x * x
    if k == 29:
        return s * (1.0 if time % (2 * h) < h else -1.0) * dx
    if k == 30:
        return s * (max(dx - h, 0.0) - 2.0 * max(-dx - 1.7 * h, 0.0))
    if k == 34:
        return s * math.exp(-((x / h) ** 2))
    return 0.0


@njit(cache=True)
def _at_input(k, s, h, g, now, u, t, dt, x, lagged, j):
    """The drive after effect j; ``lagged`` holds the states of lags."""
    if k == 15:
        return 0.0 if abs(now) < s else now - math.copysign(s, now)
    if k == 16:
        return now if abs(now) < s else math.copysign(s, now)
    if k == 17:
        m = int(s / dt)
        f = s / dt - m
        return (1 - f) * (u[t - m] if t >= m else 0.0) + f * (u[t - m - 1] if t > m else 0.0)
    if k == 18:
        lagged[j] = math.exp(-dt / s) * lagged[j] + (1 - math.exp(-dt / s)) * now
        return lagged[j]
    if k == 19:
        return now * (1 - s * math.cos(h * x + g))
    if k == 26:
        return now + s * now**3
    if k == 31:
        step = now - lagged[j]
        lagged[j] += min(max(step, -s), s)
        return lagged[j]
    if k == 33:
        return now - s
    return now


@njit(cache=True)
def _read(k, s, h, g, y, q, t, dt):
    """The reading after effect j of the sensor."""
    if k == 21:
        return y + s
    if k == 22:
        return y + s * t * dt
    if k == 23:
        return (1 - s) * y + s * abs(y)
    if k == 24:
        return y + s * math.cos(h * q + g)
    if k == 25:
        return s * math.floor(y / s + 0.5)
    return y


@njit(cache=True)
def _filtered(t, numerator, denominator, x, y, start):
    """start + numerator * past of x - denominator * past of y."""
    out = start
    for i in range(numerator.size):
        if t - 1 - i >= 0:
            out += numerator[i] * x[t - 1 - i]
    for i in range(denominator.size):
        if t - 1 - i >= 0:
            out -= denominator[i] * y[t - 1 - i]
    return out


@njit(cache=True)
def run(a, b, c, d, law, kinds, p, u, noise, dt, port):
    """y of the record; ``kinds`` number the effects, ``p`` (n_effects, 4) holds size first.

    ``port`` receives the largest ratio of an effect's rms to its port's: at u, x, v and y.
    """
    n = u.size
    w, x0, v, q, y = np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n)
    last, z, lagged = np.zeros(2), np.zeros(2), np.zeros(2)
    x_old = 0.0
    power = np.zeros((4, 2))
    for t in range(n):
        x0[t] = _filtered(t, a, b, w, x0, 0.0)
        x = x0[t]
        for j in range(kinds.size):
            if kinds[j] == 20:
                last[j] = _play(x, p[j, 0], last[j])
                x = last[j]
        power[1, 0] += (x - x0[t]) ** 2
        power[1, 1] += x0[t] ** 2
        dx = x - x_old
        sg = 1.0 if dx > 0 else (-1.0 if dx < 0 else 0.0)
        v[t] = law[0] * dx + law[1] * sg - law[2] * math.tanh(dx)
        plain = v[t]
        now = u[t]
        for j in range(kinds.size):
            v[t] += _at_law(kinds[j], p[j, 0], p[j, 1], p[j, 2], x, dx, sg, u[t], t, dt, z, j)
            now = _at_input(kinds[j], p[j, 0], p[j, 1], p[j, 2], now, u, t, dt, x, lagged, j)
        w[t] = now
        power[0, 0] += (now - u[t]) ** 2
        power[0, 1] += u[t] ** 2
        power[2, 0] += (v[t] - plain) ** 2
        power[2, 1] += plain**2
        x_old = x
        q[t] = _filtered(t, c, d, v, q, noise[t])
        for j in range(kinds.size):
            if kinds[j] == 32 and t > 0:
                q[t] += p[j, 0] * q[t - 1] * u[t - 1]
                power[2, 0] += (p[j, 0] * q[t - 1] * u[t - 1]) ** 2
        y[t] = q[t]
        for j in range(kinds.size):
            y[t] = _read(kinds[j], p[j, 0], p[j, 1], p[j, 2], y[t], q[t], t, dt)
        power[3, 0] += (y[t] - q[t]) ** 2
        power[3, 1] += q[t] ** 2
    port[0] = 0.0
    for j in range(4):
        if power[j, 1] > 0:
            port[0] = max(port[0], math.sqrt(power[j, 0] / power[j, 1]))
    return y


def _block(rng: np.random.Generator) -> np.ndarray:
    """Denominator of order 2 with poles of modulus 0.2 to 0.9."""
    if rng.uniform() < 0.5:
        r, turn = rng.uniform(0.3, 0.88), rng.uniform(0.2, 2.9)
        return np.array([-2 * r * math.cos(turn), r * r])
    p1, p2 = rng.uniform(-0.85, 0.85, 2)
    return np.array([-p1 - p2, p1 * p2])


def draw_system(rng: np.random.Generator) -> dict[str, np.ndarray]:
    """Example 5.1 in one of three cases, a random stable system in the others."""
    if rng.uniform() < 1 / 3:
        parts = {"a": [1.0, 2.2], "b": [1.0, 0.5], "c": [1.0, 0.2], "d": [0.15, 0.4], "law": [0.05, 0.7, 0.2]}
        return {key: np.array(value) for key, value in parts.items()}
    return {
        "a": np.array([1.0, rng.uniform(-1.5, 1.5)]),
        "b": _block(rng),
        "c": np.array([1.0, rng.uniform(-0.8, 0.8)]),
        "d": _block(rng),
        "law": np.array([rng.uniform(0.05, 0.3), rng.uniform(0.3, 1.0), rng.uniform(0.1, 0.3)]),
    }


def draw_input(kind: str, n: int, rng: np.random.Generator) -> np.ndarray:
    """White, odd random-phase multisine, or first-order coloured noise; standard deviation of 0.7 to 1.5."""
    if kind == "multisine":
        period = n // 2
        lines = np.arange(1, int(0.42 * period), 2)
        phases = rng.uniform(0, 2 * np.pi, lines.size)
        t = np.arange(n)
        u = np.zeros(n)
        for line, phase in zip(lines, phases, strict=True):
            u += np.cos(2 * np.pi * line * t / period + phase)
    else:
        u = rng.standard_normal(n)
        if kind == "coloured":
            for t in range(1, n):
                u[t] += rng_pole(kind) * u[t - 1]
    return rng.uniform(0.7, 1.5) * u / u.std()


def rng_pole(_: str) -> float:
    """Pole of the coloured input."""
    return 0.6


def _colour(rng: np.random.Generator, n: int) -> np.ndarray:
    """Noise with a spectrum of its own."""
    e = rng.standard_normal(n + 200)
    p1, p2 = rng.uniform(0.4, 0.95), rng.uniform(-0.5, 0.5)
    zero = rng.uniform(-0.6, 0.6)
    out = np.zeros_like(e)
    for t in range(2, e.size):
        out[t] = (p1 + p2) * out[t - 1] - p1 * p2 * out[t - 2] + e[t] + zero * e[t - 1]
    return out[200:] / out[200:].std()


def _shape(name: str, rng: np.random.Generator, x: np.ndarray, y: np.ndarray, seconds: float, dt: float) -> list[float]:
    """Off-grid shape numbers in the scale of the record."""
    dx, sx, reach = np.std(np.diff(x)), np.std(x), np.quantile(np.abs(x), 0.99)
    if name == "magnet":  # here, for the table below draws for all: one row more would make other records of all seeds
        return [min(sx * rng.uniform(0.15, 0.5), 0.9)]
    phase = rng.uniform(-3, 3)
    return {
        "stribeck": [dx * rng.uniform(0.15, 0.7)],
        "position_friction": [rng.uniform(0.8, 5.0) / sx, phase],
        "presliding_hysteresis": [dx * rng.uniform(0.2, 2.5)],
        "friction_drift": [seconds * rng.uniform(0.1, 0.8)],
        "cogging": [rng.uniform(0.8, 6.0) / sx, phase],
        "gravity_imbalance": [0.0, phase],
        "end_stop": [reach * rng.uniform(0.3, 0.75)],
        "disturbance_tone": [rng.uniform(0.01, 0.4) / dt, phase],
        "parameter_change": [seconds * rng.uniform(0.25, 0.75), float(rng.integers(2))],
        "torque_ripple": [rng.uniform(0.8, 6.0) / sx, phase],
        "encoder_eccentricity": [rng.uniform(1.0, 4.0) / np.std(y), phase],
        "square_wave_time": [seconds * rng.uniform(0.05, 0.2)],
        "second_kink": [dx * rng.uniform(0.5, 1.2)],
    }.get(name, [])


def _states(s: dict[str, np.ndarray], u: np.ndarray) -> np.ndarray:
    x = np.zeros(u.size)
    for t in range(u.size):
        for i, a in enumerate(s["a"]):
            x[t] += a * u[t - 1 - i] if t - 1 - i >= 0 else 0.0
        for i, b in enumerate(s["b"]):
            x[t] -= b * x[t - 1 - i] if t - 1 - i >= 0 else 0.0
    return x


def _sized(name: str, target: float, s: dict[str, np.ndarray], row: np.ndarray, u: np.ndarray, dt: float) -> np.ndarray:
    """The row with the size at which the effect is ``target`` of the rms at its port."""
    none, port = np.zeros(u.size), np.zeros(1)
    blocks = (s["a"], s["b"], s["c"], s["d"], s["law"])
    kind = np.array([NUMBER[name]])
    top = float(np.abs(u).max())
    falling = name in ("saturation", "rate_limit")
    low, high = 1e-6, {"sensor_rectification": 1.0, "saturation": top, "rate_limit": 2 * top}.get(name, 1e3)
    if name in ("encoder_eccentricity", "torque_ripple"):
        high = 0.9 / (row[1] if name == "encoder_eccentricity" else 1.0)
    for _ in range(60):
        size = math.sqrt(low * high)
        row[0] = size
        run(*blocks, kind, row[None, :], u, none, dt, port)
        over = not port[0] < target
        if over != falling:
            high = size
        else:
            low = size
    return row


def make_case(
    kind: str = "named", seed: int = 0, *, effects: tuple[str, ...] | None = None, size: float | None = None,
    noise: float | None = None, n: int = 3000, excitation: str | None = None,
) -> Case:  # fmt: skip
    """Draw a record.

    Parameters
    ----------
    kind : str
        ``named``, ``none`` (nothing missing), ``coloured`` (noise only), ``foreign`` or ``pair``.
    seed : int
    effects : tuple of str, optional
        Names to hide, drawn where left out.
    size : float, optional
        rms of the effect over the rms at its port; drawn from 2, 5 and 15 %.
    noise : float, optional
        Signal over equation noise in dB; drawn from 15 to 40.
    """
    rng = np.random.default_rng([seed, 77])
    s = draw_system(rng)
    excitation = excitation or str(rng.choice(INPUTS))
    u = draw_input(excitation, n, rng)
    dt = float(rng.choice([1.0, 0.01, 0.001]))
    x = _states(s, u)
    snr = float(rng.uniform(15, 40)) if noise is None else noise
    size = float(rng.choice([0.02, 0.05, 0.15])) if size is None else size
    blocks = (s["a"], s["b"], s["c"], s["d"], s["law"])
    y0 = run(*blocks, np.zeros(0, np.int64), np.zeros((0, 4)), u, np.zeros(n), dt, np.zeros(1))
    names = list(effects or ())
    if not names and kind in ("named", "foreign"):
        names = [str(rng.choice(EFFECTS if kind == "named" else FOREIGN))]
    elif not names and kind == "pair":
        names = [EFFECTS[i] for i in rng.choice(len(EFFECTS), 2, replace=False)]
    rows = np.zeros((len(names), 4))
    for row, effect in zip(rows, names, strict=True):
        shape = _shape(effect, rng, x, y0, n * dt, dt)
        row[1 : 1 + len(shape)] = shape
        _sized(effect, size, s, row, u, dt)
    numbers = np.array([NUMBER[e] for e in names], dtype=np.int64)
    e = _colour(rng, n) if kind == "coloured" else rng.standard_normal(n)
    d = e * np.std(y0) * 10 ** (-snr / 20)
    y = run(*blocks, numbers, rows, u, d, dt, np.zeros(1))
    frame = pd.DataFrame({"time_s": np.arange(n) * dt, "u": u, "y": y})
    parameters = [dict(zip(("size", "shape", "phase"), map(float, r), strict=False)) for r in rows]
    system = {key: value.tolist() for key, value in s.items()}
    strength = size * 10 ** (snr / 20) * math.sqrt(n)
    return Case(frame, tuple(names), kind, seed, size, snr, excitation, strength, parameters, system)


def right(truth: tuple[str, ...], name: str) -> bool:
    """Whether a name is the truth."""
    return name in truth


def right_group(truth: tuple[str, ...], name: str) -> bool:
    """Whether a name is the truth or an alias that no record tells from it."""
    return name in truth or any(name in g and g & set(truth) for g in ALIASES)
