"""The hills of a learned curve."""

from __future__ import annotations

import math

import numpy as np
import pytest

from whsklearn.effects import LearnedTorque
from whsklearn.effects.equations import hill


def test_hills_side_by_side_make_a_constant():
    for x in np.linspace(0.0, 1.0, 11):
        assert sum(hill(x - k) for k in range(-3, 4)) == pytest.approx(1.5, abs=1e-12)


def test_a_hill_is_smooth_to_its_second_derivative_and_ends_at_two():
    x = np.linspace(-2.5, 2.5, 5001)
    y = np.array([hill(z) for z in x])
    third = np.diff(y, 3) / (x[1] - x[0]) ** 3
    assert np.abs(third).max() < 5.0, "a jump of the second derivative would be 1000"
    assert not y[np.abs(x) >= 2.0].any()


def test_a_turn_later_it_is_the_same():
    e = LearnedTorque(0.2, centre=3.0, width=0.4, period=2 * math.pi)
    q = np.linspace(-9.0, 9.0, 50)
    np.testing.assert_allclose(e.value(position=q), e.value(position=q + 2 * math.pi), atol=1e-12)
    assert LearnedTorque(0.2, centre=3.0, width=0.4).value(position=3.0 - 2 * math.pi) == 0.0


@pytest.mark.parametrize(
    ("over", "sign"), [("speed", -1), ("position and direction", -1), ("position and velocity", -1), ("position", 1)]
)
def test_symmetries(over, sign):
    e = LearnedTorque(0.3, centre=0.5, width=0.5, over=over)
    there, back = (e.value(position=0.4, velocity=v) for v in (0.7, -0.7))
    assert there != 0.0
    assert back == sign * there
