"""A twin of the coupled electric drives: two motors on a belt, a pulley on springs, a sensor that reads |speed|."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.signal import cont2discrete, lfilter
from sklearn.utils import check_random_state

SAMPLE_RATE = 50.0  # Hz
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
    >>> from whsklearn.datasets import make_coupled_drives
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
    b, a, _ = cont2discrete((NUMERATOR, DENOMINATOR), 1.0 / SAMPLE_RATE)
    return u, np.abs(lfilter(b.ravel(), a, u)) + noise * rng.standard_normal(n_samples)
