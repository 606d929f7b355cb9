"""The catalogue is whole, and every entry keeps the contract."""

from __future__ import annotations

import dataclasses
import re

import numpy as np
import pytest
from sklearn.utils import Bunch

from whsklearn import effects
from whsklearn.checks import check_effect
from whsklearn.effects import (
    BoucWen,
    ContactStop,
    Coulomb,
    Effect,
    GeneralizedMaxwellSlip,
    LuGre,
    ParameterChange,
    PreslidingHysteresis,
    Saturation,
    effect_names,
    get_effect,
)

CATALOGUE = {
    "friction": [
        "viscous",
        "coulomb",
        "asymmetric_coulomb",
        "asymmetric_viscous",
        "stribeck",
        "quadratic_drag",
        "load_friction",
        "position_friction",
        "presliding_hysteresis",
        "early_reversal",
        "friction_drift",
    ],
    "drive": ["input_offset", "dead_zone", "saturation", "input_delay", "actuator_lag", "torque_ripple"],
    "transmission": ["backlash", "flexible_coupling"],
    "position": ["cogging", "gravity_imbalance", "cable_spring", "hardening_spring", "end_stop"],
    "sensor": ["output_offset", "output_drift", "sensor_rectification", "encoder_eccentricity", "quantization"],
    "time": ["disturbance_tone", "parameter_change"],
}
NAMES = [name for names in CATALOGUE.values() for name in names]


def own_names(place=None):
    """Names in the catalogue without those that other tests register."""
    return {n for n in effect_names(place) if get_effect(n).__module__.startswith("whsklearn.")}


@pytest.mark.parametrize("place", list(CATALOGUE))
def test_every_name_is_in_its_place_and_no_other_is(place):
    assert own_names(place) == set(CATALOGUE[place])


@pytest.mark.parametrize("name", NAMES)
def test_every_effect_keeps_the_contract(name):
    assert "first order" in check_effect(get_effect(name))


@pytest.mark.parametrize(
    "effect",
    [
        LuGre(0.1, 0.01, 1.6, 0.1, 0.02),
        LuGre(damping=0.0),
        GeneralizedMaxwellSlip(0.1, 0.02),
        GeneralizedMaxwellSlip(0.1, 0.01, 8.0, 1.5),
        BoucWen(0.1, 0.02, 0.5),
        PreslidingHysteresis(0.1, 0.05),
        *(ContactStop(8.0, 0.3, side=s) for s in ("upper", "lower", "both")),
        *(ParameterChange(0.02, 1.5, p) for p in ("inertia", "viscous", "coulomb", "gain")),
    ],
)
def test_every_shape_keeps_the_contract(effect):
    check_effect(effect)


@pytest.mark.parametrize("name", NAMES)
def test_every_effect_says_what_it_is(name):
    cls = get_effect(name)
    assert all((cls.signature, cls.needs, cls.reference, cls.equation, cls.__doc__))
    assert all(alias in NAMES for alias in cls.aliases)
    assert all(name in get_effect(alias).aliases for alias in cls.aliases), "an alias works both ways"


@pytest.mark.parametrize("cls", [*map(get_effect, NAMES), LuGre, GeneralizedMaxwellSlip, BoucWen])
def test_every_effect_has_a_reference_of_its_own_that_can_be_found(cls):
    assert "reference" in vars(cls), "not inherited"
    assert re.search(r"\b(19|20)\d\d, \S|doi 10\.\d+/|makers' notes: \S", cls.reference), "author, year and place"


@pytest.mark.parametrize("name", NAMES)
def test_defaults_are_plausible(name):
    effect = get_effect(name)()
    for field, value in {effect.size: effect.magnitude, **effect.shape}.items():
        assert effect.quantities[field].low <= value <= effect.quantities[field].high


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("bad", [np.nan, -np.inf, None, "much"])
def test_a_size_that_is_no_number_is_refused(name, bad):
    cls = get_effect(name)
    with pytest.raises(ValueError, match=cls.__name__):
        cls(**{cls.size: bad})


def test_a_shape_that_cannot_be_is_refused():
    with pytest.raises(ValueError, match="above zero"):
        PreslidingHysteresis(distance=0.0)
    with pytest.raises(ValueError, match="expected one of inertia"):
        ParameterChange(parameter="colour")
    with pytest.raises(ValueError, match="whole number"):
        GeneralizedMaxwellSlip(elements=2.5)
    with pytest.raises(ValueError, match="share between 0 and 1"):
        effects.Backlash(load_share=1.0)


def test_saturation_is_neutral_without_limit():
    drive = np.linspace(-2.0, 2.0, 9)
    zeros = np.zeros(9)
    signals = Bunch(time=zeros, position=zeros, velocity=zeros, acceleration=zeros, drive=drive)
    assert not Saturation(np.inf).contribution(signals).any()
    np.testing.assert_allclose(Saturation(1.5).contribution(signals), drive - np.clip(drive, -1.5, 1.5))


def test_phase_and_amplitude_survive_the_way_through_coefficients():
    rng = np.random.default_rng(0)
    for name in NAMES:
        cls = get_effect(name)
        if cls.phased:
            effect = cls(**{cls.size: 0.37, "phase": rng.uniform(-3, 3)})
            fields = {k: effect.shape[k] for k in cls.shape_fields()}
            again = cls.from_coefficients(effect.coefficients, **fields)
            np.testing.assert_allclose(again.numbers, effect.numbers, rtol=1e-12)


def test_wrong_number_of_coefficients_is_refused():
    with pytest.raises(ValueError, match="2 columns, got 1"):
        effects.Cogging.from_coefficients([1.0])
    with pytest.raises(ValueError, match="0 columns"):
        effects.Backlash.from_coefficients([1.0])


def test_reports_name_the_unit():
    assert effects.Cogging(0.35, order=17.0).labelled() == {"amplitude_nm": 0.35, "order": 17.0, "phase_rad": 0.0}
    assert ParameterChange(0.1, 2.0, "gain").labelled()["parameter"] == "gain"


def test_unknown_name_lists_the_known():
    with pytest.raises(ValueError, match="cogging"):
        get_effect("gremlin")


def test_effects_are_values():
    assert Coulomb(0.3) == Coulomb(0.3)
    assert hash(Coulomb(0.3)) == hash(Coulomb(0.3))
    with pytest.raises(dataclasses.FrozenInstanceError):
        Coulomb(0.3).torque = 1.0
    assert issubclass(get_effect("presliding_hysteresis"), Effect)
