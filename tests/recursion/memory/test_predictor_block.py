"""A segment, signal by signal, is the predictor sample by sample."""

from __future__ import annotations

import numpy as np
import pytest

from tests.recursion.reruns import replay
from tests.recursion.windows import one_sample_on
from whsklearn.effects.codes import ASYMMETRIC_VISCOUS, COULOMB, POSITION_FRICTION, STRIBECK_TANH, VISCOUS
from whsklearn.recursion.memory.gauss_newton import Memory
from whsklearn.recursion.memory.predictor_block import LENGTH, dot, through_denominator
from whsklearn.recursion.memory.starts import random_start
from whsklearn.recursion.rows.predictor import by_block, parameter_count, past_of, predict, state_size

CODES = np.array([VISCOUS, COULOMB, STRIBECK_TANH, ASYMMETRIC_VISCOUS, POSITION_FRICTION])
SHAPES = np.array([[0.0, 0, 0], [0, 0, 0], [0.1, 0, 0], [0, 0, 0], [2.0, 0.3, 0]])


def sample_by_sample(theta, dims, kappa, u, y, restart, n_inputs, history, state, tail):
    """Errors and psi of each sample and the state before the sample that the next window begins with."""
    law = CODES[: dims[4]], SHAPES[: dims[4]]
    errors, rows, n = [], [], restart.size
    u_past = u[:history][::-1].ravel()[: dims[0]]
    y_past = np.append(y[:history][::-1], 0.0)
    before = state.copy()
    for t in range(n):
        if restart[t]:
            state[:], u_past, y_past = 0.0, np.zeros_like(u_past), np.zeros_like(y_past)
        if t <= max(n - tail + 1, 0) or restart[t]:
            before = state.copy()
        psi = np.empty(theta.size)
        past, psi_blocks = past_of(state, 0, dims, 0), by_block(psi, dims)
        errors.append(y[history + t] - predict(by_block(theta, dims), past, 0, y_past, psi, psi_blocks))
        rows.append(psi)
        one_sample_on(by_block(theta, dims), *law, kappa, past, u_past)
        u_past = np.concatenate([u[history + t], u_past])[: dims[0]]
        y_past = np.concatenate([y[history + t : history + t + 1], y_past])[: max(dims[3], 1)]
    return np.array(errors), np.array(rows), state if tail == 1 else before


@pytest.mark.parametrize("n_inputs", [1, 2])
@pytest.mark.parametrize("orders", [(2, 2, 2, 2), (1, 0, 1, 0), (1, 1, 1, 1), (3, 3, 2, 3)])
@pytest.mark.parametrize("kappa", [3.0, np.inf, -30.0])
@pytest.mark.parametrize("tail", [1, 4])
def test_it_is_the_predictor_sample_by_sample(n_inputs, orders, kappa, tail):
    """With any past, experiments that begin anywhere, and more samples than one segment holds."""
    rng = np.random.default_rng([n_inputs, *orders])
    na, nb, nc, nd = orders
    dims = np.array([na * n_inputs, nb, nc, nd, CODES.size])
    theta, history, n = 0.7 * random_start(tuple(dims), rng), max(na, nd, 1), 2 * LENGTH + 17
    u, y = rng.normal(size=(history + n, n_inputs)), rng.normal(size=history + n)
    restart = np.zeros(n, dtype=bool)
    restart[[40, LENGTH, n - 2]] = True
    weights, origin = rng.uniform(size=n), rng.normal(size=state_size(dims))
    size = parameter_count(dims)
    information, slope, end = np.zeros((size, size)), np.zeros(size), np.zeros(origin.size)
    memory = Memory(origin, u, y, restart, n, history, tail, weights)
    cost = replay(theta, (dims, CODES, SHAPES), kappa, memory, information, slope, end)
    e, psi, expected = sample_by_sample(theta, dims, kappa, u, y, restart, n_inputs, history, origin.copy(), tail)
    w = weights * np.minimum(np.arange(n, 0, -1) / tail, 1.0)
    assert cost == pytest.approx(w @ e**2, rel=1e-12)
    np.testing.assert_allclose(slope, psi.T @ (w * e), rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(information, (psi * w[:, None]).T @ psi, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(end, expected, rtol=1e-11, atol=1e-11)


@pytest.mark.parametrize("order", [0, 1, 2, 4])
@pytest.mark.parametrize("count", [1, 3, 4, 6])
def test_a_denominator_undoes_its_polynomial(order, count):
    rng, past, n = np.random.default_rng(order), max(order, 1), 60
    b, signals = rng.uniform(-0.3, 0.3, order), rng.normal(size=(count, past + LENGTH))
    rows, now = signals.copy(), slice(past, past + n)
    for row, signal in zip(rows, signals, strict=True):
        row[now] = np.convolve(signal, np.append(1.0, b))[now]
    through_denominator(rows, b, n)
    np.testing.assert_allclose(rows, signals, rtol=1e-10, atol=1e-12)


def test_an_inner_product_in_any_order_is_the_same_sum():
    a, b = np.random.default_rng(0).normal(size=(2, LENGTH))
    assert dot(a, b) == pytest.approx(a @ b, rel=1e-12)
