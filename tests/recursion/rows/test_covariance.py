"""P = U D U' and its rank-one update."""

from __future__ import annotations

import numpy as np
import pytest

from tests.recursion.factors import factorise
from whsklearn.recursion.rows.covariance import (
    FARTHEST,
    conditioned,
    covariance,
    factors_of_inverse,
    inflate,
    measurement_update,
    times,
)


def random_covariance(n, seed, log_condition=3):
    rng = np.random.default_rng(seed)
    q = np.linalg.qr(rng.standard_normal((n, n)))[0]
    return (q * np.logspace(0, -log_condition, n)) @ q.T


@pytest.mark.parametrize("n", [1, 2, 9])
def test_factors_lead_back_to_p(n):
    p = random_covariance(n, n)
    ud = factorise(p)
    np.testing.assert_allclose(covariance(ud), p, rtol=1e-12, atol=1e-15)
    assert (np.diag(ud) > 0).all()
    assert not np.triu(ud, 1).any()


@pytest.mark.parametrize("n", [1, 3, 9])
@pytest.mark.parametrize("r", [1.0, 4.0])
def test_the_update_is_twelve_and_thirteen(n, r):
    p, phi = random_covariance(n, 7), np.random.default_rng(n).standard_normal(n)
    ud, gain = factorise(p), np.empty(n)
    alpha = measurement_update(ud, phi, r, gain)
    s = r + phi @ p @ phi
    assert alpha == pytest.approx(s)
    np.testing.assert_allclose(gain, p @ phi / s, rtol=1e-10)
    np.testing.assert_allclose(covariance(ud), p - np.outer(p @ phi, p @ phi) / s, rtol=1e-9, atol=1e-14)


def test_updates_add_up_as_information():
    rng = np.random.default_rng(0)
    rows, ud, gain = rng.standard_normal((200, 5)), np.eye(5) * 1e3, np.empty(5)
    for phi in rows:
        measurement_update(ud, phi, 2.0, gain)
    np.testing.assert_allclose(np.linalg.inv(covariance(ud)), np.eye(5) / 1e3 + rows.T @ rows / 2.0, rtol=1e-9)


def test_a_row_of_zeros_changes_nothing():
    ud, gain = factorise(random_covariance(4, 1)), np.empty(4)
    before = ud.copy()
    assert measurement_update(ud, np.zeros(4), 1.0, gain) == 1.0
    np.testing.assert_array_equal(ud, before)
    assert not gain.any()


def test_inflation_is_by_d_alone():
    p = random_covariance(4, 2)
    ud = factorise(p)
    inflate(ud, 1.25, np.inf)
    np.testing.assert_allclose(covariance(ud), 1.25 * p, rtol=1e-12)


def test_inflation_ends_at_the_ceiling_and_takes_nothing_away():
    ud = np.diag([0.5, 3.0, 20.0])
    for _ in range(1000):
        inflate(ud, 1.1, 10.0)
    assert np.diag(ud).tolist() == [10.0, 10.0, 20.0]


def test_p_stays_positive_where_the_plain_form_does_not():
    """Rows with forgetting, and (9) as it stands loses symmetry and then its sign."""
    rng = np.random.default_rng(3)
    n = 6
    ud, plain, gain = np.eye(n) * 1e6, np.eye(n) * 1e6, np.empty(n)
    lost = False
    for _ in range(2_000):
        phi = np.ones(n) + 0.1 * rng.standard_normal(n)
        inflate(ud, 1 / 0.95, np.inf)
        measurement_update(ud, phi, 1.0, gain)
        if not lost:
            plain /= 0.95
            g = plain @ phi
            plain = plain - np.outer(g / (1.0 + phi @ g), g)
            lost = np.linalg.eigvalsh((plain + plain.T) / 2).min() <= 0
    assert (np.diag(ud) > 0).all()
    assert np.isfinite(ud).all()
    assert lost


@pytest.mark.parametrize("n", [1, 4, 11])
def test_factors_of_an_information_matrix_are_those_of_its_inverse_whatever_the_units(n):
    units = 10.0 ** np.linspace(-9, 9, n)
    p = random_covariance(n, n) * np.outer(units, units)
    ud, v = factors_of_inverse(np.linalg.inv(p)), np.arange(1.0, n + 1) / units
    np.testing.assert_allclose(covariance(ud) / np.outer(units, units), random_covariance(n, n), rtol=1e-8)
    np.testing.assert_allclose(times(ud, v) / units, p @ v / units, rtol=1e-8)


def test_what_a_record_says_nothing_of_is_uncertain_and_not_infinite():
    row = np.array([1.0, 2.0, 0.0])
    p = covariance(factors_of_inverse(np.outer(row, row)))
    assert np.isfinite(p).all()
    assert p[2, 2] > 1e10
    assert row @ p @ row == pytest.approx(1.0, abs=1e-2)


def test_the_least_pivot_bends_nothing_that_the_record_tells():
    p = random_covariance(4, 4, log_condition=8)
    np.testing.assert_allclose(covariance(factors_of_inverse(np.linalg.inv(p))), p, rtol=1e-4, atol=1e-12)


def test_a_known_weight_is_one_more_row():
    rng = np.random.default_rng(0)
    rows, y = rng.normal(size=(20, 4)), rng.normal(size=20)
    one = np.array([0.0, 0.0, 1.0, 0.0])
    theta, p = np.linalg.lstsq(rows, y, rcond=None)[0], np.linalg.inv(rows.T @ rows)
    for deviation in (1e-6, 0.3, 1e6):
        information = rows.T @ rows + np.outer(one, one) / deviation**2
        both = np.linalg.solve(information, rows.T @ y + one * (theta[2] + deviation) / deviation**2)
        got = conditioned(theta, p, 2, theta[2] + deviation, deviation)
        np.testing.assert_allclose(got[0], both, rtol=1e-9, atol=1e-12)
        np.testing.assert_allclose(got[1], np.linalg.inv(information), rtol=1e-6, atol=1e-12)


def test_rows_do_not_take_a_known_weight_far_away_and_the_others_follow():
    p, far = random_covariance(4, 1), np.array([1.0, 2.0, 300.0, 4.0])
    theta = conditioned(far, p, 2, 0.0, 2.0)[0]
    assert theta[2] == pytest.approx(2.0 * FARTHEST)
    np.testing.assert_allclose((theta - far) / (theta - far)[2], p[:, 2] / p[2, 2], rtol=1e-12)
    unknown = np.full((4, 4), np.nan)
    assert conditioned(far, unknown, 2, 0.0, 2.0)[0] is far
