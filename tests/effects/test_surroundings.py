"""Effects that cannot be what a record lacks, whatever they explain."""

from __future__ import annotations

import numpy as np
import pytest

from whsklearn.effects import (
    AsymmetricViscous,
    Backlash,
    CableSpring,
    ContactStop,
    Coulomb,
    DeadZone,
    DisturbanceTone,
    EncoderEccentricity,
    EndStop,
    LuGre,
    ParameterChange,
    PreslidingHysteresis,
    Saturation,
    Stribeck,
    Surroundings,
)

T = np.arange(4000) / 100
DT = 0.01
WAVE = np.sin(2 * np.pi * 0.5 * T) + np.sin(2 * np.pi * 1.3 * T)
UNITS = pytest.mark.parametrize("unit", [1.0, 3.0])


def seen(**changes):
    return Surroundings(np.sin(T), np.cos(T), WAVE, dt=DT)._replace(**changes)


@pytest.mark.parametrize(("hertz", "on_line"), [(0.5, True), (1.3, True), (0.9, False), (2.6, False)])
def test_a_tone_on_a_line_of_the_command_is_not_believed_without_a_drive(hertz, on_line):
    tone, noisy = DisturbanceTone(0.1, hertz), WAVE + 0.01 * np.random.default_rng(0).standard_normal(T.size)
    assert bool(tone.implausible(seen(command=noisy))) == on_line
    assert tone.implausible(seen()) == "", "a measured drive says what the tone does"


@pytest.mark.parametrize(
    ("effect", "spring"),
    [
        (EndStop(1.0, 0.8), False),
        (EndStop(1.0, 0.4), True),
        (ContactStop(1.0, -1.1, side="upper"), True),
        (ContactStop(1.0, 0.8, side="upper"), False),
        (ContactStop(1.0, 1.1, side="lower"), True),
        (ContactStop(1.0, 0.2, side="upper"), True),
        (CableSpring(1.0), False),
    ],
)
def test_a_stop_that_the_axis_touches_most_of_the_time_is_a_spring(effect, spring):
    assert bool(effect.implausible(seen())) == spring


@UNITS
@pytest.mark.parametrize(("rows", "refused"), [(1, True), (20, False)])
def test_a_drive_that_chatters_shows_no_limit_and_no_dead_zone(rows, refused, unit):
    """A drive that a controller changes with every row, and one whose values last for ``rows``."""
    drive = -unit * np.repeat(np.random.default_rng(0).standard_normal(T.size // rows), rows)
    assert bool(Saturation(unit).implausible(seen(drive=drive, limit=unit))) == refused
    assert bool(DeadZone(0.3 * unit).implausible(seen(drive=drive))) == refused
    assert not DeadZone(0.3 * unit).implausible(seen(drive=drive, silent=True)), "the rows are all that acted"


@UNITS
@pytest.mark.parametrize(
    ("sizes", "limit", "refused"),
    [
        ({"coulomb": 0.3}, 0.31, False),
        ({"coulomb": 0.3}, 0.29, True),
        ({"coulomb": 0.3, "stribeck": 0.69}, np.inf, False),
        ({"coulomb": 0.3, "stribeck": 0.71}, np.inf, True),  # the drive reaches 1
        ({"coulomb": 0.3, "stribeck": 0.2}, 0.4, True),
    ],
)
def test_a_drive_that_could_never_have_moved_the_axis_is_none(sizes, limit, refused, unit):
    drive = -unit * np.sin(2 * np.pi * 0.7 * T)
    here = seen(drive=drive, sizes={n: unit * x for n, x in sizes.items()}, limit=unit * limit)
    effect = Stribeck(unit * sizes["stribeck"]) if "stribeck" in sizes else Saturation(unit * limit)
    assert bool(effect.implausible(here)) == refused
    assert effect.implausible(here._replace(carried=True)) == "", "a weight may move the axis"
    assert Coulomb(unit).implausible(here) == "", "of the base itself"


@UNITS
@pytest.mark.parametrize(
    ("coefficient", "coulomb", "velocity", "refused"),
    [
        (0.4, 0.0, np.cos(T), False),  # smaller than the viscous friction
        (0.7, 0.3, np.cos(T), False),  # 0.2 more, which dry friction holds at all speeds
        (0.7, 0.1, np.cos(T), True),
        (-0.7, 0.3, 1.0 + 0.1 * np.cos(T), True),  # one direction does not show the dry friction
    ],
)
def test_friction_drives_no_axis_in_one_direction(coefficient, coulomb, velocity, refused, unit):
    here = seen(velocity=velocity / unit, sizes={"viscous": 0.5 * unit, "coulomb": coulomb})
    assert bool(AsymmetricViscous(coefficient * unit).implausible(here)) == refused


@UNITS
@pytest.mark.parametrize(
    ("parameter", "change", "refused"),
    [("inertia", -1.9, False), ("inertia", -2.1, True), ("viscous", -1.1, True), ("coulomb", 9.0, False)],
)
def test_a_change_leaves_no_inertia_or_friction_far_below_zero(parameter, change, refused, unit):
    here = seen(inertia=unit, sizes={"viscous": 0.5 * unit})
    assert bool(ParameterChange(change * unit, 1.0, parameter).implausible(here)) == refused


@pytest.mark.parametrize(("change", "refused"), [(-0.5, False), (-0.95, True)])
def test_a_change_of_the_gain_leaves_some_of_the_drive(change, refused):
    assert bool(ParameterChange(change, 1.0, "gain").implausible(seen())) == refused


def test_bristles_are_springs_in_any_unit_of_torque():
    """Published with the damping ratio 0.5; a hundred times the inertia damps a tenth as much."""
    critical = 2.0 * np.sqrt(0.01 * 0.1 / 0.4)
    for unit in (1.0, 1e3):
        published, damper = (LuGre(0.4 * unit, 0.01, damping=ratio * critical) for ratio in (0.5, 18.0))
        assert published.implausible(seen(inertia=0.1 * unit)) == ""
        assert "18 times as much as critically" in damper.implausible(seen(inertia=0.1 * unit))
        assert damper.implausible(seen(inertia=10.0 * unit)) == ""


def test_the_reading_follows_the_axis_and_shows_what_it_is_said_to_show():
    assert EncoderEccentricity(0.1, 9.0).implausible(seen()) == ""
    assert EncoderEccentricity(0.1, 11.0).implausible(seen())
    for travel, turns, refused in ((0.2, True, True), (1.0, True, False), (1.0, False, True), (4.0, False, False)):
        here = seen(position=0.5 * travel * np.sin(T), turns=turns)
        assert bool(EncoderEccentricity(0.01, 2.0).implausible(here)) == refused
    assert Backlash(1e-3).implausible(seen(step=9e-4)) == ""
    assert Backlash(1e-3).implausible(seen(step=2e-3))


@pytest.mark.parametrize("law", [PreslidingHysteresis, LuGre])
@pytest.mark.parametrize(("distance", "refused"), [(0.9e-3, True), (1.1e-3, False)])
def test_bristles_give_way_over_more_than_a_step_of_the_encoder(law, distance, refused):
    """Dry friction of MuJoCo had been bristles of 0.7 steps, with certainty, beside a spring."""
    assert bool(law(0.1, distance=distance).implausible(seen(step=1e-3))) == refused
    assert law(0.1, distance=distance).implausible(seen()) == "", "its step is not known"
