"""u-y records of chains as somebody with SciPy would make them: whole-signal filters and an ODE, no sample loop shared.

Blocks are `scipy.signal.lfilter` on whole signals, the play is a scan over turning points, the coupling two masses in
continuous time (`scipy.integrate.solve_ivp` on the held input), noise is white and added to the output or inside L2.
`PORTS` are effects at a place where a catalogue may not look: their key is how they are drawn, their value the name.
Nothing of the library and nothing of `benchmarks.blind_logs.wiener_hammerstein` is used.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pandas as pd
from scipy.integrate import solve_ivp
from scipy.signal import butter, lfilter

EFFECTS = ("backlash", "disturbance_tone", "sensor_rectification", "flexible_coupling", "dead_zone", "saturation")
PORTS = {
    "input_delay": "input_delay",
    "input_play": "backlash",
    "output_coupling": "flexible_coupling",
    "folded_below_noise": "sensor_rectification",
}
COLUMNS = {"input": "u", "output": "y"}


@dataclass(frozen=True)
class Record:
    """A frame with u and y, the hidden effect ('' for none) and its numbers."""

    frame: pd.DataFrame
    truth: str
    numbers: dict[str, float]


def blocks(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Numerators and denominators of two second-order blocks, each one sample late."""
    poles1 = rng.uniform(0.5, 0.8) * np.exp(1j * rng.uniform(0.4, 1.2))
    poles2 = rng.uniform(0.3, 0.7, 2) * np.array([1.0, -0.5])
    den1 = np.real(np.poly([poles1, np.conj(poles1)]))
    den2 = np.poly(poles2)
    return np.array([0.0, 1.0, rng.uniform(-0.5, 0.8)]), den1, np.array([0.0, 1.0, rng.uniform(-0.4, 0.4)]), den2


def friction(dx: np.ndarray) -> np.ndarray:
    """The law that the finder's base model has, with numbers of its own."""
    return 0.15 * dx + 0.6 * np.sign(dx) - 0.2 * np.tanh(dx)


def played(x: np.ndarray, gap: float) -> np.ndarray:
    """x behind a play: what is dragged by the near side, as a running clip between x - gap / 2 and x + gap / 2."""
    out, at = np.empty_like(x), 0.0
    for i, (low, high) in enumerate(zip(x - gap / 2, x + gap / 2, strict=True)):
        at = float(np.clip(at, low, high))
        out[i] = at
    return out


def coupled(x: np.ndarray, frequency: float, damping: float) -> np.ndarray:
    """A mass on a spring driven by x, held over each sample (frequency in cycles a sample)."""
    w = 2.0 * np.pi * frequency
    out, state = np.empty_like(x), np.zeros(2)
    for i, drive in enumerate(x):
        held = solve_ivp(
            lambda _, s, drive=drive: [s[1], w * w * (drive - s[0]) - 2 * damping * w * s[1]], (0.0, 1.0), state,
            rtol=1e-7, atol=1e-9,
        )  # fmt: skip
        state = held.y[:, -1]
        out[i] = state[0]
    return out


def delayed(u: np.ndarray, samples: float) -> np.ndarray:
    """u some samples later, by the phases of its spectrum (zeros before it begins)."""
    spectrum = np.fft.rfft(np.concatenate([np.zeros(64), u]))
    turn = np.exp(-2j * np.pi * np.fft.rfftfreq(u.size + 64) * samples)
    return np.fft.irfft(spectrum * turn, u.size + 64)[64:]


def record(effect: str, seed: int, *, n: int = 2000, snr_db: float = 30.0) -> Record:
    """A record with one hidden effect: '' for none, one of `EFFECTS` or a key of `PORTS`."""
    rng = np.random.default_rng([seed, 4711])
    a, b, c, d = blocks(rng)
    u = lfilter(*butter(2, 0.7), rng.normal(size=n))
    u *= 1.2 / u.std()
    numbers: dict[str, float] = {}
    driven = u
    if effect == "dead_zone":
        numbers["width"] = 0.25
        driven = u - np.clip(u, -0.25, 0.25)
    elif effect == "saturation":
        numbers["limit"] = 1.4
        driven = np.clip(u, -1.4, 1.4)
    elif effect == "input_delay":
        numbers["samples"] = float(rng.uniform(1.5, 5.0))
        driven = delayed(u, numbers["samples"])
    elif effect == "input_play":
        numbers["gap"] = float(rng.uniform(0.2, 0.5) * u.std())
        driven = played(u, numbers["gap"])
    x = lfilter(a, b, driven)
    if effect == "backlash":
        numbers["gap"] = float(rng.uniform(0.2, 0.5) * x.std())
        x = played(x, numbers["gap"])
    elif effect == "flexible_coupling":
        numbers = {"frequency": float(rng.uniform(0.12, 0.3)), "damping_ratio": float(rng.uniform(0.1, 0.4))}
        x = coupled(x, numbers["frequency"], numbers["damping_ratio"])
    v = friction(np.diff(x, prepend=0.0))
    clean = lfilter(c, d, v)
    if effect == "output_coupling":
        numbers = {"frequency": float(rng.uniform(0.12, 0.3)), "damping_ratio": float(rng.uniform(0.02, 0.1))}
        clean = coupled(clean, numbers["frequency"], numbers["damping_ratio"])
    sigma = clean.std() * 10.0 ** (-snr_db / 20.0)
    y = clean + lfilter([1.0], d, sigma * rng.normal(size=n))
    if effect == "disturbance_tone":
        numbers = {"frequency": float(rng.uniform(0.03, 0.3)), "amplitude": float(0.15 * clean.std())}
        y = y + numbers["amplitude"] * np.sin(2 * np.pi * numbers["frequency"] * np.arange(n))
    elif effect == "sensor_rectification":
        y = np.abs(y)
        numbers["fraction"] = 1.0
    elif effect == "folded_below_noise":
        y = np.abs(clean) + sigma * rng.normal(size=n)
        numbers["fraction"] = 1.0
    return Record(pd.DataFrame({"u": u, "y": y}), PORTS.get(effect, effect), numbers)
