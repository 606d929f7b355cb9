"""Laws in x by name, and their knots."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from whsklearn.effects import FrictionLaw, NaturalSpline, as_law, cubic_spline_law
from whsklearn.effects.equations import natural_spline
from whsklearn.effects.knots import place_knots, placed

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


def test_knots_that_do_not_increase_are_refused():
    with pytest.raises(ValueError, match="increasing"):
        NaturalSpline(1.0, 0.0, 0.0, 1.0)
    with pytest.raises(ValueError, match="3 or more"):
        cubic_spline_law([0.0, 1.0], [0.0, 1.0])
