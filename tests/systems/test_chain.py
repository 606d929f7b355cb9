"""The chain with effects: identities, limits and agreement with the law's own terms."""

from __future__ import annotations

import numpy as np
import pytest

from tests.systems.signals import U, chain
from whsklearn import effects as fx


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


@pytest.mark.parametrize("stranger", [fx.FlexibleCoupling(), "cogging"])
def test_what_has_no_place_is_refused(stranger):
    with pytest.raises(ValueError, match=r"no place|ChainResonance"):
        chain(stranger)
