"""What other packages do for the same problem: recursive least squares, theta(0) = 0, P(0) = P0 I, no forgetting.

Every function takes rows X (n, k) and y (n,), learns them one by one, and returns (theta, seconds of CPU);
data is put in the package's own form before the clock starts.
"""

from __future__ import annotations

import time

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Answer = tuple[Array, float]
P0 = 1e6


def numpy_rows(X: Array, y: Array) -> Answer:
    """The textbook recursion in NumPy."""
    theta, P = np.zeros(X.shape[1]), P0 * np.eye(X.shape[1])
    began = time.process_time()
    for row, target in zip(X, y, strict=True):
        g = P @ row
        g /= 1.0 + row @ g
        theta = theta + g * (target - row @ theta)
        P = P - np.outer(g, row @ P)
    return theta, time.process_time() - began


def padasip(X: Array, y: Array) -> Answer:
    """FilterRLS.adapt."""
    from padasip.filters import FilterRLS

    model = FilterRLS(X.shape[1], mu=1.0, eps=1 / P0, w="zeros")
    rows, targets = list(X), y.tolist()
    began = time.process_time()
    for row, target in zip(rows, targets, strict=True):
        model.adapt(target, row)
    return np.asarray(model.w), time.process_time() - began


def river(X: Array, y: Array) -> Answer:
    """BayesianLinearRegression.learn_one, whose posterior mean is the same estimate."""
    from river.linear_model import BayesianLinearRegression

    model = BayesianLinearRegression(alpha=1 / P0, beta=1.0)
    names = [f"x{i}" for i in range(X.shape[1])]
    rows, targets = [dict(zip(names, row, strict=True)) for row in X.tolist()], y.tolist()
    began = time.process_time()
    for row, target in zip(rows, targets, strict=True):
        model.learn_one(row, target)
    seconds = time.process_time() - began
    unit = [{n: float(n == name) for n in names} for name in names]
    return np.array([model.predict_one(row) for row in unit]), seconds


def filterpy(X: Array, y: Array) -> Answer:
    """KalmanFilter.update with a state that stands still."""
    from filterpy.kalman import KalmanFilter

    model = KalmanFilter(dim_x=X.shape[1], dim_z=1)
    model.x, model.P, model.R = np.zeros((X.shape[1], 1)), P0 * np.eye(X.shape[1]), np.eye(1)
    rows = [row[None] for row in X]
    began = time.process_time()
    for row, target in zip(rows, y, strict=True):
        model.update(target, H=row)
    return model.x[:, 0], time.process_time() - began


def sysidentpy(X: Array, y: Array) -> Answer:
    """RecursiveLeastSquares.optimize, which passes over the first two rows."""
    from sysidentpy.parameter_estimation import RecursiveLeastSquares

    model = RecursiveLeastSquares(delta=1 / P0, lam=1.0)
    rows, targets = np.r_[np.zeros((2, X.shape[1])), X], np.r_[0.0, 0.0, y][:, None]
    began = time.process_time()
    theta = model.optimize(rows, targets)
    return np.asarray(theta).ravel(), time.process_time() - began


def statsmodels(X: Array, y: Array) -> Answer:
    """RecursiveLS.filter over the whole array, from a diffuse start."""
    from statsmodels.regression.recursive_ls import RecursiveLS

    began = time.process_time()
    result = RecursiveLS(y, X).filter()
    return np.asarray(result.params), time.process_time() - began


def numpy_axes(X: Array, y: Array) -> Answer:
    """Many axes at once, the textbook recursion batched over the axes."""
    m, n, k = X.shape
    theta, P = np.zeros((m, k)), np.repeat(P0 * np.eye(k)[None], m, axis=0)
    began = time.process_time()
    for t in range(n):
        row = X[:, t]
        g = np.matmul(P, row[:, :, None])[:, :, 0]
        g /= (1.0 + np.einsum("ij,ij->i", row, g))[:, None]
        theta += g * (y[:, t] - np.einsum("ij,ij->i", row, theta))[:, None]
        P -= g[:, :, None] * np.matmul(row[:, None, :], P)
    return theta, time.process_time() - began


def numpy_rmils(u: Array, y: Array, p: int) -> Answer:
    """The published reading (10) to (14) of Example 5.1's orders and law, rows and auxiliary model in NumPy."""
    theta, P, seen = np.full(9, 0.01), P0 * np.eye(9), 0
    before = np.zeros(5)  # x(t-1), x(t-2), x(t-3), v(t-1), v(t-2) before the window
    past_u, past_y = np.zeros(p + 3), np.zeros(p + 3)

    def advance(state: Array, newest: Array) -> Array:
        g = theta[0] if abs(theta[0]) > 1e-9 else 1e-9
        x = newest[0] + theta[1] / g * newest[1] - (theta[2] / g - 1) * state[0] - theta[3] / g * state[1]
        x = min(max(x, -1e6), 1e6)
        dx = x - state[0]
        v = g * dx + theta[4] * np.sign(dx) - theta[5] * np.tanh(dx)
        return np.array([x, state[0], state[1], v, state[3]])

    began = time.process_time()
    for new_u, new_y in zip(u, y, strict=True):
        past_u, past_y = np.r_[new_u, past_u[:-1]], np.r_[new_y, past_y[:-1]]
        seen += 1
        window = min(p, seen)
        for i in range(window):
            state = before
            for k in range(window - 1, window - 1 - i, -1):
                state = advance(state, past_u[k + 1 :])
            now = window - 1 - i
            dx = state[0] - state[1]
            phi = np.array(
                [past_u[now + 2], past_u[now + 3], -state[1], -state[2], np.sign(dx), -np.tanh(dx), state[4],
                 -past_y[now + 1], -past_y[now + 2]]
            )  # fmt: skip
            g = P @ phi
            g /= 1.0 + phi @ g
            theta = theta + g * (past_y[now] - phi @ theta)
            P = P - np.outer(g, phi @ P)
        if seen >= p:
            before = advance(before, past_u[p:])
    return theta, time.process_time() - began
