"""The compiled terms: derivatives, limits and symmetry."""

from __future__ import annotations

import math

import numpy as np
import pytest

from whsklearn.effects import codes
from whsklearn.effects.equations import smooth_sign, tanh
from whsklearn.effects.terms import law_values, term

SHAPES = {
    codes.VISCOUS: (0.0, 0.0, 0.0),
    codes.COULOMB: (0.0, 0.0, 0.0),
    codes.TANH: (0.4, 0.0, 0.0),
    codes.TANH_DIFFERENCE: (0.2, 1.1, 0.0),
    codes.STRIBECK_TANH: (0.7, 0.0, 0.0),
    codes.STRIBECK_EXP: (0.5, 1.6, 0.0),
    codes.QUADRATIC_DRAG: (0.0, 0.0, 0.0),
    codes.ASYMMETRIC_COULOMB: (0.0, 0.0, 0.0),
    codes.ASYMMETRIC_VISCOUS: (0.0, 0.0, 0.0),
    codes.POSITION_FRICTION: (3.0, 0.4, 0.0),
    codes.POWER: (3.0, 0.0, 0.0),
    codes.HINGE: (0.3, 0.0, 0.0),
    codes.CONSTANT: (0.0, 0.0, 0.0),
    codes.NATURAL_SPLINE: (-0.5, 0.7, 1.5),
    codes.SPEED_HINGE: (0.2, 0.0, 0.0),
}
ODD = (
    codes.VISCOUS, codes.COULOMB, codes.TANH, codes.TANH_DIFFERENCE, codes.STRIBECK_TANH, codes.STRIBECK_EXP,
    codes.QUADRATIC_DRAG,
)  # fmt: skip
SIGNED = (codes.COULOMB, codes.STRIBECK_EXP, codes.ASYMMETRIC_COULOMB, codes.ASYMMETRIC_VISCOUS)
POINTS = [(x, dx) for x in (-1.3, -0.2, 0.6, 2.0) for dx in (-1.7, -0.31, 0.05, 0.8)]


def test_every_code_is_tested():
    known = {v for k, v in vars(codes).items() if k.isupper() and not k.startswith("N_")}
    assert {v for v in known if v < codes.LEARNED_POSITION} == set(SHAPES)


@pytest.mark.parametrize("kappa", [0.7, 3.0, 12.0])
@pytest.mark.parametrize("code", list(SHAPES))
def test_derivatives_are_those_of_the_value(code, kappa):
    h = 1e-6
    for x, dx in POINTS:
        _, by_x, by_dx = term(code, *SHAPES[code], x, dx, kappa)
        along = [term(code, *SHAPES[code], x + s * h, dx, kappa)[0] for s in (1, -1)]
        across = [term(code, *SHAPES[code], x, dx + s * h, kappa)[0] for s in (1, -1)]
        assert by_x == pytest.approx((along[0] - along[1]) / (2 * h), rel=1e-5, abs=1e-7)
        assert by_dx == pytest.approx((across[0] - across[1]) / (2 * h), rel=1e-5, abs=1e-7)


@pytest.mark.parametrize("code", SIGNED)
def test_sharper_and_sharper_it_becomes_the_sign(code):
    """The distance to kappa = inf falls faster than any power of kappa away from dx = 0."""
    for x, dx in POINTS:
        limit = term(code, *SHAPES[code], x, dx, math.inf)[0]
        away = [abs(term(code, *SHAPES[code], x, dx, k)[0] - limit) for k in (10.0, 100.0, 1000.0)]
        assert away[0] >= away[1] >= away[2]
        assert away[2] < 1e-12


@pytest.mark.parametrize("kappa", [2.0, math.inf])
@pytest.mark.parametrize("code", ODD)
def test_friction_is_odd_and_nothing_at_rest(code, kappa):
    for _, dx in POINTS:
        assert term(code, *SHAPES[code], 0.4, -dx, kappa)[0] == pytest.approx(
            -term(code, *SHAPES[code], 0.4, dx, kappa)[0]
        )
    assert term(code, *SHAPES[code], 0.4, 0.0, kappa)[0] == 0.0


@pytest.mark.parametrize("kappa", [1.0, 1e9, math.inf])
@pytest.mark.parametrize("code", list(SHAPES))
def test_nothing_but_numbers_comes_out(code, kappa):
    for x in (0.0, -1e3, 1e3):
        for dx in (0.0, 1e-300, -1e3, 1e3):
            assert np.isfinite(term(code, *SHAPES[code], x, dx, kappa)).all()


def test_smooth_sign_is_the_tanh_of_the_paper():
    for dx in (-2.0, -0.01, 0.0, 0.3, 50.0):
        value, slope = smooth_sign(dx, 4.0)
        assert value == pytest.approx(math.tanh(4.0 * dx), abs=1e-15)
        assert slope == pytest.approx(4.0 / math.cosh(min(4.0 * dx, 300.0)) ** 2, abs=1e-15)


def test_a_record_is_its_samples():
    x, dx = np.array(POINTS).T
    values = law_values(np.array([codes.STRIBECK_EXP]), np.array([[0.5, 1.6, 0.0]]), x, dx, 3.0)[0]
    np.testing.assert_array_equal(
        values, [term(codes.STRIBECK_EXP, 0.5, 1.6, 0.0, p, q, 3.0)[0] for p, q in zip(x, dx, strict=True)]
    )


def test_powers_of_x_are_exact():
    for degree in range(5):
        assert term(codes.POWER, float(degree), 0.0, 0.0, -1.5, 0.0, 1.0)[0] == (-1.5) ** degree


def test_a_negative_sharpness_gives_the_sign_with_the_slope_of_the_tanh():
    assert smooth_sign(-1e-20, -2.5) == (0.0, 2.5)  # rest
    for dx in (-3.0, -0.2, 0.0, 1e-6, 0.4, 7.0):
        value, slope = smooth_sign(dx, -2.5)
        assert value == np.sign(dx)
        assert slope == pytest.approx(smooth_sign(dx, 2.5)[1])


def test_tanh_is_that_of_the_c_library():
    z = np.concatenate([np.linspace(-3, 3, 10_001), np.geomspace(1e-300, 700, 1000), [0.0, np.inf, -np.inf]])
    np.testing.assert_allclose([tanh(v) for v in z.tolist()], np.tanh(z), rtol=1e-15)
    assert np.isnan(tanh(np.nan))
