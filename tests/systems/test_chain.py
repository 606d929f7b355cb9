"""The chain with effects: identities, limits and agreement with the law's own terms."""

from __future__ import annotations

import numpy as np
import pytest

from whsklearn import WienerHammersteinSystem
from whsklearn import effects as fx
from whsklearn.effects.hysteresis import N_STATES
from whsklearn.systems.chain_ports import coupled

BLOCKS = {"a": [1.0, 2.2], "b": [1.0, 0.5], "c": [1.0, 0.2], "d": [0.15, 0.4]}


@pytest.fixture(scope="module")
def u():
    return np.random.default_rng(3).normal(size=400)


def system(*effects, law=None, dt=1.0):
    return WienerHammersteinSystem(**BLOCKS, law=law, effects=effects, dt=dt)


@pytest.mark.parametrize(
    "nothing",
    [
        fx.InputOffset(0.0), fx.DeadZone(0.0), fx.Saturation(float("inf")), fx.InputDelay(0.0), fx.ActuatorLag(0.0),
        fx.TorqueRipple(0.0), fx.Backlash(0.0), fx.Cogging(0.0), fx.GravityImbalance(0.0), fx.CableSpring(0.0),
        fx.HardeningSpring(0.0), fx.EndStop(0.0), fx.OutputOffset(0.0), fx.OutputDrift(0.0),
        fx.SensorRectification(0.0), fx.EncoderEccentricity(0.0),
        fx.Quantization(0.0), fx.DisturbanceTone(0.0), fx.ParameterChange(0.0, 3.0),
        fx.AsymmetricCoulomb(0.0), fx.QuadraticDrag(0.0), fx.Stribeck(0.0), fx.LoadFriction(0.0), fx.FrictionDrift(0.0),
        fx.PositionFriction(0.0), fx.PreslidingHysteresis(0.0), fx.LuGre(0.0),
    ],
    ids=lambda e: e.name,
)  # fmt: skip
def test_an_effect_of_no_size_changes_nothing(u, nothing):
    np.testing.assert_allclose(system(nothing).simulate(u), system().simulate(u), atol=1e-12)


@pytest.mark.parametrize("extra", [fx.QuadraticDrag(0.1), fx.AsymmetricViscous(0.2), fx.Stribeck(0.3, 0.5, 2.0)])
def test_a_static_effect_is_a_term_of_the_law(u, extra):
    law = [*system().law.terms, extra]
    np.testing.assert_allclose(system(extra).simulate(u), system(law=law).simulate(u), atol=1e-12)


def test_a_cable_spring_is_linear_in_x(u):
    law = [*system().law.terms, fx.Power(0.4, 1.0)]
    np.testing.assert_allclose(system(fx.CableSpring(0.4)).simulate(u), system(law=law).simulate(u), atol=1e-12)


def test_a_delay_of_whole_samples_shifts_the_output(u):
    late = system(fx.InputDelay(0.03), dt=0.01).simulate(u)
    np.testing.assert_allclose(late[3:], system().simulate(u)[:-3], atol=1e-12)
    assert np.all(late[:4] == 0.0)


def test_a_drive_effect_acts_as_on_the_input_itself(u):
    dead = system(fx.DeadZone(0.3)).simulate(u)
    np.testing.assert_allclose(dead, system().simulate(u - np.clip(u, -0.3, 0.3)), atol=1e-12)
    cut = system(fx.Saturation(0.8)).simulate(u)
    np.testing.assert_allclose(cut, system().simulate(np.clip(u, -0.8, 0.8)), atol=1e-12)


def test_an_input_offset_leaves_a_law_of_velocity_alone_after_the_transient(u):
    apart = system(fx.InputOffset(0.5)).simulate(u) - system().simulate(u)
    assert np.abs(apart[:10]).max() > 1e-3
    assert np.abs(apart[200:]).max() < 1e-9


def test_sensor_effects_act_on_the_output(u):
    y = system().simulate(u)
    np.testing.assert_allclose(system(fx.OutputOffset(2.0)).simulate(u), y + 2.0)
    np.testing.assert_allclose(system(fx.OutputDrift(0.5), dt=0.1).simulate(u), y + 0.05 * np.arange(u.size))
    np.testing.assert_allclose(system(fx.SensorRectification(1.0)).simulate(u), np.abs(y))
    steps = system(fx.Quantization(0.25)).simulate(u) / 0.25
    np.testing.assert_allclose(steps, np.round(steps), atol=1e-9)


def test_a_lag_settles_at_the_command():
    y = system(fx.ActuatorLag(3.0), law=[fx.Power(1.0, 1.0)]).simulate(np.ones(400))
    plain = system(law=[fx.Power(1.0, 1.0)]).simulate(np.ones(400))
    assert y[-1] == pytest.approx(plain[-1], rel=1e-9)
    assert abs(y[4] - plain[4]) > 0.05 * abs(plain[-1])


def test_noise_of_the_equation_passes_the_sensor(u):
    d = np.random.default_rng(0).normal(size=u.size)
    quiet = system(fx.OutputOffset(1.0))
    np.testing.assert_allclose(quiet.simulate(u, d) - 1.0, system().simulate(u, d), atol=1e-12)


@pytest.mark.parametrize("stranger", [fx.FlexibleCoupling(), "cogging"])
def test_what_has_no_place_is_refused(stranger):
    with pytest.raises(ValueError, match=r"no place|two more poles"):
        system(stranger)


def test_a_coupling_is_a_mass_on_a_spring_whose_drive_is_held_over_each_sample():
    from tests.blind.filtered_chain import coupled as two_masses  # by SciPy's ODE solver

    x = np.random.default_rng(0).normal(size=80)
    memory = np.zeros((1, N_STATES))
    out = [coupled(0.2, 0.15, memory, 0, value, 1.0) for value in x]
    np.testing.assert_allclose(out, two_masses(x, 0.2, 0.15), atol=1e-5)
