"""Tones, stops and limits that a record offers falsely."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from whsklearn.effects import CableSpring, ContactStop, EndStop, codes, get_effect
from whsklearn.effects.base import rms
from whsklearn.gap.plants.servo_inverse import (
    LEAST_GAIN_LEFT,
    always_limited,
    beside_its_sign,
    never_free,
    never_started,
    on_excitation_line,
)
from whsklearn.gap.record import ServoRecord

T = np.arange(4000) / 100


def record(units):
    wave = np.sin(2 * np.pi * 0.5 * T) + np.sin(2 * np.pi * 1.3 * T)
    noise = 0.01 * np.random.default_rng(0).standard_normal(T.size)
    return ServoRecord(T, wave, wave, wave + noise, units)


def tone(hertz):
    return SimpleNamespace(name="disturbance_tone", q=np.array([0.1, 0.0, hertz]))


@pytest.mark.parametrize(("hertz", "on_line"), [(0.5, True), (1.3, True), (0.9, False), (2.6, False)])
def test_a_tone_on_a_line_of_the_command_is_not_believed_without_a_drive(hertz, on_line):
    assert bool(on_excitation_line(record(("rad", "rad")), tone(hertz))) == on_line


def test_with_a_measured_drive_a_tone_is_a_tone_wherever_it_is():
    assert on_excitation_line(record(("Nm", "rad")), tone(0.5)) == ""


@pytest.mark.parametrize(
    ("effect", "spring"),
    [
        (EndStop(1.0, 0.8), False),
        (EndStop(1.0, 0.4), True),
        (ContactStop(1.0, -1.1, side="upper"), True),
        (ContactStop(1.0, 0.8, side="upper"), False),
        (ContactStop(1.0, 1.1, side="lower"), True),
        (CableSpring(1.0), False),
    ],
)
def test_a_stop_that_the_axis_touches_most_of_the_time_is_a_spring(effect, spring):
    assert bool(never_free(effect, np.sin(T))) == spring


@pytest.mark.parametrize(
    ("limit", "mean", "hides"),
    [
        (0.6, 0.0, False),  # at the limit for 59 % of the time
        (0.2, 0.0, False),
        (0.01, 0.0, True),  # a square wave
        (0.9, 2.0, True),  # under a speed controller: constant, although hardly lower than the lowest reading
        (1.5, 2.0, False),
    ],
)
def test_a_limit_that_leaves_little_of_the_drive_hides_what_else_is_missing(limit, mean, hides):
    drive = mean + np.sin(2 * np.pi * 0.7 * T)
    share = beside_its_sign(limit, drive)[1]
    assert (share < LEAST_GAIN_LEFT) == hides
    assert beside_its_sign(limit, -3.0 * drive)[1] == pytest.approx(beside_its_sign(limit / 3.0, drive)[1]), "no units"


@pytest.mark.parametrize("unit", [1.0, -3.0])
@pytest.mark.parametrize(
    ("limit", "mean", "missing", "refused"),
    [
        (0.6, 0.0, 0.5, False),
        (0.6, 0.0, 2.0, True),
        (0.01, 0.0, 0.5, False),  # a square wave, of which even the edges are explained
        (0.9, 2.0, 0.5, True),  # under a speed controller: a constant drive says nothing
    ],
)
def test_a_limit_is_none_if_what_it_leaves_is_not_explained(limit, mean, missing, refused, unit):
    """``missing``: the gap, as a share of what the limit leaves of the drive beside its mean and sign."""
    drive = unit * (mean + np.sin(2 * np.pi * 0.7 * T))
    limit *= abs(unit)
    left = beside_its_sign(limit, drive)[0]
    gap = missing * left + 1e-9 * drive
    model = SimpleNamespace(terms=[SimpleNamespace(kind=SimpleNamespace(code=codes.SATURATION), q=(limit,))])
    view = SimpleNamespace(
        record=SimpleNamespace(drive=drive), gap=lambda m: gap, rms=rms, blur=lambda x: x, at=slice(None)
    )
    assert bool(always_limited(view, model, 0)) == refused


@pytest.mark.parametrize("unit", [1.0, -3.0])
@pytest.mark.parametrize(("rows", "refused"), [(1, True), (20, False)])
def test_a_limit_that_is_reached_in_single_rows_is_none(rows, refused, unit):
    """A drive that a controller changes with every row, and one whose values last for ``rows``."""
    drive = unit * np.repeat(np.random.default_rng(0).standard_normal(T.size // rows), rows)
    model = SimpleNamespace(terms=[SimpleNamespace(kind=SimpleNamespace(code=codes.SATURATION), q=(abs(unit),))])
    view = SimpleNamespace(
        record=SimpleNamespace(drive=drive), gap=lambda m: 0.0 * drive, rms=rms, blur=lambda x: x, at=slice(None)
    )
    assert bool(always_limited(view, model, 0)) == refused


@pytest.mark.parametrize("unit", [1.0, -3.0])
@pytest.mark.parametrize(
    ("terms", "refused"),
    [
        ({"coulomb": 0.3, "saturation": 0.31}, False),
        ({"coulomb": 0.3, "saturation": 0.29}, True),
        ({"coulomb": 0.3, "saturation": 0.29, "gravity_imbalance": 0.1}, False),  # a weight may move the axis
        ({"coulomb": 0.3, "stribeck": 0.69}, False),
        ({"coulomb": 0.3, "stribeck": 0.71}, True),  # the drive reaches 1
        ({"coulomb": 0.3, "stribeck": 0.2, "saturation": 0.4}, True),
    ],
)
def test_a_drive_that_could_never_have_moved_the_axis_is_none(terms, refused, unit):
    drive = unit * np.sin(2 * np.pi * 0.7 * T)
    size = abs(unit)
    model = SimpleNamespace(
        terms=[
            SimpleNamespace(name=n, q=(size * q,), effect=SimpleNamespace(place=get_effect(n).place))
            for n, q in terms.items()
        ]
    )
    last = list(terms).index("saturation" if "saturation" in terms else "stribeck")
    said = never_started(SimpleNamespace(record=SimpleNamespace(drive=drive)), model, last)
    assert bool(said) == refused
    assert never_started(SimpleNamespace(record=SimpleNamespace(drive=drive)), model, 0) == "", "of the base itself"
