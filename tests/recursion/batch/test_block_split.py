"""All ways to divide a ratio between two blocks multiply back to it."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.signal import freqz

from whsklearn.recursion.batch.best_linear import Ratio
from whsklearn.recursion.batch.block_split import Orders, divisions, exchanged, padded, reflections
from whsklearn.recursion.memory.starts import random_start

RATIO = Ratio(np.poly([0.3, 0.5 + 0.2j, 0.5 - 0.2j]).real, np.poly([0.9, 0.7 + 0.4j, 0.7 - 0.4j, -0.2]).real)


def test_every_division_multiplies_back_to_the_ratio():
    ways = list(divisions(RATIO, Orders(3, 3, 3, 3)))
    assert len(ways) > 4
    for first, second in ways:
        np.testing.assert_allclose(np.trim_zeros(np.convolve(first.b, second.b)), RATIO.b, atol=1e-9)
        np.testing.assert_allclose(np.convolve(first.a, second.a), RATIO.a, atol=1e-9)
        assert np.isrealobj(first.a)  # conjugate pairs were kept together


def test_no_block_gets_more_than_it_can_hold():
    for first, second in divisions(RATIO, Orders(1, 2, 2, 2)):
        assert (first.b.size - 1, first.a.size - 1) <= (1, 2)
        assert second.a.size - 1 <= 2
    assert not list(divisions(RATIO, Orders(0, 1, 0, 1)))


def test_a_pair_that_no_block_can_hold_becomes_two_real_roots():
    ratio = Ratio(np.poly([-0.5 + 0.3j, -0.5 - 0.3j]).real, np.poly([0.6 + 0.3j, 0.6 - 0.3j, 0.7, 0.1]).real)
    ways = list(divisions(ratio, Orders(1, 2, 1, 2)))
    assert ways
    for block in (b for way in ways for b in way):
        np.testing.assert_allclose(block.b, [1.0, 0.5])
        assert block.a.size == 3
    odd = Ratio(np.ones(1), np.poly([0.6 + 0.3j, 0.6 - 0.3j]).real)
    for first, second in divisions(odd, Orders(0, 1, 0, 1)):
        np.testing.assert_allclose([*first.a, *second.a], [1.0, -0.6, 1.0, -0.6])


@pytest.mark.parametrize("size", [3, 5])
def test_padding_does_not_change_the_ratio(size):
    block = Ratio(np.array([1.0, 0.5]), np.array([1.0, -0.3]))
    wide = padded(block, size, size)
    assert wide.b.size == wide.a.size == size + 1
    np.testing.assert_array_equal(np.trim_zeros(wide.b), block.b)
    np.testing.assert_array_equal(np.trim_zeros(wide.a), block.a)


@pytest.mark.parametrize("lead", [0, 2])
def test_a_reflected_zero_changes_the_phase_and_not_the_gain(lead):
    b = np.concatenate([np.zeros(lead), -2.0 * RATIO.b, [0.0]])
    found = reflections(b)
    assert len(found) == 2  # a real zero and a pair
    for image in found:
        assert image.size == b.size
        _, before = freqz(b)
        _, after = freqz(image)
        np.testing.assert_allclose(np.abs(after), np.abs(before), rtol=1e-9)
        assert np.max(np.abs(np.angle(after / before))) > 0.1
        assert any(np.allclose(back, b) or np.allclose(back, -b) for back in reflections(image))


def test_a_numerator_without_zeros_has_no_reflection():
    assert reflections(np.array([0.0, 2.0])) == reflections(np.zeros(2)) == []


# --- Exchange of roots between blocks: what a linear model of the chain sees stays the same -------------------------
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
