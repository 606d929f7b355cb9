"""The chain with effects: identities, limits and agreement with the law's own terms."""

from __future__ import annotations

import numpy as np
import pytest

from tests.systems.signals import U, chain
from whsklearn import WienerHammersteinSystem
from whsklearn import effects as fx
from whsklearn.effects.equations import N_STATES
from whsklearn.systems.chain import coupled


def test_a_delay_of_whole_samples_shifts_the_output():
    late = chain(fx.InputDelay(0.03), dt=0.01).simulate(U)
    np.testing.assert_allclose(late[3:], chain().simulate(U)[:-3], atol=1e-12)
    assert np.all(late[:4] == 0.0)


def test_a_drive_effect_acts_as_on_the_input_itself():
    dead = chain(fx.DeadZone(0.3)).simulate(U)
    np.testing.assert_allclose(dead, chain().simulate(U - np.clip(U, -0.3, 0.3)), atol=1e-12)
    cut = chain(fx.Saturation(0.8)).simulate(U)
    np.testing.assert_allclose(cut, chain().simulate(np.clip(U, -0.8, 0.8)), atol=1e-12)


def test_an_input_offset_leaves_a_law_of_velocity_alone_after_the_transient():
    apart = chain(fx.InputOffset(0.5)).simulate(U) - chain().simulate(U)
    assert np.abs(apart[:10]).max() > 1e-3
    assert np.abs(apart[200:]).max() < 1e-9


def test_sensor_effects_act_on_the_output():
    y = chain().simulate(U)
    np.testing.assert_allclose(chain(fx.OutputOffset(2.0)).simulate(U), y + 2.0)
    np.testing.assert_allclose(chain(fx.OutputDrift(0.5), dt=0.1).simulate(U), y + 0.05 * np.arange(U.size))
    np.testing.assert_allclose(chain(fx.SensorRectification(1.0)).simulate(U), np.abs(y))
    steps = chain(fx.Quantization(0.25)).simulate(U) / 0.25
    np.testing.assert_allclose(steps, np.round(steps), atol=1e-9)


def test_a_lag_settles_at_the_command():
    y = chain(fx.ActuatorLag(3.0), law=[fx.Power(1.0, 1.0)]).simulate(np.ones(400))
    plain = chain(law=[fx.Power(1.0, 1.0)]).simulate(np.ones(400))
    assert y[-1] == pytest.approx(plain[-1], rel=1e-9)
    assert abs(y[4] - plain[4]) > 0.05 * abs(plain[-1])


def test_noise_of_the_equation_passes_the_sensor():
    d = np.random.default_rng(0).normal(size=U.size)
    quiet = chain(fx.OutputOffset(1.0))
    np.testing.assert_allclose(quiet.simulate(U, d) - 1.0, chain().simulate(U, d), atol=1e-12)


def test_a_coupling_is_a_mass_on_a_spring_whose_drive_is_held_over_each_sample():
    from benchmarks.blind_logs.filtered_chain import coupled as two_masses  # by SciPy's ODE solver

    x = np.random.default_rng(0).normal(size=80)
    memory = np.zeros((1, N_STATES))
    out = [coupled(0.2, 0.15, memory, 0, value, 1.0) for value in x]
    np.testing.assert_allclose(out, two_masses(x, 0.2, 0.15), atol=1e-5)


def test_a_spring_pulls_on_a_mass_as_it_moves_between_the_samples():
    from scipy.signal import cont2discrete

    from benchmarks.blind_logs import mass_on_spring as twin  # integrated in twenty steps a sample

    log = twin.record(0, noise=0.0)
    over = [twin.MASS, twin.DAMPING, twin.STIFFNESS]
    num, den, _ = cont2discrete(([1.0], over), 1.0 / twin.RATE, "zoh")
    (_, gain, second), b = num[0], den[1:]
    spring = fx.ChainSpring(twin.CUBIC * gain**3, at="input")  # of x = y / gain
    law = [fx.Power(gain, 1.0)]
    mass = WienerHammersteinSystem([1.0, second / gain], b, [1.0], [], law, effects=[spring], direct=1)
    y = log["y"].to_numpy()
    # held from the sample on it comes half a sample late, and the error is 0.12
    assert np.std(mass.simulate(log["u"]) - y) < 0.01 * np.std(y)


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
def test_an_effect_of_no_size_changes_nothing(nothing):
    np.testing.assert_allclose(chain(nothing).simulate(U), chain().simulate(U), atol=1e-12)


@pytest.mark.parametrize("extra", [fx.QuadraticDrag(0.1), fx.AsymmetricViscous(0.2), fx.Stribeck(0.3, 0.5, 2.0)])
def test_a_static_effect_is_a_term_of_the_law(extra):
    law = [*chain().law.terms, extra]
    np.testing.assert_allclose(chain(extra).simulate(U), chain(law=law).simulate(U), atol=1e-12)


def test_a_cable_spring_is_linear_in_x():
    law = [*chain().law.terms, fx.Power(0.4, 1.0)]
    np.testing.assert_allclose(chain(fx.CableSpring(0.4)).simulate(U), chain(law=law).simulate(U), atol=1e-12)


@pytest.mark.parametrize("stranger", [fx.FlexibleCoupling(), fx.EarlyReversal(), "cogging"])
def test_what_has_no_place_is_refused(stranger):
    with pytest.raises(ValueError, match=r"no place|ChainResonance"):
        chain(stranger)
