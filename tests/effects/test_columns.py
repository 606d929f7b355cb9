"""Columns times coefficients are the effect, for all that have columns."""

from __future__ import annotations

import numpy as np
import pytest
from sklearn.utils import Bunch

from whsklearn.effects import effect_names, get_effect

RNG = np.random.default_rng(0)
N = 60
SIGNALS = Bunch(
    time=np.arange(N) / 100, position=RNG.uniform(-2, 2, N), velocity=RNG.normal(size=N),
    acceleration=RNG.normal(size=N), drive=RNG.normal(size=N),
)  # fmt: skip


@pytest.mark.parametrize("name", effect_names())
def test_columns_do_not_depend_on_the_size_where_they_are_exact(name):
    cls = get_effect(name)
    effect = cls()
    columns = effect.columns(SIGNALS)
    assert columns.shape == (N, effect.coefficients.size)
    if cls.column_kind == "exact":
        np.testing.assert_allclose(effect.resized(2 * effect.magnitude).columns(SIGNALS), columns, atol=1e-12)
        np.testing.assert_allclose(effect.contribution(SIGNALS), columns @ effect.coefficients)


@pytest.mark.parametrize("name", ["coulomb", "stribeck", "load_friction", "position_friction"])
def test_a_smooth_sign_tends_to_the_sharp_one(name):
    effect = get_effect(name)()
    sharp = effect.contribution(SIGNALS)
    errors = [np.abs(effect.contribution(Bunch(**SIGNALS, kappa=k)) - sharp).max() for k in (1.0, 10.0, 1e4)]
    assert errors[0] > errors[1] > errors[2]
