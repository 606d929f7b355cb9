"""Friction brakes, and its derivatives are those of its equation."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from whsklearn.effects import (
    AsymmetricCoulomb,
    AsymmetricViscous,
    Coulomb,
    FrictionDrift,
    LoadFriction,
    PositionFriction,
    QuadraticDrag,
    ReducedStribeck,
    Stribeck,
    Viscous,
)
from whsklearn.effects import equations as f
from whsklearn.effects.equations import position_friction, smooth_sign

KAPPA = 3.0
speeds = st.floats(-5, 5).filter(lambda v: abs(v) > 1e-3)
TERMS = {
    "viscous": lambda x, dx: f.viscous(dx),
    "coulomb": lambda x, dx: f.coulomb(*smooth_sign(dx, KAPPA)),
    "asymmetric_coulomb": lambda x, dx: f.asymmetric_coulomb(*smooth_sign(dx, KAPPA)),
    "asymmetric_viscous": lambda x, dx: f.asymmetric_viscous(dx, *smooth_sign(dx, KAPPA)),
    "stribeck": lambda x, dx: f.stribeck(0.4, 1.7, dx, *smooth_sign(dx, KAPPA)),
    "reduced_stribeck": lambda x, dx: f.reduced_stribeck(0.4, dx),
    "quadratic_drag": lambda x, dx: f.quadratic_drag(dx),
}


def slopes(f, x, dx, h=1e-6):
    """Central differences by x and by dx."""
    return (f(x + h, dx)[0] - f(x - h, dx)[0]) / (2 * h), (f(x, dx + h)[0] - f(x, dx - h)[0]) / (2 * h)


@pytest.mark.parametrize("name", TERMS)
@given(dx=speeds)
def test_derivatives_are_those_of_the_value(name, dx):
    _, by_x, by_dx = TERMS[name](0.0, dx)
    assert (by_x, by_dx) == pytest.approx(slopes(TERMS[name], 0.0, dx), abs=1e-5, rel=1e-5)


@pytest.mark.parametrize("effect", [Viscous(0.3), Coulomb(0.3), Stribeck(0.3), QuadraticDrag(0.3)])
@given(v=speeds)
def test_it_takes_power_in_both_directions_and_is_odd(effect, v):
    assert effect.value(velocity=v) * v >= 0.0
    assert effect.value(velocity=-v) == pytest.approx(-effect.value(velocity=v))


@given(v=speeds)
def test_the_half_differences_are_even(v):
    for effect in (AsymmetricCoulomb(0.2), AsymmetricViscous(0.2)):
        assert effect.value(velocity=v) == pytest.approx(effect.value(velocity=-v))


def test_stribeck_fades_and_the_reduced_one_saturates():
    bump = Stribeck(0.3, velocity=0.1, exponent=2.0)
    assert bump.value(velocity=0.1) == pytest.approx(0.3 * math.exp(-1))
    assert bump.value(velocity=1.0) < 1e-12
    assert ReducedStribeck(0.2).value(velocity=20.0) == pytest.approx(-0.2)


def test_nothing_brakes_at_rest():
    for effect in (Viscous(), Coulomb(), AsymmetricCoulomb(), AsymmetricViscous(), Stribeck(), QuadraticDrag()):
        assert effect.value(velocity=0.0) == 0.0


# --- Friction that varies with load, place and time is Coulomb's at each of them ------------------------------------
@given(st.floats(-5, 5), st.floats(0.01, 3))
def test_at_a_constant_load_it_is_coulomb_friction(drive, v):
    expected = Coulomb(0.1 * abs(drive)).value(velocity=v) if drive else 0.0
    assert LoadFriction(0.1).value(velocity=v, drive=drive) == pytest.approx(expected)


def test_over_a_whole_turn_its_mean_is_none():
    q = np.linspace(0, 2 * np.pi, 1000, endpoint=False)
    assert np.mean(PositionFriction(0.1, order=3.0, phase=0.4).value(position=q, velocity=1.0)) == pytest.approx(0.0)
    forth, back = (PositionFriction(0.1, order=3.0).value(position=q, velocity=v) for v in (1.0, -1.0))
    np.testing.assert_allclose(forth, -back)  # cogging would not change its sign


@given(st.floats(-3, 3), st.floats(-2, 2))
def test_derivatives_of_friction_over_the_angle(x, dx):
    def value(x, dx):
        return position_friction(0.3, -0.2, 2.0, x, *smooth_sign(dx, 3.0))

    h = 1e-6
    _, by_x, by_dx = value(x, dx)
    assert by_x == pytest.approx((value(x + h, dx)[0] - value(x - h, dx)[0]) / (2 * h), abs=1e-6)
    assert by_dx == pytest.approx((value(x, dx + h)[0] - value(x, dx - h)[0]) / (2 * h), abs=1e-6)


def test_a_drift_starts_at_nothing_and_settles():
    t = np.array([0.0, 20.0, 2000.0])
    values = FrictionDrift(-0.1, time_constant=20.0).value(time=t, velocity=1.0)
    np.testing.assert_allclose(values, [0.0, -0.1 * (1 - np.exp(-1)), -0.1], atol=1e-12)
