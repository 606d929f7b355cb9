"""What must hold for every problem, on problems that Hypothesis draws."""

from __future__ import annotations

import warnings

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.recursion.factors import factorise
from whsklearn import MILSRegressor, RLSRegressor, RMILSRegressor, WienerHammersteinLags
from whsklearn.datasets import make_wiener_hammerstein
from whsklearn.effects import Coulomb, ReducedStribeck, Viscous
from whsklearn.recursion.rows.covariance import covariance, measurement_update
from whsklearn.recursion.rows.least_squares import block_update

PROBLEM = {
    "n": st.integers(1, 8),
    "length": st.integers(1, 60),
    "p": st.integers(1, 7),
    "seed": st.integers(0, 2**32 - 1),
    "log_p0": st.floats(-2, 4),
}
QUICK = settings(max_examples=60)


def regression(n, length, seed):
    rng = np.random.default_rng(seed)
    rows = rng.standard_normal((length, n)) * 10.0 ** rng.uniform(-1, 1, n)
    return rows, rows @ rng.standard_normal(n) + rng.standard_normal(length)


def close(a, b, tolerance=1e-9):
    np.testing.assert_allclose(a, b, rtol=tolerance, atol=tolerance * max(np.abs(b).max(), 1e-300))


@QUICK
@given(**PROBLEM)
def test_with_given_regressors_mils_and_rmils_are_the_block_form_to_the_letter(n, length, p, seed, log_p0):
    """(7)-(9) with a matrix inverse, against (10)-(14) in factorised form: equal by the block inversion lemma."""
    rows, y = regression(n, length, seed)
    theta, P = np.zeros(n), 10.0**log_p0 * np.eye(n)
    for t in range(length):
        window = slice(max(0, t - p + 1), t + 1)
        theta, P = block_update(theta, P, rows[window].T, y[window])
    for kind in (MILSRegressor, RMILSRegressor):
        model = kind(p=p, P0=10.0**log_p0, gradient="pseudolinear").fit(rows, y)
        close(model.theta_, theta, 1e-8)
        close(covariance(model.state_["ud"]), P, 1e-7)


@QUICK
@given(**PROBLEM)
def test_with_given_regressors_mils_and_rmils_agree(n, length, p, seed, log_p0):
    rows, y = regression(n, length, seed)
    for gradient in ("full", "pseudolinear"):
        mils = MILSRegressor(p=p, P0=10.0**log_p0, gradient=gradient).fit(rows, y)
        rmils = RMILSRegressor(p=p, P0=10.0**log_p0, gradient=gradient).fit(rows, y)
        close(mils.theta_, rmils.theta_)
        close(covariance(mils.state_["ud"]), covariance(rmils.state_["ud"]))


@QUICK
@given(st.integers(1, 6), st.integers(1, 6), st.integers(0, 2**32 - 1))
def test_the_block_inversion_lemma(n, p, seed):
    """(P^-1 + phi phi')^-1 by one inverse of p x p, and by p scalar steps."""
    rng = np.random.default_rng(seed)
    root, phi = rng.standard_normal((n, n)), rng.standard_normal((n, p))
    P = root @ root.T + 0.1 * np.eye(n)
    direct = np.linalg.inv(np.linalg.inv(P) + phi @ phi.T)
    close(block_update(np.zeros(n), P, phi, np.zeros(p))[1], direct, 1e-8)
    ud, gain = factorise(P), np.empty(n)
    for i in range(p):
        measurement_update(ud, phi[:, i].copy(), 1.0, gain)
    close(covariance(ud), direct, 1e-8)


@QUICK
@given(**PROBLEM)
def test_the_factors_stay_positive_and_follow_the_plain_form(n, length, p, seed, log_p0):
    rows, _ = regression(n, length, seed)
    ud, plain, gain = 10.0**log_p0 * np.eye(n), 10.0**log_p0 * np.eye(n), np.empty(n)
    for phi in rows:
        measurement_update(ud, phi, float(p), gain)
        g = plain @ phi
        plain = plain - np.outer(g, g) / (p + phi @ g)
    assert (np.diag(ud) > 0).all()
    close(covariance(ud), plain, 1e-7)


