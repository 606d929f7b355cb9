"""The one-step predictor and its exact gradient."""

from __future__ import annotations

import numpy as np
import pytest

from whsklearn import WienerHammersteinSystem
from whsklearn.effects import (
    AsymmetricCoulomb,
    AsymmetricViscous,
    Coulomb,
    FrictionLaw,
    PositionFriction,
    QuadraticDrag,
    ReducedStribeck,
    Stribeck,
    Viscous,
    reduced_law,
)
from whsklearn.effects.law import polynomial_law, smooth_law
from whsklearn.effects.static import Hinge, Power, Tanh, TanhDifference
from whsklearn.recursion.memory.blocks import increment_rms
from whsklearn.recursion.memory.starts import random_stable, regressors
from whsklearn.recursion.rows.predictor import (
    ROWS,
    parameter_count,
    push,
    record_errors,
    state_size,
)

EVERY_TERM = FrictionLaw(
    [
        Viscous(0.3),
        Coulomb(0.7),
        Tanh(0.4, 0.8),
        TanhDifference(0.5, 0.3, 1.2),
        ReducedStribeck(0.2),
        Stribeck(0.6, 0.9, 1.7),
        QuadraticDrag(0.1),
        AsymmetricCoulomb(0.2),
        AsymmetricViscous(-0.1),
        PositionFriction(0.3, 1.4, 0.5),
        Power(0.2, 2),
        Power(0.1, 0),
        Hinge(0.4, 0.2),
    ]
)
LAWS = {"all": EVERY_TERM, "reduced": reduced_law(), "smooth": smooth_law([0.5, 3.0, 0.6, 0.8, 2.0, 0.1])}
LAWS["polynomial"] = polynomial_law([0.1, 1.0, -0.3, 0.2])


