"""All ways to divide a ratio between two blocks multiply back to it."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import freqz

from whsklearn.recursion.batch.best_linear import Ratio
from whsklearn.recursion.batch.block_split import Orders, divisions, padded, reflections

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
