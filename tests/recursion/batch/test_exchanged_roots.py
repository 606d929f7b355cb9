"""Exchange of roots between blocks: what a linear model of the chain sees stays the same."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from whsklearn.recursion.batch.exchanged_roots import exchanged
from whsklearn.recursion.memory.starts import random_start

DIMS = (2, 2, 2, 2, 3)


def polynomials(theta, dims):
    """(numerator, denominator) of the chain of both blocks."""
    na, nb, nc, _, nw = dims
    a, b = theta[: na - 1], theta[na - 1 : na - 1 + nb]
    c0 = na - 1 + nb + nw
    c, d = theta[c0 : c0 + nc - 1], theta[c0 + nc - 1 :]
    one = np.ones(1)
    return np.convolve(np.r_[one, a], np.r_[one, c]), np.convolve(np.r_[one, b], np.r_[one, d])


@given(seed=st.integers(0, 2**32 - 1), dims=st.sampled_from([DIMS, (3, 2, 2, 4, 1), (1, 3, 1, 1, 2), (2, 0, 3, 0, 1)]))
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
    assert any(np.allclose(t, swapped) for t in exchanged(theta, DIMS))


def test_factors_of_different_degree_stay():
    assert exchanged(np.array([0.0, 0.5, 1.0, -0.4]), (1, 2, 1, 1, 1)) == []  # a complex pair and a real pole
