"""Standstill, limit cycles and the order of convergence of the integrator."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from whsklearn.effects import (
    AsymmetricCoulomb,
    Cogging,
    Coulomb,
    FlexibleCoupling,
    PreslidingHysteresis,
    Stribeck,
    Viscous,
)
from whsklearn.systems import PIDController, ServoAxis


def test_stands_still_within_the_band_of_stiction_and_leaves_at_its_end():
    axis = ServoAxis(0.05, [Coulomb(0.3), Stribeck(0.1, 0.05)])
    drive = np.linspace(0.0, 0.5, 5001)
    for sign in (1.0, -1.0):
        record = axis.simulate_drive(sign * drive)
        leaves = np.flatnonzero(record.velocity)[0]
        assert drive[leaves] == pytest.approx(0.4, abs=2e-4)
        assert not record.true_position[:leaves].any(), "no creep"


def test_tanh_friction_creeps_where_stiction_holds():
    axis = ServoAxis(0.05, [Coulomb(0.3)], friction="tanh", smoothing=0.01)
    record = axis.simulate_drive(np.full(5000, 0.15))
    assert record.velocity[-1] == pytest.approx(0.01 * np.arctanh(0.5), rel=1e-3)


def test_asymmetric_friction_shifts_the_band():
    axis = ServoAxis(0.05, [Coulomb(0.3), AsymmetricCoulomb(0.1)])
    assert not axis.simulate_drive(np.full(500, 0.39)).velocity.any()
    assert axis.simulate_drive(np.full(500, 0.41)).velocity[-1] > 0
    assert not axis.simulate_drive(np.full(500, -0.19)).velocity.any()
    assert axis.simulate_drive(np.full(500, -0.21)).velocity[-1] < 0


def test_presliding_is_a_spring_that_returns():
    axis = ServoAxis(0.05, [Viscous(0.5)], [PreslidingHysteresis(0.3, 0.01)])
    record = axis.simulate_drive(0.06 * np.interp(np.arange(8000), [0, 4000, 8000], [0, 1, 0]))
    loaded = -0.01 * np.log(1 - 0.06 / 0.3)
    back = 0.01 * np.log(1 + 0.06 / 0.3)  # the way back starts 1.2 from the other end of the loop
    assert record.true_position[4000] == pytest.approx(loaded, rel=0.02)
    assert record.true_position[-1] == pytest.approx(loaded - back, rel=0.1)


def test_stick_slip_on_a_moving_spring_jumps_as_far_as_the_formula():
    """A mass pulled by a spring whose end moves at V; dF is the drop from static to Coulomb friction.

    In slip x = V t - V/w sin(w t) + dF/k (1 - cos(w t)) with w^2 = k/J, and it ends where
    dx/dt = 0, at tan(w t / 2) = -dF w / (k V); for a slow end that is 2 dF / k.
    """
    axis = ServoAxis(
        0.05,
        [Coulomb(0.2), Stribeck(0.1, 1e-4, 2.0)],
        controller=PIDController(kp=5.0, ki=0.0, kd=0.0),
        substeps=40,
    )
    reference = 0.01 * np.arange(30_000) / 1000
    record = axis.simulate(reference)
    jumps = np.diff(record.true_position[np.flatnonzero(np.diff((record.velocity == 0.0).astype(int)) == 1) + 1])
    assert jumps.size >= 4
    w, drop, speed = np.sqrt(5.0 / 0.05), 0.1 / 5.0, 0.01
    angle = 2 * (np.pi - np.arctan(drop * w / speed))
    slip = speed / w * (angle - np.sin(angle)) + drop * (1 - np.cos(angle))
    np.testing.assert_allclose(jumps, slip, rtol=0.01)


def test_stick_slip_needs_the_drop():
    axis = ServoAxis(0.05, [Coulomb(0.3)], controller=PIDController(kp=5.0, ki=0.0, kd=0.5))
    record = axis.simulate(0.01 * np.arange(30_000) / 1000)
    assert np.std(record.velocity[15_000:]) < 1e-6


def test_integral_action_hunts_with_static_friction_above_coulomb_and_rests_without_drop():
    controller = PIDController(kp=10.0, ki=20.0, kd=1.0, derivative_filter=0.0)
    reference = np.full(60_000, 0.1)
    hunting = ServoAxis(0.05, [Coulomb(0.2), Stribeck(0.1, 0.01)], controller=controller)
    late = hunting.simulate(reference, initial_position=0.0).true_position[30_000:] - 0.1
    assert np.sum(np.diff(np.sign(late)) != 0) >= 4, "the error keeps changing sign"
    calm = dataclasses.replace(hunting, law=as_coulomb(0.3))
    assert np.ptp(calm.simulate(reference, initial_position=0.0).true_position[30_000:]) < 0.1 * np.ptp(late)


def as_coulomb(torque):
    """A law of dry friction alone."""
    from whsklearn.effects import FrictionLaw

    return FrictionLaw([Coulomb(torque)])


SMOOTH = {
    "viscous": ServoAxis(law=[Viscous(0.3)]),
    "tanh": ServoAxis(friction="tanh", smoothing=0.02),
    "cogging": ServoAxis(law=[Viscous(0.12)], effects=[Cogging(0.1, 17)]),
    "two masses": ServoAxis(law=[Viscous(0.12)], effects=[FlexibleCoupling(1e-2)]),
    "dry": ServoAxis(law=[Viscous(0.12), Coulomb(0.3)]),
    "stribeck": ServoAxis(law=[Viscous(0.12), Coulomb(0.3), Stribeck(0.1, 0.1)]),
}


@pytest.mark.parametrize("name", list(SMOOTH))
def test_order_of_convergence_is_two(name):
    t = np.arange(1000) / 1000
    drive = 0.8 * np.sin(2 * np.pi * 1.1 * t) + 0.3 * np.sin(2 * np.pi * 3 * t)
    steps = np.array([5, 10, 20, 40])
    exact = dataclasses.replace(SMOOTH[name], substeps=1280).simulate_drive(drive).true_position
    error = [
        np.sqrt(
            np.mean(
                (dataclasses.replace(SMOOTH[name], substeps=int(n)).simulate_drive(drive).true_position - exact) ** 2
            )
        )
        for n in steps
    ]
    order = -np.polyfit(np.log(steps), np.log(error), 1)[0]
    assert order > 1.7
    assert error[-1] < 1e-7
