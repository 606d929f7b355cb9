"""The published reading: rows of (6), the auxiliary model, and block against sub-innovations."""

from __future__ import annotations

import numpy as np
import pytest

from whsklearn import WienerHammersteinLags, WienerHammersteinSystem
from whsklearn.datasets import make_wiener_hammerstein
from whsklearn.effects.friction import Coulomb, Viscous
from whsklearn.effects.law import FrictionLaw, polynomial_law, reduced_law
from whsklearn.recursion.rows.covariance import covariance
from whsklearn.recursion.rows.least_squares import block_update
from whsklearn.recursion.rows.pseudolinear import (
    BLOCK,
    GRADIENT,
    REEVALUATED,
    Published,
    auxiliary_size,
    run_pseudolinear,
)
from whsklearn.recursion.rows.subinnovations import Samples

SYSTEMS = {
    "example": WienerHammersteinSystem.example(),
    "hammerstein": WienerHammersteinSystem([1.0], [], [1.0, 0.3], [0.2, -0.3], polynomial_law([0.0, 1.0, -0.4])),
    "wiener": WienerHammersteinSystem([1.0, 0.5], [-0.4], [1.0], [], reduced_law()),
    "key last": WienerHammersteinSystem(
        [1.0, 0.5], [-0.4, 0.2], [1.0, 0.2], [0.1], FrictionLaw([Coulomb(0.5), Viscous(0.3)])
    ),
    "viscous, n_b = 0": WienerHammersteinSystem([1.0, 0.5], [], [1.0, 0.2], [0.1], reduced_law()),
}


def run(system, X, y, mode, p=3, theta0=None, p0=1e6, forgetting=1.0):
    """theta, P and the auxiliary state after the record."""
    law = system.law
    dims = np.array([system.a.size, system.b.size, system.c.size, system.d.size, len(law)], dtype=np.int64)
    theta = np.full(system.theta.size, 0.01) if theta0 is None else theta0.copy()
    lags = p + max(system.a.size + 1, system.d.size, 1)
    state = np.zeros(auxiliary_size(dims))
    ud, loss, power = np.eye(theta.size) * p0, np.zeros(2), np.zeros(1)
    run_pseudolinear(
        Published(theta, ud, state, loss, power), Samples(np.zeros(lags), np.zeros(lags), np.ones(lags)), 0,
        forgetting, np.inf, (dims, law.codes, law.shapes, law.key), p, mode, Samples(X, y, np.ones(len(y))),
    )  # fmt: skip
    return theta, covariance(ud), state


@pytest.mark.parametrize("name", list(SYSTEMS))
@pytest.mark.parametrize("mode", [BLOCK, REEVALUATED])
def test_the_truth_is_a_fixed_point(name, mode):
    """On noise-free data every innovation of the true theta is zero, so nothing moves."""
    system = SYSTEMS[name]
    X, y = make_wiener_hammerstein(200, snr_db=None, random_state=0, system=system)
    theta, _, _ = run(system, X, y, mode, theta0=system.theta)
    np.testing.assert_allclose(theta, system.theta, rtol=1e-7, atol=1e-8)


@pytest.mark.parametrize("name", list(SYSTEMS))
def test_least_squares_on_the_true_rows_finds_the_truth(name):
    system = SYSTEMS[name]
    X, y, truth = make_wiener_hammerstein(400, snr_db=None, random_state=1, system=system, return_truth=True)
    lags = WienerHammersteinLags(
        system.a.size, system.b.size, system.c.size, system.d.size, law=system.law, theta=truth.theta
    )
    rows = lags.fit_transform(X, y)
    np.testing.assert_allclose(rows @ truth.theta, y, atol=1e-10)


def test_the_auxiliary_model_at_the_truth_is_the_system():
    X, y, truth = make_wiener_hammerstein(50, snr_db=10, random_state=2, return_truth=True)
    p = 3
    _, _, state = run(truth.system, X, y, BLOCK, p=p, theta0=truth.theta, p0=1e-12)
    # state: x(t-1), x(t-2), x(t-3) and v(t-1), v(t-2) before the window's first sample
    np.testing.assert_allclose(state, [*truth.x[-p:][0:1], *truth.x[-p - 1 : -p - 3 : -1], *truth.v[[-p, -p - 1]]])