@QUICK
@given(cuts=st.lists(st.integers(1, 59), max_size=8), **PROBLEM)
def test_any_chunks_of_rows_give_the_same_state(cuts, n, length, p, seed, log_p0):
    rows, y = regression(n, 60, seed)
    whole = RMILSRegressor(p=p, P0=10.0**log_p0).partial_fit(rows, y)
    parts = RMILSRegressor(p=p, P0=10.0**log_p0)
    for part in np.split(np.arange(60), sorted(set(cuts))):
        parts.partial_fit(rows[part], y[part])
    for name in ("theta", "ud", "loss", "rows", "targets", "since", "seen"):
        np.testing.assert_array_equal(whole.state_[name], parts.state_[name], err_msg=name)


@settings(max_examples=12)
@given(
    cuts=st.lists(st.integers(1, 119), max_size=6),
    seed=st.integers(0, 99),
    gradient=st.sampled_from(["full", "pseudolinear"]),
    memory=st.sampled_from([0, 40]),
    breaks=st.lists(st.integers(1, 119), max_size=3),
)
def test_any_chunks_of_a_dynamic_record_give_the_same_state(cuts, seed, gradient, memory, breaks):
    X, y = make_wiener_hammerstein(120, random_state=seed)
    groups = np.searchsorted(sorted(set(breaks)), np.arange(120), side="right")
    make = {"lags": WienerHammersteinLags(), "n_starts": 2, "gradient": gradient, "memory": memory, "random_state": 0}
    whole = RMILSRegressor(**make).partial_fit(X, y, groups=groups)
    parts = RMILSRegressor(**make)
    for part in np.split(np.arange(120), sorted(set(cuts))):
        parts.partial_fit(X[part], y[part], groups=groups[part])
    for name, value in whole.state_.items():
        np.testing.assert_array_equal(value, parts.state_[name], err_msg=name)


@QUICK
@given(**PROBLEM)
def test_the_order_of_rows_does_not_matter_without_forgetting(n, length, p, seed, log_p0):
    rows, y = regression(n, length, seed)
    order = np.random.default_rng(seed).permutation(length)
    a = RLSRegressor(P0=10.0**log_p0).fit(rows, y)
    b = RLSRegressor(P0=10.0**log_p0).fit(rows[order], y[order])
    close(a.theta_, b.theta_, 1e-7)


@settings(max_examples=15)
@given(st.integers(0, 99), st.floats(0.01, 100.0))
def test_the_estimate_follows_the_unit_of_the_output(seed, unit):
    """With y in other units only the weights of the rows scale."""
    rows, y = regression(4, 50, seed)
    a = RMILSRegressor(P0=1e4).fit(rows, y)
    b = RMILSRegressor(P0=1e4).fit(rows, unit * y)
    close(b.theta_, unit * a.theta_)
    close(b.standard_errors_, unit * a.standard_errors_, 1e-7)


@settings(max_examples=8, deadline=None)
@given(st.integers(-40, 40), st.integers(-40, 40), st.sampled_from([MILSRegressor, RMILSRegressor]), st.booleans())
def test_a_chain_is_the_same_in_any_unit_of_input_and_output(of_input, of_output, kind, knee):
    """Powers of two, which round nothing; the one velocity that a law is given is in the unit of the input."""
    X, y = make_wiener_hammerstein(n_samples=400, snr_db=20, random_state=of_input % 3)
    su, sy = 2.0**of_input, 2.0**of_output

    def fitted(su, sy):
        law = [Viscous(), Coulomb(), *([ReducedStribeck(velocity=su)] if knee else [])]
        return kind(WienerHammersteinLags(law=law), n_starts=6, random_state=0).fit(su * X, sy * y)

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        plain, scaled = fitted(1.0, 1.0), fitted(su, sy)
    away = scaled.predict(su * X) / sy - plain.predict(X)
    assert np.abs(away).max() < 1e-9 * np.std(y)
