"""An axis as the vector of the free-run kernel."""

from __future__ import annotations

import numpy as np
import pytest

from whsklearn.effects import CableSpring, Cogging, GravityImbalance
from whsklearn.identification.axis_numbers import position_effects, position_weights
from whsklearn.recursion.batch.axis_free_run import HANGS, AxisForm

Q = np.linspace(-2.0, 2.0, 41)


@pytest.mark.parametrize("weights", [[0.7], [0.7, -0.2, 0.4], [-0.3, 0.1, -0.5], [0.7, 0.0, 0.0]])
def test_a_cubic_of_the_position_is_a_spring_and_a_hardening_one(weights):
    form = AxisForm(powers=len(weights))
    constant, effects = position_effects(np.array(weights), form)
    torque = constant + sum(e.value(position=Q) for e in effects)
    np.testing.assert_allclose(torque, sum(w * Q ** (k + 1) for k, w in enumerate(weights)), atol=1e-12)
    back, taken = position_weights(effects)
    np.testing.assert_allclose(back, weights)
    assert taken == pytest.approx(-constant)


def test_sine_and_cosine_of_the_position_are_gravity_and_those_of_its_multiples_cogging():
    weights, orders = np.array([0.3, -0.8, -0.1, 0.2]), np.array([1.0, 7.5])
    constant, effects = position_effects(weights, AxisForm(orders=orders))
    assert constant == 0.0
    assert [type(e) for e in effects] == [GravityImbalance, Cogging]
    waves = [f(k * Q) for k in orders for f in (np.sin, np.cos)]
    np.testing.assert_allclose(sum(e.value(position=Q) for e in effects), weights @ waves, atol=1e-12)
    np.testing.assert_allclose(position_weights(effects)[0], weights)


def test_no_effect_has_no_weight():
    assert position_weights([]) == ([], 0.0)
    assert position_weights([CableSpring(0.4)]) == ([0.4], 0.0)
    assert isinstance(position_effects(np.array([0.0, 1.0]), AxisForm(orders=HANGS))[1][0], GravityImbalance)
