"""Units in any spelling, and the factor to SI."""

from __future__ import annotations

import math

import pytest

from whsklearn.logs.units import factor_of, stated, symbol_of, turn_of


@pytest.mark.parametrize(
    ("unit", "si", "factor"), [("deg", "rad", math.pi / 180), ("ms", "s", 1e-3), ("mm", "m", 1e-3)]
)
def test_factors_lead_to_si(unit, si, factor):
    assert factor_of(unit) == (pytest.approx(factor), si)
    assert factor_of(si) == (1.0, si)  # what is SI already stays


@pytest.mark.parametrize("unit", ["rad", "deg", "counts/4096"])
def test_a_turn_is_two_pi_in_any_angle(unit):
    assert turn_of(unit) * factor_of(unit)[0] == pytest.approx(2 * math.pi)


def test_spelling_and_case_do_not_matter_and_the_unknown_is_kept():
    assert symbol_of(" NM ") == symbol_of("nm") == "Nm"
    assert symbol_of("furlong") is None
    assert factor_of("furlong") == (1.0, "furlong")
    assert turn_of("Nm") is None


def test_roles_are_checked():
    assert stated({"output": "deg", "input": "A"}) == {"position": "deg", "drive": "A"}
    with pytest.raises(ValueError, match="expected one of time"):
        stated({"torque": "Nm"})
    with pytest.raises(ValueError, match="unit of time"):
        stated({"time": "deg"})
