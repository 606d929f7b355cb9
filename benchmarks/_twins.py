"""A twin of the Silverbox: an electronic mass on a hardening spring, in volts.

A twin of the coupled electric drives: two motors on a belt, a pulley on springs, a sensor that reads |speed|.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.signal import cont2discrete, lfilter
from sklearn.utils import check_random_state

from whsklearn.effects import CableSpring, FrictionLaw, HardeningSpring, Viscous
from whsklearn.effects.base import Array
from whsklearn.systems import ServoAxis

SILVERBOX_RATE = 1e7 / 2**14  # Hz, of the published records
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
        sample_rate=OVERSAMPLING * SILVERBOX_RATE,
        substeps=1,
    )
    y = axis.simulate_drive(_upsampled(u)).position[::OVERSAMPLING]
    return u, y + noise * rng.standard_normal(u.size)


def _multisine(rng: Any) -> Array:
    """Silence, the end of a period, and the period."""
    lines = np.arange(1, int(BAND * PERIOD / SILVERBOX_RATE) + 1, 2)
    spectrum = np.zeros(PERIOD // 2 + 1, dtype=complex)
    spectrum[lines] = np.exp(2j * math.pi * rng.uniform(size=lines.size))
    period = np.fft.irfft(spectrum, PERIOD)
    period *= RMS / period.std()
    return np.concatenate([np.zeros(PAUSE), period[-LEAD_IN:], period])


def _band_limited(u: Array) -> Array:
    """Nothing above `BAND`."""
    spectrum = np.fft.rfft(u)
    spectrum[np.fft.rfftfreq(u.size, 1.0 / SILVERBOX_RATE) > BAND] = 0.0
    return np.fft.irfft(spectrum, u.size)


def _upsampled(u: Array) -> Array:
    """The signal in the middle of each of the `OVERSAMPLING` fine steps per sample, by its Fourier series."""
    spectrum = np.fft.rfft(u)
    later = np.exp(1j * math.pi * np.arange(spectrum.size) / (u.size * OVERSAMPLING))
    return np.fft.irfft(spectrum * later, u.size * OVERSAMPLING) * OVERSAMPLING


# --- A twin of the coupled electric drives: two motors on a belt, a pulley on springs, a sensor that read ---
DRIVES_RATE = 50.0  # Hz
# Linear part, speed of the pulley by the motors' voltage: 5163 / (s^3 + 19.93 s^2 + 509.8 s + 2835)
NUMERATOR, DENOMINATOR = (5163.0,), (1.0, 19.93, 509.8, 2835.0)
SWITCHES = 5  # samples; the input keeps each level for a multiple of this


def make_coupled_drives(
    n_samples: int = 500, *, kind: str = "prbs", amplitude: float = 1.0, noise: float = 0.02, random_state: Any = None
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Simulate the coupled electric drives with the published parameters.

    A signal that switches the motors drives a pulley on springs with a resonance at 3.4 Hz; a pulse counter measures
    the speed of the pulley without its sign.

    Parameters
    ----------
    n_samples : int, default=500
        Of the published records, at 50 Hz.
    kind : {"prbs", "uniform"}, default="prbs"
        Two levels, or levels drawn from a uniform distribution.
    amplitude : float, default=1.0
        Largest level of the input (V).
    noise : float, default=0.02
        Standard deviation of the sensor's noise (V).
    random_state : int, RandomState instance or None
        Of input and noise.

    Returns
    -------
    u, y : ndarray of shape (n_samples,)
        Input and sensed speed (V).

    Raises
    ------
    ValueError
        If ``kind`` is unknown.

    References
    ----------
    Wigren, Schoukens 2017, Coupled Electric Drives Data Set and Reference Models, Uppsala University 2017-024: the
    linear part is the second model of Table 2.

    Examples
    --------
    >>> u, y = make_coupled_drives(100, noise=0.0, random_state=0)
    >>> y.shape, bool(y.min() >= 0.0)
    ((100,), True)
    """
    if kind not in ("prbs", "uniform"):
        raise ValueError(f"kind is {kind!r}, expected 'prbs' or 'uniform'.")
    rng = check_random_state(random_state)
    levels = rng.uniform(-amplitude, amplitude, n_samples // SWITCHES + 1)
    if kind == "prbs":
        levels = amplitude * np.sign(levels)
    u = np.repeat(levels, SWITCHES)[:n_samples]
    b, a, _ = cont2discrete((NUMERATOR, DENOMINATOR), 1.0 / DRIVES_RATE)
    return u, np.abs(lfilter(b.ravel(), a, u)) + noise * rng.standard_normal(n_samples)
