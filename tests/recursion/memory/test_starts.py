"""Where a search begins."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from whsklearn import WienerHammersteinSystem
from whsklearn.datasets import make_wiener_hammerstein
from whsklearn.effects.law import polynomial_law
from whsklearn.recursion.memory.starts import (
    exchanged,
    least_squares_start,
    random_stable,
    random_start,
    regressors,
    term_scales,
)
from whsklearn.systems.stability import is_stable

ORDERS = (2, 2, 2, 2, 3)


@pytest.mark.parametrize("order", [0, 1, 2, 3, 6])
def test_random_denominators_are_stable(order):
    rng = np.random.default_rng(order)
    for _ in range(200):
        b = random_stable(order, rng)
        assert b.shape == (order,)
        assert is_stable(b, 1.0)


def test_random_starts_have_stable_blocks_and_differ():
    rng = np.random.default_rng(0)
    starts = np.array([random_start(ORDERS, rng) for _ in range(50)])
    assert starts.shape == (50, 9)
    assert all(is_stable(s[1:3].copy(), 1.0) and is_stable(s[7:].copy(), 1.0) for s in starts)
    assert np.unique(starts[:, 0]).size == 50


def test_least_squares_around_the_true_l1_is_the_truth():
    """With L1 right, noise-free and a law without sign, all the rest is linear."""
    system = WienerHammersteinSystem([1.0, 0.5], [-0.6], [1.0, 0.4], [0.2, -0.3], polynomial_law([0.0, 0.8, 0.3, -0.1]))
    truth = np.concatenate([system.a[1:], system.b, system.law.weights, system.c[1:], system.d])
    X, y = make_wiener_hammerstein(300, snr_db=None, random_state=1, system=system)
    law = np.array([2, 1, 2, 2, 3], dtype=np.int64), system.law.codes, system.law.shapes
    wrong = truth.copy()
    wrong[2:] = 7.0
    found = least_squares_start(wrong, law, regressors(wrong, law, X, y, np.arange(300) == 0), y)
    np.testing.assert_allclose(found, truth, rtol=1e-8)


def test_a_start_does_not_depend_on_the_units_of_the_log():
    system = WienerHammersteinSystem.example()
    X, y = make_wiener_hammerstein(300, random_state=2, system=system)
    law = np.array(ORDERS, dtype=np.int64), system.law.codes, system.law.shapes
    restart = np.arange(300) == 0
    scales = [term_scales(law, X, k * y, restart, np.random.default_rng(0)) for k in (1.0, 1000.0)]
    np.testing.assert_allclose(scales[1], 1000.0 * scales[0], rtol=1e-12)
    a, b = (random_start(ORDERS, np.random.default_rng(1), s) for s in scales)
    np.testing.assert_allclose(b[3:6], 1000.0 * a[3:6])
    np.testing.assert_array_equal(np.delete(a, [3, 4, 5]), np.delete(b, [3, 4, 5]))


def test_poles_are_exchanged_by_pairs_and_numerators_with_them():
    first, second = np.array([-1.8, 0.9]), np.array([-1.0, 0.5])  # a complex pair each
    theta = np.concatenate([[0.3], first, [1.0, 2.0, 3.0], [-0.4], second])
    l1 = [start[:3] for start in exchanged(theta, ORDERS)]
    expected = [np.append(-0.4, first), np.append(0.3, second), np.append(-0.4, second)]
    np.testing.assert_allclose(sorted(l1, key=tuple), sorted(expected, key=tuple))
    theta = np.concatenate([[0.3], first, [1.0], [-0.5]])  # L2 has one real pole, which is no pair
    assert exchanged(theta, (2, 2, 1, 1, 1)) == []
    theta = np.concatenate([[-0.5], [1.0], second])
    assert exchanged(theta, (1, 1, 1, 2, 1)) == []


def polynomials(theta, dims):
    """(numerator, denominator) of the chain of both blocks."""
    na, nb, nc, _, nw = dims
    a, b = theta[: na - 1], theta[na - 1 : na - 1 + nb]
    c0 = na - 1 + nb + nw
    c, d = theta[c0 : c0 + nc - 1], theta[c0 + nc - 1 :]
    one = np.ones(1)
    return np.convolve(np.r_[one, a], np.r_[one, c]), np.convolve(np.r_[one, b], np.r_[one, d])


@given(
    seed=st.integers(0, 2**32 - 1), dims=st.sampled_from([ORDERS, (3, 2, 2, 4, 1), (1, 3, 1, 1, 2), (2, 0, 3, 0, 1)])
)
def test_the_chain_has_the_same_poles_and_zeros(seed, dims):
    theta = random_start(dims, np.random.default_rng(seed))
    before = polynomials(theta, dims)
    for other in exchanged(theta, dims):
        for p, q in zip(before, polynomials(other, dims), strict=True):
            np.testing.assert_allclose(p, q, atol=1e-8 * max(1.0, np.abs(p).max()))
        w0 = dims[0] - 1 + dims[1]
        np.testing.assert_array_equal(other[w0 : w0 + dims[4]], theta[w0 : w0 + dims[4]])


def test_blocks_that_changed_places_are_found():
    theta = np.array([0.5, -0.2, 0.3, 1.0, 2.0, 3.0, -0.8, -1.2, 0.7])
    swapped = np.array([-0.8, -1.2, 0.7, 1.0, 2.0, 3.0, 0.5, -0.2, 0.3])
    assert any(np.allclose(t, swapped) for t in exchanged(theta, ORDERS))


@pytest.mark.parametrize("reals", [(0.9, 0.2), (0.9, 0.2, -0.5)])
def test_a_pair_changes_places_with_any_two_real_poles(reals):
    pair, kept = np.array([1.0, -1.9, 0.95]), reals[2:]
    theta = np.r_[0.3, np.poly(reals)[1:], 1.0, -0.4, pair[1:]]  # the resonance belongs to L1
    swapped = np.r_[np.convolve(pair, np.poly(kept))[1:], np.poly(reals[:2])[1:]]
    found = [np.r_[t[1 : 1 + len(reals)], t[-2:]] for t in exchanged(theta, (2, len(reals), 2, 2, 1))]
    assert any(np.allclose(t, swapped) for t in found)


def test_factors_of_different_degree_stay():
    assert exchanged(np.array([0.0, 0.5, 1.0, -0.4]), (1, 2, 1, 1, 1)) == []  # a complex pair and a real pole
