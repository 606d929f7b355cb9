"""A chain is its three blocks one after the other."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from whsklearn.effects import FrictionLaw, QuadraticDrag, Viscous, as_law, polynomial_law
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


def test_effects_are_refused_where_they_cannot_be_simulated():
    law, drag = FrictionLaw([Viscous(1.0)]), [QuadraticDrag(0.1)]
    model = ChainModel([0.0, 1.0], [1.0], law, [0.0, 1.0], [1.0], effects=drag)
    assert model.effects == tuple(drag)
    with pytest.raises(ValueError, match="expected it to begin with 1, or with 0, 1"):
        ChainModel([0.0, 0.5], [1.0], law, [0.0, 1.0], [1.0], effects=drag)


@pytest.mark.parametrize(("b1", "b2", "direct"), [([0, 1, 0.4], [0, 1], 0), ([1, 0.4], [0, 1], 1), ([1, 0.4], [1], 2)])
def test_a_direct_path_is_the_systems_own_and_effects_stand_beside_it(b1, b2, direct):
    law = as_law("viscous,coulomb")
    plain = ChainModel(b1, [1.0, -0.5], law, b2, [1.0, -0.3])
    none = ChainModel(b1, [1.0, -0.5], law, b2, [1.0, -0.3], effects=[QuadraticDrag(1e-12)])
    assert none.system().direct == direct
    np.testing.assert_allclose(none.simulate(U), plain.simulate(U), atol=1e-9)
