"""Laws: sums of terms, and the named ones of the paper."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import CubicSpline

from whsklearn.effects import (
    Backlash,
    Coulomb,
    FrictionLaw,
    Hinge,
    NaturalSpline,
    Viscous,
    as_law,
    cubic_spline_law,
    reduced_law,
)
from whsklearn.effects.equations import natural_spline
from whsklearn.effects.law import piecewise_linear_law, place_knots, placed, polynomial_law, smooth_law
from whsklearn.effects.static import Power

RNG = np.random.default_rng(0)
GRID = np.linspace(-2.5, 2.5, 401)


@pytest.mark.parametrize("count", [3, 5, 12])
def test_a_cubic_spline_law_is_the_natural_spline_and_straight_beyond(count):
    knots, values = np.sort(RNG.uniform(-2, 2, count)), RNG.standard_normal(count)
    law, scipys = cubic_spline_law(knots, values), CubicSpline(knots, values, bc_type="natural")
    inside = GRID[(knots[0] <= GRID) & (knots[-1] >= GRID)]
    np.testing.assert_allclose(law(inside, 0.0), scipys(inside), atol=1e-9)
    for edge, sign in ((knots[0], -1.0), (knots[-1], 1.0)):
        away = sign * np.array([0.0, 1.0, 100.0])
        np.testing.assert_allclose(law(edge + away, 0.0), scipys(edge) + scipys(edge, 1) * away, rtol=1e-7, atol=1e-7)


def test_its_slope_is_its_derivative():
    x, h = np.linspace(-2, 2, 83), 1e-6
    up, down, slope = ([natural_spline(-0.7, 0.3, 1.1, v)[i] for v in x + s] for s, i in ((h, 0), (-h, 0), (0, 1)))
    np.testing.assert_allclose((np.array(up) - down) / (2 * h), slope, atol=1e-5)


@pytest.mark.parametrize("name", ["linear", "polynomial", "piecewise_linear", "cubic_spline", "linear,offset"])
def test_a_law_by_name_begins_as_x(name):
    np.testing.assert_allclose(as_law(name)(GRID, 0.0), GRID, atol=1e-12)
    assert as_law(name).key is not None


def test_names_add_up_without_saying_a_term_twice():
    assert as_law("offset,linear,viscous").labels == ("x0", "x1", "viscous")
    assert as_law("linear,polynomial,linear").labels == ("x1", "x0", "x2", "x3")


@pytest.mark.parametrize(
    "x", [RNG.standard_normal(5000), np.round(RNG.standard_normal(5000)), np.zeros(100), RNG.exponential(size=3000)]
)
def test_knots_increase_and_span_the_data(x):
    knots = place_knots(x, 12)
    assert np.diff(knots).min() > 0
    if np.ptp(x):
        np.testing.assert_allclose(knots[[0, -1]], np.quantile(x, [0.0005, 0.9995]))


def test_knots_are_placed_for_the_data_and_other_terms_kept():
    x = 7.0 + 0.1 * RNG.standard_normal(1000)
    law = FrictionLaw(placed(as_law("cubic_spline,viscous").terms, x))
    knots = [t.knot for t in law.terms if isinstance(t, NaturalSpline)]
    assert len(law) == 13
    assert "viscous" in law.labels
    assert 6.5 < min(knots) < max(knots) < 7.5


@pytest.mark.parametrize("count", [1, 2, 8])
def test_every_kink_has_samples_on_both_sides(count):
    x = np.random.default_rng(0).standard_normal(1000)
    kinks = [t.knot for t in placed(as_law(f"piecewise_linear:{count}").terms, x) if isinstance(t, Hinge)]
    assert len(kinks) == count
    assert all(min(np.sum(x < k), np.sum(x > k)) > 2 for k in kinks)  # two tell a slope


def test_knots_that_do_not_increase_are_refused():
    with pytest.raises(ValueError, match="increasing"):
        NaturalSpline(1.0, 0.0, 0.0, 1.0)
    with pytest.raises(ValueError, match="3 or more"):
        cubic_spline_law([0.0, 1.0], [0.0, 1.0])


X, DX = np.random.default_rng(0).standard_normal((2, 200))


def test_the_reduced_law_is_four():
    v = 0.05 * DX + 0.7 * np.sign(DX) - 0.2 * np.tanh(DX)
    np.testing.assert_allclose(reduced_law()(X, DX), v, atol=1e-15)
    np.testing.assert_allclose(as_law(None)(X, DX), v, atol=1e-15)
    np.testing.assert_allclose(as_law("reduced")(X, DX), v, atol=1e-15)


@settings(max_examples=50)
@given(st.lists(st.floats(0.05, 20.0), min_size=6, max_size=6))
def test_the_smooth_law_is_three(gamma):
    g1, g2, g3, g4, g5, g6 = gamma
    v = g1 * np.tanh(g2 * DX) - g1 * np.tanh(g3 * DX) + g4 * np.tanh(g5 * DX) + g6 * DX
    np.testing.assert_allclose(smooth_law(gamma)(X, DX), v, rtol=1e-9, atol=1e-9)


def test_three_tends_to_four_as_its_slopes_grow():
    """gamma_2 and gamma_5 to infinity, gamma_3 = 1: sign() and the remaining tanh of (4)."""
    away = []
    for steep in (10.0, 100.0, 1000.0):
        smooth = smooth_law([0.2, steep, 1.0, 0.5, steep, 0.05])
        away.append(np.mean(np.abs(smooth(X, DX) - reduced_law()(X, DX))))
    assert away[0] > 8 * away[1] > 64 * away[2]


def test_a_polynomial_is_that_of_numpy():
    coefficients = [0.3, -1.0, 0.0, 0.5]
    np.testing.assert_allclose(polynomial_law(coefficients)(X, DX), np.polynomial.Polynomial(coefficients)(X))
    assert polynomial_law([0.0, 0.0, 1.0]).labels == ("x1", "x2")  # the linear term stays, as the key term


@settings(max_examples=60)
@given(
    st.lists(st.floats(-3, 3), min_size=1, max_size=4, unique=True).map(sorted),
    st.lists(st.floats(-2, 2), min_size=5, max_size=5),
)
def test_a_piecewise_linear_law_goes_through_zero_with_its_slopes(knots, slopes):
    if np.diff(knots).min(initial=1.0) < 1e-3:
        return
    slopes = slopes[: len(knots) + 1]
    law = piecewise_linear_law(knots, slopes)
    assert abs(float(law(0.0, 0.0))) < 1e-12
    edges = [-5.0, *knots, 5.0]
    for slope, low, high in zip(slopes, edges[:-1], edges[1:], strict=True):
        at = low + (high - low) * np.array([0.25, 0.75])
        rise = np.diff(law(at, 0.0)) / np.diff(at)
        assert rise[0] == pytest.approx(slope, abs=1e-6)
    grid = np.linspace(-5, 5, 4001)
    assert np.abs(np.diff(law(grid, 0.0))).max() <= max(map(abs, slopes)) * 0.0025 + 1e-9  # continuous


def test_known_characteristics():
    dead = piecewise_linear_law([-0.5, 0.5], [1.0, 0.0, 1.0])
    x = np.linspace(-2, 2, 81)
    np.testing.assert_allclose(dead(x, 0.0), np.sign(x) * np.maximum(np.abs(x) - 0.5, 0.0), atol=1e-12)
    clip = piecewise_linear_law([-0.5, 0.5], [0.0, 1.0, 0.0])
    np.testing.assert_allclose(clip(x, 0.0), np.clip(x, -0.5, 0.5), atol=1e-12)


def test_regressors_and_weights_make_the_law():
    law = smooth_law([0.5, 3.0, 0.6, 0.8, 2.0, 0.1])
    np.testing.assert_allclose(law.regressors(X, DX) @ law.weights, law(X, DX))
    assert law.regressors(X[:, None], DX[:7]).shape == (200, 7, 3)


def test_reweighting_keeps_the_terms():
    law = reduced_law().reweighted([1.0, 2.0, 3.0])
    assert law.labels == reduced_law().labels
    assert law.weights.tolist() == [1.0, 2.0, 3.0]
    assert law != reduced_law()
    assert law.reweighted(reduced_law().weights) == reduced_law()
    assert hash(reduced_law()) == hash(reduced_law())


def test_labels_number_terms_that_recur():
    assert FrictionLaw([Power(1, 1), Power(1, 2), Viscous()]).labels == ("x1", "x2", "viscous")


def test_the_key_is_the_first_linear_term():
    assert as_law("viscous,coulomb").key == 0
    assert FrictionLaw([Coulomb(), Power(1.0, 2), Power(1.0, 1), Viscous()]).key == 2
    assert FrictionLaw([Coulomb()]).key is None


@pytest.mark.parametrize("law", ["viscous,coulomb", [Viscous(), Coulomb()], (Viscous(), Coulomb())])
def test_a_law_may_be_given_in_several_ways(law):
    assert as_law(law).labels == ("viscous", "coulomb")
    assert as_law(Coulomb()).labels == ("coulomb",)
    assert as_law(reduced_law()) == reduced_law()


@pytest.mark.parametrize(
    ("law", "says"),
    [
        ("viscous,glue", "glue"),
        ("", "no term"),
        ([], "no term"),
        ("backlash", "memoryless"),
        ([Backlash()], "memoryless"),
        (["viscous"], "memoryless"),
        (5, "expected names"),
    ],
)
def test_what_is_no_law_is_refused(law, says):
    with pytest.raises(ValueError, match=says):
        as_law(law)


@pytest.mark.parametrize("gamma", [[1, 1, 1, 1, 1], [1, 1, 1, 1, 1, 0], [1, -1, 1, 1, 1, 1]])
def test_three_needs_six_positive_parameters(gamma):
    with pytest.raises(ValueError, match="six positive"):
        smooth_law(gamma)


def test_a_piecewise_linear_law_says_what_is_wrong_with_it():
    with pytest.raises(ValueError, match="one more slope"):
        piecewise_linear_law([0.0], [1.0])
    with pytest.raises(ValueError, match="increasing"):
        piecewise_linear_law([1.0, 0.0], [1.0, 2.0, 3.0])