def problem(orders, law, n_inputs=1, n=60, seed=0):
    """dims, a stable theta, u, y and restarts in the middle."""
    rng = np.random.default_rng(seed)
    na, nb, nc, nd = orders
    dims = np.array([na * n_inputs, nb, nc, nd, len(law)], dtype=np.int64)
    theta = np.concatenate(
        [
            rng.normal(0, 0.7, na * n_inputs - 1),
            random_stable(nb, rng) * 0.8 ** np.arange(1, nb + 1),
            law.weights,
            rng.normal(0, 0.5, nc - 1),
            rng.normal(0, 0.3, nd),
        ]
    )
    restart = np.zeros(n, dtype=bool)
    restart[[0, n // 2]] = True
    return dims, theta, rng.standard_normal((n, n_inputs)), rng.standard_normal(n), restart


def errors_of(theta, dims, law, kappa, u, y, restart, gradient=False):
    """Prediction errors and, on demand, psi."""
    errors = np.empty(y.size)
    jacobian = np.zeros((y.size if gradient else 0, theta.size))
    record_errors(theta, dims, law.codes, law.shapes, kappa, u, y, restart, errors, jacobian)
    return errors, jacobian


@pytest.mark.parametrize("n_inputs", [1, 3])
@pytest.mark.parametrize("orders", [(2, 2, 2, 2), (1, 0, 1, 0), (3, 1, 2, 3), (1, 3, 3, 0), (4, 0, 1, 2)])
@pytest.mark.parametrize("law", list(LAWS))
def test_psi_is_the_derivative_of_the_prediction(law, orders, n_inputs):
    law = LAWS[law]
    dims, theta, u, y, restart = problem(orders, law, n_inputs)
    _, psi = errors_of(theta, dims, law, 2.5, u, y, restart, gradient=True)
    h = 1e-6
    numeric = np.empty_like(psi)
    for k in range(theta.size):
        step = np.zeros(theta.size)
        step[k] = h
        above, _ = errors_of(theta + step, dims, law, 2.5, u, y, restart)
        below, _ = errors_of(theta - step, dims, law, 2.5, u, y, restart)
        numeric[:, k] = -(above - below) / (2 * h)
    close = np.isclose(psi, numeric, rtol=1e-5, atol=1e-6 * np.abs(numeric).max())
    assert close.mean() > 0.998  # the difference quotient straddles a kink of Hinge or |dx| now and then
    assert parameter_count(dims) == theta.size


def test_the_innovations_of_the_truth_are_the_noise():
    system = WienerHammersteinSystem.example()
    rng = np.random.default_rng(1)
    u, d = rng.standard_normal(300), 0.3 * rng.standard_normal(300)
    law = system.law
    dims = np.array([2, 2, 2, 2, 3], dtype=np.int64)
    theta = np.concatenate([system.a[1:], system.b, law.weights, system.c[1:], system.d])
    restart = np.arange(300) == 0
    errors, _ = errors_of(theta, dims, law, np.inf, u[:, None], system.simulate(u, d), restart)
    np.testing.assert_allclose(errors, d, atol=1e-12)


def test_an_experiment_does_not_feel_the_one_before():
    law = LAWS["reduced"]
    dims, theta, u, y, restart = problem((2, 2, 2, 2), law)
    together, _ = errors_of(theta, dims, law, 5.0, u, y, restart)
    half = len(y) // 2
    apart = [errors_of(theta, dims, law, 5.0, u[s], y[s], restart[s])[0] for s in (slice(half), slice(half, None))]
    np.testing.assert_array_equal(together, np.concatenate(apart))


def test_with_l1_fixed_the_prediction_is_linear_in_the_products_and_d():
    law = LAWS["all"]
    dims, theta, u, y, restart = problem((2, 2, 3, 2), law, n_inputs=2)
    na, nb, nc, nd, nw = dims
    kappa = 0.5 / increment_rms(theta, dims, u, restart)
    rows = regressors(theta, (dims, law.codes, law.shapes), u, y, restart)
    assert rows.shape == (y.size, nc * nw + nd)
    w = theta[na - 1 + nb : na - 1 + nb + nw]
    c = np.concatenate([[1.0], theta[na - 1 + nb + nw : theta.size - nd]])
    linear = np.concatenate([np.outer(c, w).ravel(), theta[theta.size - nd :]])
    errors, _ = errors_of(theta, dims, law, kappa, u, y, restart)
    np.testing.assert_allclose(y - rows @ linear, errors, atol=1e-12)


def test_push_puts_the_newest_first_one_number_an_input():
    past = np.zeros(6)
    for t in range(1, 4):
        push(past, np.array([t, -t], dtype=float))
    assert past.tolist() == [3, -3, 2, -2, 1, -1]


def test_the_state_does_not_depend_on_the_length_of_the_record():
    dims = np.array([2, 2, 2, 2, 3], dtype=np.int64)
    assert state_size(dims) == 2 * (1 + 3) + 2 * (1 + 3 + 3)
    assert state_size(dims, 4) == 6 * (1 + 3) + 6 * (1 + 3 + 3)


def test_blocks_that_are_longer_than_a_line_are_filters_too():
    """The past of such a block overlaps with where it is put when a line begins anew."""
    rng = np.random.default_rng(0)
    law, nc, u = FrictionLaw([Power(1.0, 1)]), ROWS + 30, rng.standard_normal((400, 1))
    c = rng.standard_normal(nc - 1)
    theta = np.concatenate([[1.0], c])
    y_hat = np.convolve(np.append([0.0, 0.0, 1.0], c), u[:, 0])[:400]  # each block answers a sample later
    restart = np.arange(400) == 0
    errors, psi = errors_of(theta, np.array([1, 0, nc, 0, 1]), law, 1.0, u, np.zeros(400), restart, gradient=True)
    np.testing.assert_allclose(errors, -y_hat, atol=1e-12)
    for m in (1, ROWS, nc - 1):  # d y_hat / d c is x(t - m - 1)
        np.testing.assert_allclose(psi[m + 2 :, m], u[: 398 - m, 0], atol=1e-12)


def test_a_restart_after_some_lines_knows_nothing_of_them():
    dims, theta, u, y, _ = problem((2, 2, 3, 2), LAWS["reduced"], n=400)
    cut = 3 * ROWS + 7
    restart = np.isin(np.arange(400), (0, cut))
    whole = errors_of(theta, dims, LAWS["reduced"], 5.0, u, y, restart)[0]
    parts = [
        errors_of(theta, dims, LAWS["reduced"], 5.0, u[s], y[s], np.arange(y[s].size) == 0)[0]
        for s in (slice(0, cut), slice(cut, None))
    ]
    np.testing.assert_array_equal(whole, np.concatenate(parts))


def test_it_holds_the_last_samples_newest_first():
    past = np.zeros(3)
    for value in (1.0, 2.0, 3.0, 4.0):
        push(past, np.array([value]))
    np.testing.assert_array_equal(past, [4.0, 3.0, 2.0])


def test_several_inputs_stay_together():
    past = np.zeros(4)
    push(past, np.array([1.0, 10.0]))
    push(past, np.array([2.0, 20.0]))
    np.testing.assert_array_equal(past, [2.0, 20.0, 1.0, 10.0])
