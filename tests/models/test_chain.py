"""A chain is its three blocks one after the other."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from whsklearn.effects import FrictionLaw, QuadraticDrag, Viscous, as_law, polynomial_law
from whsklearn.models import ChainModel, LinearModel

U = np.random.default_rng(0).normal(size=200)


def test_it_runs_the_difference_equation_and_adds_its_offset():
    model = LinearModel([0.0, 0.5, 0.1], [1.0, -0.7], offset=2.0)
    y = model.simulate(U)
    t = np.arange(2, 200)
    left = (y - 2.0)[t] - 0.7 * (y - 2.0)[t - 1]
    np.testing.assert_allclose(left, 0.5 * U[t - 1] + 0.1 * U[t - 2], atol=1e-12)


def test_a_position_is_the_integral_of_the_fitted_velocity():
    kwargs = {"numerator": [1.0], "denominator": [1.0, -0.5], "dt": 0.01}
    velocity, position = LinearModel(**kwargs, logged="velocity"), LinearModel(**kwargs, logged="position")
    np.testing.assert_allclose(np.diff(position.simulate(U)) / 0.01, velocity.simulate(U)[1:], atol=1e-9)
    np.testing.assert_allclose(velocity.simulate(U), lfilter([1.0], [1.0, -0.5], U))


def test_kind_follows_the_criterion_and_numbers_have_names():
    model = LinearModel([0.0, 1.0], [1.0, -0.5], criterion="prediction")
    assert (model.kind, LinearModel([1.0], [1.0]).kind) == ("arx", "output_error")
    assert model.parameters == {"b0": 0.0, "b1": 1.0, "f1": -0.5, "offset": 0.0}


@pytest.mark.parametrize(
    "wrong", [{"denominator": [2.0, 1.0]}, {"criterion": "best"}, {"dt": 0.0}, {"logged": "speed"}]
)
def test_what_cannot_be_is_refused(wrong):
    with pytest.raises(ValueError, match="expected"):
        LinearModel(**{"numerator": [1.0], "denominator": [1.0], **wrong})


def test_an_input_that_is_not_finite_is_refused():
    with pytest.raises(ValueError, match="NaN"):
        LinearModel([1.0], [1.0]).simulate([0.0, np.nan])


U_OF_CHAIN = np.random.default_rng(0).normal(size=300)


def test_it_is_filter_law_filter():
    law = polynomial_law([0.0, 1.0, 0.0, 0.3])
    model = ChainModel([0.0, 1.0], [1.0, -0.5], law, [0.0, 1.0, 0.2], [1.0, -0.3])
    x = lfilter([0.0, 1.0], [1.0, -0.5], U_OF_CHAIN)
    np.testing.assert_allclose(
        model.simulate(U_OF_CHAIN), lfilter([0.0, 1.0, 0.2], [1.0, -0.3], x + 0.3 * x**3), atol=1e-10
    )


def test_gain_can_move_between_the_first_block_and_a_linear_law():
    one = ChainModel([0.0, 2.0], [1.0, -0.5], polynomial_law([0.0, 1.0]), [1.0], [1.0])
    other = ChainModel([0.0, 1.0], [1.0, -0.5], polynomial_law([0.0, 2.0]), [1.0], [1.0])
    np.testing.assert_allclose(one.simulate(U_OF_CHAIN), other.simulate(U_OF_CHAIN), atol=1e-12)


def test_dry_friction_sees_the_difference_of_x():
    model = ChainModel([1.0], [1.0], as_law("coulomb"), [1.0], [1.0])
    np.testing.assert_allclose(model.simulate(U_OF_CHAIN)[1:], np.sign(np.diff(U_OF_CHAIN)))


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
    np.testing.assert_allclose(none.simulate(U_OF_CHAIN), plain.simulate(U_OF_CHAIN), atol=1e-9)
