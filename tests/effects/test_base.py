"""Rows, coefficients and texts of an effect lead back to it."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from sklearn.utils import Bunch

from whsklearn.effects import (
    Cogging,
    Coulomb,
    Effect,
    ParameterChange,
    Quantity,
    Scales,
    effect_names,
    get_effect,
    number,
)

RNG = np.random.default_rng(0)
N = 60
SIGNALS = Bunch(
    time=np.arange(N) / 100, position=RNG.uniform(-2, 2, N), velocity=RNG.normal(size=N),
    acceleration=RNG.normal(size=N), drive=RNG.normal(size=N),
)  # fmt: skip


@pytest.mark.parametrize("name", effect_names())
def test_a_row_leads_back_to_the_effect(name):
    for options in get_effect(name).variants():
        effect = get_effect(name)(**options)
        if math.isfinite(effect.magnitude):
            again = type(effect).from_row(effect.row, **options)
            np.testing.assert_allclose(again.row, effect.row, atol=1e-12)


@given(st.floats(1e-3, 10), st.floats(-3.1, 3.1))
def test_two_weights_are_amplitude_and_phase(amplitude, phase):
    again = Cogging.from_coefficients(Cogging(amplitude, 12.0, phase).coefficients, order=12.0)
    assert (again.amplitude, again.phase) == pytest.approx((amplitude, phase))


@pytest.mark.parametrize("name", effect_names())
def test_a_search_begins_inside_its_bounds_with_few_points(name):
    cls, scales = get_effect(name), Scales()
    bounds, starts = cls.bounds(scales), cls.starts(scales)
    assert 1 <= len(starts) <= 60
    for start in starts:
        assert all(low <= s <= high for s, (low, high) in zip(start, bounds, strict=True))


def test_twice_the_size_is_twice_the_torque():
    q = np.linspace(-1, 1, 20)
    e = Cogging(0.1, 5.0, 0.2)
    np.testing.assert_allclose(e.resized(0.2).value(position=q), 2 * e.value(position=q))


def test_names_are_in_the_order_of_the_chain_and_unknown_ones_are_refused():
    names = effect_names()
    assert names.index("coulomb") < names.index("dead_zone") < names.index("backlash") < names.index("cogging")
    assert set(effect_names("sensor")) < set(names)
    with pytest.raises(ValueError, match="Unknown effect 'friktion'"):
        get_effect("friktion")


@pytest.mark.parametrize("wrong", [math.nan, math.inf, True, "0.3"])
def test_a_number_that_is_none_is_refused_with_its_unit(wrong):
    with pytest.raises(ValueError, match="give it in Nm"):
        Coulomb(wrong)


def test_labels_carry_units_and_choices():
    assert Coulomb(0.7).labelled() == {"torque_nm": 0.7}
    assert ParameterChange(0.1, parameter="gain").labelled()["parameter"] == "gain"


def test_an_abstract_effect_is_in_no_catalogue():
    class Nameless(Effect):
        pass

    assert "" not in effect_names()


# --- columns -------------------------------------------------------------------------------------------------
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


class Declared(Effect, catalogued=False):
    torque: float = number(0.1, "Nm", -1.0, 1.0)
    width: float = number(0.2, "rad", 0.01, 1.0, log=True)

    name = "declared"
    place = "position"


@dataclass(frozen=True)
class Decorated(Effect, catalogued=False):
    torque: float = 0.1
    width: float = 0.2

    name: ClassVar[str] = "declared"
    place: ClassVar[str] = "position"
    size: ClassVar[str] = "torque"
    quantities: ClassVar[dict[str, Quantity]] = Declared.quantities


@pytest.mark.parametrize("cls", [Declared, Decorated])
def test_a_class_is_a_frozen_dataclass_with_or_without_the_decorator(cls):
    effect = cls(0.3, width=0.5)
    assert (cls.size, list(cls.quantities), effect.shape) == ("torque", ["torque", "width"], {"width": 0.5})
    assert cls.quantities["width"] == Quantity("rad", 0.01, 1.0, log=True)
    assert dataclasses.replace(effect, width=0.2) == cls(0.3)
    assert hash(effect) == hash(cls(0.3, 0.5))
    with pytest.raises(dataclasses.FrozenInstanceError):
        effect.torque = 1.0
    with pytest.raises(dataclasses.FrozenInstanceError):
        del effect.width
    assert "declared" not in effect_names()