def test_the_block_mode_is_seven_to_nine_on_its_own_rows():
    """Rows at theta(t-1) from the auxiliary model, then the literal block update."""
    system = SYSTEMS["wiener"]
    X, y = make_wiener_hammerstein(60, snr_db=10, random_state=3, system=system)
    p, n = 4, system.theta.size
    theta, P = np.full(n, 0.05), np.eye(n)
    for t in range(len(y)):
        if t < p:  # before any theta has entered the stored state, the lags rebuild it from rest
            rows = WienerHammersteinLags(2, 1, 1, 0, law=system.law, theta=theta).fit_transform(X[: t + 1], y[: t + 1])
            theta, P = block_update(theta, P, rows[-p:].T, y[: t + 1][-p:])
    got, got_P, _ = run(system, X[:p], y[:p], BLOCK, p=p, theta0=np.full(n, 0.05), p0=1.0)
    np.testing.assert_allclose(got, theta, rtol=1e-9)
    np.testing.assert_allclose(got_P, P, rtol=1e-9)


def test_block_and_sub_innovations_differ_only_by_rebuilt_rows():
    """Hammerstein with L2 = 1/A: no row depends on theta, so both are the same numbers."""
    law = polynomial_law([0.0, 1.0, 0.3])
    system = WienerHammersteinSystem([1.0], [], [1.0], [0.3, 0.1], law)
    X, y = make_wiener_hammerstein(150, snr_db=10, random_state=4, system=system)
    dependent = SYSTEMS["example"]
    X5, y5 = make_wiener_hammerstein(150, snr_db=10, random_state=4)
    block, P_block, _ = run(system, X, y, BLOCK)
    # the key term alone still needs x_hat = u(t-1), which theta does not enter
    sub, P_sub, _ = run(system, X, y, REEVALUATED)
    np.testing.assert_allclose(block, sub, rtol=1e-9)
    np.testing.assert_allclose(P_block, P_sub, rtol=1e-9)
    assert not np.allclose(run(dependent, X5, y5, BLOCK)[0], run(dependent, X5, y5, REEVALUATED)[0])


@pytest.mark.parametrize("mode", [BLOCK, REEVALUATED, GRADIENT])
def test_interim_estimates_never_leave_the_numbers(mode):
    rng = np.random.default_rng(5)
    X, y = 1e6 * rng.standard_normal((300, 1)), 1e6 * rng.standard_normal(300)
    theta, P, state = run(SYSTEMS["example"], X, y, mode, forgetting=0.9)
    assert np.isfinite(theta).all()
    assert np.isfinite(P).all()
    assert np.isfinite(state).all()


# --- The auxiliary model rebuilds x and v of the true system where theta is the true one ----------------------------
def test_regressors_at_the_true_parameters_predict_the_output():
    X, y, truth = make_wiener_hammerstein(300, snr_db=None, random_state=0, return_truth=True)
    phi = WienerHammersteinLags(theta=truth.theta).fit_transform(X, y)
    np.testing.assert_allclose((phi @ truth.theta)[10:], y[10:], atol=1e-9)


def test_columns_are_the_true_signals_with_their_lags():
    X, y, truth = make_wiener_hammerstein(100, snr_db=None, random_state=1, return_truth=True)
    lags = WienerHammersteinLags(theta=truth.theta)
    names = list(lags.fit(X, y).get_feature_names_out())
    phi = lags.fit_transform(X, y)
    t = np.arange(20, 100)
    np.testing.assert_allclose(phi[t, names.index("-x_hat(k-2)")], -truth.x[t - 2], atol=1e-9)
    np.testing.assert_allclose(phi[t, names.index("u(k-2)")], X[t - 2, 0])


def test_its_state_holds_the_lags_of_x_and_v():
    assert auxiliary_size(np.array([2, 2, 2, 2, 3])) == 3 + 2
    assert auxiliary_size(np.array([1, 0, 1, 0, 1])) == 2 + 1
