"""Records of the paper's simulated example."""

from __future__ import annotations

from typing import Any

import numpy as np
from sklearn.utils import Bunch

from whsklearn.systems.wiener_hammerstein import WienerHammersteinSystem


def make_wiener_hammerstein(
    n_samples: int = 1000,
    snr_db: float | None = 7.462,
    random_state: Any = None,
    *,
    system: WienerHammersteinSystem | None = None,
    return_truth: bool = False,
) -> Any:
    """A record of Example 5.1, or of another system under the same experiment.

    Parameters
    ----------
    n_samples : int, default=1000
        Length.
    snr_db : float or None, default=7.462
        10 log10(var(noise-free y) / var(d)), with d the equation noise of (2); None for no noise.
    random_state : int, Generator or None
        Seed of input and noise.
    system : WienerHammersteinSystem, optional
        Example 5.1 by default.
    return_truth : bool, default=False
        Also return a Bunch with ``system``, ``u``, ``x``, ``v``, ``y`` (noise-free), ``d``
        ``parameters`` by name, and ``theta`` in the paper's order (None without a linear term).

    Returns
    -------
    X : ndarray of shape (n_samples, 1)
        Input, white Gaussian of variance one.
    y : ndarray of shape (n_samples,)
        Output.
    truth : Bunch
        Only with ``return_truth``.

    Raises
    ------
    ValueError
        If n_samples is below 1.

    Examples
    --------
    >>> from whsklearn.datasets import make_wiener_hammerstein
    >>> X, y, truth = make_wiener_hammerstein(200, snr_db=20, random_state=0, return_truth=True)
    >>> X.shape, y.shape
    ((200, 1), (200,))
    >>> truth.theta
    array([0.05 , 0.11 , 0.1  , 0.025, 0.7  , 0.2  , 0.2  , 0.15 , 0.4  ])
    """
    if n_samples < 1:
        raise ValueError(f"n_samples is {n_samples}, expected 1 or more.")
    rng = np.random.default_rng(random_state)
    system = WienerHammersteinSystem.example() if system is None else system
    u = rng.standard_normal(n_samples)
    clean = system.signals(u)
    d = np.zeros(n_samples)
    if snr_db is not None:
        d = rng.standard_normal(n_samples) * np.sqrt(np.var(clean.y) / 10 ** (snr_db / 10))
    y = system.simulate(u, d)
    if not return_truth:
        return u[:, None], y
    theta = None if system.law.key is None else system.theta
    return u[:, None], y, Bunch(system=system, u=u, d=d, theta=theta, parameters=system.parameters, **clean)
