"""The bound (22) of Theorem 1 on the mean squared parameter error, to be drawn beside the measured one."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from whsklearn._inputs import real_array


def convergence_bound(
    t: ArrayLike,
    alpha: float,
    beta: float,
    n_params: int,
    P0: float,
    noise_variance: float,
    *,
    epsilon: float = 0.0,
    p: int = 1,
    initial_error: float | None = None,
) -> NDArray[np.float64]:
    """Bound (22) on E norm(theta_hat(t) - theta)^2 under persistent excitation.

    Parameters
    ----------
    t : array-like of shape (n,)
        Samples seen, >= 1.
    alpha, beta : float
        Bounds of the excitation in Theorem 1, as `excitation` measures them with the same p.
    n_params : int
        Number of parameters n.
    P0 : float
        Initial covariance p_0, P(0) = p_0 I.
    noise_variance : float
        sigma_v^2 of the noise d(t).
    epsilon : float, default=0
        Bound of Delta(t)^2, the square of what the auxiliary model's error adds to the innovation.
    p : int, default=1
        Innovation length; it stands on both sides of (22) and cancels, but for ``initial_error``.
    initial_error : float, optional
        norm(theta_hat(0) - theta)^2, if known.  (22) takes W_p(0) = p n / p_0^2, which holds if
        that is p n / p_0; given here, W_p(0) is the number over p_0 instead.

    Returns
    -------
    ndarray of shape (n,)
        The bound, in squared units of theta.  Beyond the samples where P0 still matters it
        falls as ln(t) / t.

    Raises
    ------
    ValueError
        If a constant is not positive, beta < alpha or t < 1.

    Notes
    -----
    Equations (18) to (22).  The proof takes every d(t, i) as new, uncorrelated with theta_hat_{i-1}(t).
    With overlapping windows and p > 1 a sample's noise has been used before, and the bound is
    a guide, not a guarantee; with p = 1 or windows that do not overlap it is one.

    Examples
    --------
    >>> from whsklearn.validation import convergence_bound
    >>> bound = convergence_bound([100, 10_000], alpha=1.0, beta=1.0, n_params=2, P0=1e6, noise_variance=0.01)
    >>> bound.round(5)
    array([3.68e-03, 5.00e-05])
    """
    t = real_array(t, "convergence_bound: t")
    constants = {"alpha": alpha, "beta": beta, "n_params": n_params, "P0": P0, "p": p}
    for name, value in constants.items():
        if not np.isfinite(value) or value <= 0:
            hint = "the data do not excite every direction, so (22) bounds nothing" if name == "alpha" else "see (22)"
            raise ValueError(f"convergence_bound: {name} is {value!r}, expected a positive number; {hint}.")
    if not noise_variance >= 0 or not epsilon >= 0 or (initial_error is not None and not initial_error >= 0):
        raise ValueError("convergence_bound: noise_variance, epsilon and initial_error must be numbers >= 0.")
    if beta < alpha:
        raise ValueError(f"convergence_bound: beta is {beta}, below alpha = {alpha}; give them in order.")
    if t.size == 0 or not np.all(t >= 1):
        raise ValueError("convergence_bound: t must hold sample counts >= 1.")
    start = n_params / P0**2 if initial_error is None else initial_error / (p * P0)
    growth = n_params * (np.log(beta * t + 1 / P0) + np.log(P0))
    return (start + growth * (noise_variance + epsilon)) / (alpha * t + 1 / P0)
