"""References for a servo axis."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

REFERENCES = ("sine", "multisine", "staircase", "sweep", "rich")


def reference_signal(
    kind: str,
    duration: float = 40.0,
    sample_rate: float = 1000.0,
    amplitude: float | None = None,
    random_state: Any = 0,
) -> NDArray[np.float64]:
    """A reference for the position.

    Parameters
    ----------
    kind : str
        ``sine``: 0.8 sin(2/5 pi t) of sec. 5.2.  ``multisine``: eight tones from 0.1 to 2.9 Hz
        of equal velocity and random phase. ``staircase``: constant speeds in both directions, from slow to fast.
        ``sweep``: 0.1 to 5 Hz at constant velocity.  ``rich``: the multisine on a slow triangle, which excites every
        effect of the catalogue.
    duration : float
        Length (s).
    sample_rate : float
        Samples per second (Hz).
    amplitude : float, optional
        Largest position (rad); the default is 0.8 for the sine, 1 for multisine and sweep,
        and 5 for staircase and rich.
    random_state : int, Generator or None
        Of the phases.

    Returns
    -------
    ndarray of shape (n,)
        Position (rad).

    Raises
    ------
    ValueError
        If the kind is unknown or a number is not above zero.

    Examples
    --------
    >>> from whsklearn.datasets import reference_signal
    >>> float(reference_signal("sine", 10.0, 100.0).max().round(3))
    0.8
    """
    makers: dict[str, tuple[Callable[..., NDArray[np.float64]], float]] = {
        "sine": (_sine, 0.8),
        "multisine": (_multisine, 1.0),
        "staircase": (_staircase, 5.0),
        "sweep": (_sweep, 1.0),
        "rich": (_rich, 5.0),
    }
    if kind not in makers:
        raise ValueError(f"Unknown reference {kind!r}; expected one of: {', '.join(makers)}, or an array.")
    make, default = makers[kind]
    peak = default if amplitude is None else amplitude
    for name, value in (("duration", duration), ("sample_rate", sample_rate), ("amplitude", peak)):
        if not (0 < value < math.inf):
            raise ValueError(f"{name} is {value!r}, expected a finite number above zero.")
    n = round(duration * sample_rate)
    if n < 2:
        raise ValueError(f"{duration} s at {sample_rate} Hz are {n} samples, expected at least two; lengthen it.")
    return make(np.arange(n) / sample_rate, peak, np.random.default_rng(random_state))


def _sine(t: NDArray[np.float64], peak: float, _rng: np.random.Generator) -> NDArray[np.float64]:
    """The paper's reference."""
    return peak * np.sin(0.4 * math.pi * t)


def _scaled(path: NDArray[np.float64], peak: float) -> NDArray[np.float64]:
    """A path scaled by its largest value."""
    return path * (peak / np.abs(path).max())


def _faded(t: NDArray[np.float64]) -> NDArray[np.float64]:
    """A rise from 0 to 1 within the first second, so that the axis starts from rest."""
    return 0.5 - 0.5 * np.cos(math.pi * np.minimum(t, 1.0))


def _multisine(t: NDArray[np.float64], peak: float, rng: np.random.Generator) -> NDArray[np.float64]:
    """Eight tones of equal velocity; frequencies 0.1, 0.5, 0.9 ... 2.9 Hz."""
    frequencies = 0.1 + 0.4 * np.arange(8)
    phases = rng.uniform(0.0, 2.0 * math.pi, 8)
    tones = np.sin(2.0 * math.pi * frequencies[:, None] * t + phases[:, None]) / frequencies[:, None]
    return _scaled(tones.sum(axis=0) * _faded(t), peak)


def _rich(t: NDArray[np.float64], peak: float, rng: np.random.Generator) -> NDArray[np.float64]:
    """A triangle over 20 s with rounded corners, from 0 upwards, and the multisine at a sixth of its height."""
    triangle = np.arcsin(0.98 * np.sin(2.0 * math.pi * t / min(20.0, t[-1]))) / math.asin(0.98)
    return _scaled(triangle * _faded(t) + _multisine(t, 1.0, rng) / 6.0, peak)


def _staircase(t: NDArray[np.float64], peak: float, _rng: np.random.Generator) -> NDArray[np.float64]:
    """Eight speeds, each forwards and backwards, with smooth reversals."""
    speeds = np.geomspace(0.02, 1.0, 8)
    edges = np.linspace(0.0, t[-1] * (1 + 1e-12), 17)
    step = np.minimum(np.searchsorted(edges, t, side="right") - 1, 15)
    velocity = speeds[step // 2] * np.where(step % 2 == 0, 1.0, -1.0)
    width = max(3, round(0.1 * t.size / 16))
    window = np.hanning(width + 2)[1:-1]
    soft = np.convolve(np.pad(velocity, width, mode="edge"), window / window.sum(), mode="same")[width:-width]
    return _scaled(np.cumsum(soft * _faded(t)), peak)


def _sweep(t: NDArray[np.float64], peak: float, _rng: np.random.Generator) -> NDArray[np.float64]:
    """A geometric sweep from 0.1 to 5 Hz with constant velocity amplitude."""
    low, high = 0.1, 5.0
    frequency = low * (high / low) ** (t / t[-1])
    phase = 2.0 * math.pi * np.cumsum(frequency) * (t[1] - t[0])
    return _scaled(np.sin(phase) / frequency * _faded(t), peak)
