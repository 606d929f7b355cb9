"""A twin of the Silverbox: an electronic mass on a hardening spring, in volts."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from sklearn.utils import check_random_state

from whsklearn.effects import CableSpring, FrictionLaw, HardeningSpring, Viscous
from whsklearn.effects.base import Array
from whsklearn.systems import ServoAxis

SAMPLE_RATE = 1e7 / 2**14  # Hz, of the published records
BAND = 200.0  # Hz
PERIOD, LEAD_IN, PAUSE = (8192, 500, 100)  # samples of a multisine, of its end before it, and of silence
RMS = 0.0224  # V
OVERSAMPLING = 32  # fine samples per sample in the simulation: 280 per period of the resonance


def make_silverbox(
    kind: str = "multisine", *, n_realisations: int = 10, noise: float = 5e-5, random_state: Any = None
) -> tuple[Array, Array]:
    """Simulate m y'' + d y' + a y + b (y - c)^3 = u between band-limited signals, as the Silverbox was measured.

    Resonance at 68.6 Hz with a damping ratio of 4.7 %, a = 1, b = 4 1/V2: close to grey-box models of the real circuit,
    but not a copy of one.

    Parameters
    ----------
    kind : {"multisine", "arrow"}, default="multisine"
        Random odd multisines up to 200 Hz, or noise below 200 Hz whose amplitude grows to 1.6 times that of the
        multisines.
    n_realisations : int, default=10
        Of the multisine; the arrow has 40,475 samples for ten of them.
    noise : float, default=5e-5
        Standard deviation of the output's noise (V): 60 dB below the output.
    random_state : int, RandomState instance or None
        Of input and noise.

    Returns
    -------
    u, y : ndarray of shape (n_samples,)
        Input and output (V), at 610.35 Hz.

    Raises
    ------
    ValueError
        If ``kind`` is unknown.

    References
    ----------
    Wigren and Schoukens 2013, Three free data sets for development and benchmarking in nonlinear system
    identification, ECC, 2933-2938; Noel and Schoukens 2018, Int. J. Control 91(5), 1118-1139, a grey-box model.

    Examples
    --------
    >>> from whsklearn.datasets import make_silverbox
    >>> u, y = make_silverbox(n_realisations=1, random_state=0)
    >>> u.size, bool(0.03 < y.std() < 0.08)
    (8792, True)
    """
    rng = check_random_state(random_state)
    if kind == "multisine":
        u = np.concatenate([_multisine(rng) for _ in range(n_realisations)])
    elif kind == "arrow":
        n = round(4047.5 * n_realisations)
        u = _band_limited(rng.standard_normal(n))
        u *= np.linspace(0.0, 1.6 * RMS, n) / np.std(u)
    else:
        raise ValueError(f"kind is {kind!r}, expected 'multisine' or 'arrow'.")
    stiffness, centre, turn = 4.0, -0.021, 2.0 * math.pi * 68.6
    axis = ServoAxis(
        inertia=1.0 / turn**2,
        law=FrictionLaw([Viscous(2.0 * 0.047 / turn)]),
        effects=(CableSpring(1.0), HardeningSpring(stiffness, centre)),
        sample_rate=OVERSAMPLING * SAMPLE_RATE,
        substeps=1,
    )
    y = axis.simulate_drive(_upsampled(u)).position[::OVERSAMPLING]
    return u, y + noise * rng.standard_normal(u.size)


def _multisine(rng: Any) -> Array:
    """Silence, the end of a period, and the period."""
    lines = np.arange(1, int(BAND * PERIOD / SAMPLE_RATE) + 1, 2)
    spectrum = np.zeros(PERIOD // 2 + 1, dtype=complex)
    spectrum[lines] = np.exp(2j * math.pi * rng.uniform(size=lines.size))
    period = np.fft.irfft(spectrum, PERIOD)
    period *= RMS / period.std()
    return np.concatenate([np.zeros(PAUSE), period[-LEAD_IN:], period])


def _band_limited(u: Array) -> Array:
    """Nothing above `BAND`."""
    spectrum = np.fft.rfft(u)
    spectrum[np.fft.rfftfreq(u.size, 1.0 / SAMPLE_RATE) > BAND] = 0.0
    return np.fft.irfft(spectrum, u.size)


def _upsampled(u: Array) -> Array:
    """The signal in the middle of each of the `OVERSAMPLING` fine steps per sample, by its Fourier series."""
    spectrum = np.fft.rfft(u)
    later = np.exp(1j * math.pi * np.arange(spectrum.size) / (u.size * OVERSAMPLING))
    return np.fft.irfft(spectrum * later, u.size * OVERSAMPLING) * OVERSAMPLING
