"""Terms of general laws."""

from __future__ import annotations

import numpy as np
import pytest
from sklearn.utils import Bunch

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
