"""A chain is its three blocks one after the other."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from whsklearn.effects import as_law, polynomial_law
from whsklearn.models import ChainModel

U = np.random.default_rng(0).normal(size=300)


def test_it_is_filter_law_filter():
    law = polynomial_law([0.0, 1.0, 0.0, 0.3])
    model = ChainModel([0.0, 1.0], [1.0, -0.5], law, [0.0, 1.0, 0.2], [1.0, -0.3])
    x = lfilter([0.0, 1.0], [1.0, -0.5], U)
    np.testing.assert_allclose(model.simulate(U), lfilter([0.0, 1.0, 0.2], [1.0, -0.3], x + 0.3 * x**3), atol=1e-10)


def test_gain_can_move_between_the_first_block_and_a_linear_law():
    one = ChainModel([0.0, 2.0], [1.0, -0.5], polynomial_law([0.0, 1.0]), [1.0], [1.0])
    other = ChainModel([0.0, 1.0], [1.0, -0.5], polynomial_law([0.0, 2.0]), [1.0], [1.0])
    np.testing.assert_allclose(one.simulate(U), other.simulate(U), atol=1e-12)


def test_dry_friction_sees_the_difference_of_x():
    model = ChainModel([1.0], [1.0], as_law("coulomb"), [1.0], [1.0])
    np.testing.assert_allclose(model.simulate(U)[1:], np.sign(np.diff(U)))


def test_a_denominator_begins_with_one():
    with pytest.raises(ValueError, match="begin with 1"):
        ChainModel([1.0], [2.0], as_law("linear"), [1.0], [1.0])
