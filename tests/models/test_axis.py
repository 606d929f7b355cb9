"""An axis model obeys its torque balance."""

from __future__ import annotations

import numpy as np
import pytest

from whsklearn.effects import Cogging, GravityImbalance, InputOffset, as_law
from whsklearn.models import AxisModel


def test_without_friction_it_is_an_integrator_of_the_drive():
    model = AxisModel(2.0, as_law("viscous").reweighted([1e-12]), dt=0.01, logged="velocity")
    v = model.simulate(np.ones(101))
    assert v[-1] - v[0] == pytest.approx(100 * 0.01 / 2.0, rel=1e-6)


def test_it_settles_where_friction_takes_all_of_the_drive():
    model = AxisModel(0.05, as_law("viscous,coulomb").reweighted([0.5, 0.3]), dt=0.01, logged="velocity")
    assert model.simulate(np.full(2000, 1.3))[-1] == pytest.approx((1.3 - 0.3) / 0.5, rel=1e-3)
    assert model.simulate(np.full(2000, -1.3))[-1] == pytest.approx(-(1.3 - 0.3) / 0.5, rel=1e-3)


def test_below_its_dry_friction_it_stands_and_an_offset_shifts_that():
    law = as_law("coulomb").reweighted([0.3])
    still = AxisModel(0.05, law, dt=0.01, logged="velocity")
    shifted = AxisModel(0.05, law, (InputOffset(-0.2),), dt=0.01, logged="velocity")
    drive = np.full(200, 0.2)
    np.testing.assert_array_equal(still.simulate(drive), 0.0)
    assert shifted.simulate(drive)[-1] > 0.1


def test_a_position_is_the_integral_of_the_velocity():
    law = as_law("viscous")
    drive = np.sin(np.arange(500) / 30)
    position = AxisModel(0.05, law, dt=0.01, logged="position").simulate(drive)
    velocity = AxisModel(0.05, law, dt=0.01, logged="velocity").simulate(drive)
    assert np.corrcoef(np.gradient(position, 0.01), velocity)[0, 1] > 0.999


def test_a_pendulum_falls_from_where_it_starts_to_where_it_rests():
    """A cos(q + phi) = 0 and rising: phi = -pi/2 rests at zero."""
    law = as_law("viscous,coulomb").reweighted([0.2, 0.01])
    model = AxisModel(0.05, law, (GravityImbalance(1.5, phase=-np.pi / 2),), dt=0.005, logged="position")
    for start in (0.8, -1.2):
        q = model.simulate(np.zeros(2000), start=start)
        assert q[0] == start
        assert abs(q[-1]) < 0.02


def test_a_place_a_turn_further_changes_nothing_and_a_part_of_a_turn_does():
    law = as_law("viscous,coulomb").reweighted([0.1, 0.1])
    model = AxisModel(0.05, law, (Cogging(0.3, 6.0),), dt=0.005, logged="position")
    drive = np.sin(np.arange(600) / 40)
    here, turned, shifted = (model.simulate(drive, start=s) - s for s in (0.0, 2 * np.pi, 0.3))
    np.testing.assert_allclose(turned, here, atol=1e-9)
    assert np.abs(shifted - here).max() > 0.01
