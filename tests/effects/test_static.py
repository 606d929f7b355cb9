"""Terms of general laws."""

from __future__ import annotations

import math

import numpy as np
import pytest
from sklearn.utils import Bunch

from whsklearn.effects import LearnedTorque
from whsklearn.effects.equations import hill
from whsklearn.effects.static import Hinge, Power, Tanh, TanhDifference

X = np.linspace(-2, 2, 9)
SIGNALS = Bunch(position=X, velocity=np.roll(X, 1))


@pytest.mark.parametrize(
    ("effect", "formula"),
    [
        (Tanh(1.0, 0.5), lambda x, v: np.tanh(v / 0.5)),
        (TanhDifference(1.0, 0.2, 0.9), lambda x, v: np.tanh(v / 0.2) - np.tanh(v / 0.9)),
        (Power(1.0, 0), lambda x, v: np.ones_like(x)),
        (Power(1.0, 3), lambda x, v: x**3),
        (Hinge(1.0, 0.5), lambda x, v: np.maximum(x - 0.5, 0.0)),
    ],
)
def test_columns_are_the_written_formula(effect, formula):
    np.testing.assert_allclose(effect.columns(SIGNALS)[:, 0], formula(X, SIGNALS.velocity), atol=1e-15)
    assert effect.equation


@pytest.mark.parametrize("effect", [Tanh(), TanhDifference(), Power(), Hinge()])
def test_twice_the_size_is_twice_the_term(effect):
    larger = effect.resized(2.0 * effect.magnitude)
    np.testing.assert_allclose(larger.contribution(SIGNALS), 2.0 * effect.contribution(SIGNALS))


@pytest.mark.parametrize("degree", [-1, 0.5, 2.2])
def test_a_power_is_a_whole_number(degree):
    with pytest.raises(ValueError, match="whole number"):
        Power(1.0, degree)


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
