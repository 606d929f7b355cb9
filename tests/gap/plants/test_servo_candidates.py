"""Candidates are what the effects say of themselves, and one of a user's own is among them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import pytest

from tests.own_effect import Magnet
from whsklearn.effects import Scales
from whsklearn.effects import base as registry
from whsklearn.gap.plants.servo_candidates import TypicalMotion, candidate, catalogue, usable

SCALES = Scales(torque=0.5, peak=1.4, speed=2.0, reach=2.5, centre=0.3, duration=40.0, inertia=0.05, resonance=90.0)
LINEAR = [c for c in catalogue() if c.linear and c.cls.port != "output"]


@pytest.fixture
def magnet(monkeypatch):
    """The example of the docstring, in the catalogue for one test."""
    monkeypatch.setattr(registry, "_REGISTRY", dict(registry._REGISTRY))

    @dataclass(frozen=True)
    class Listed(Magnet):
        name: ClassVar[str] = "magnet"
        place: ClassVar[str] = "position"

    return Listed


def test_an_effect_of_ones_own_is_a_candidate(magnet):
    (own,) = [c for c in usable([]) if c.cls is magnet]
    assert (own.linear, own.fields, own.driven) == (1, ("torque", "width"), False)
    assert own.size_unit(SCALES) == pytest.approx(SCALES.torque, rel=0.05)
    assert own.effect(np.array([0.2, 0.3])) == magnet(0.2, 0.3)


@pytest.mark.parametrize("kind", LINEAR, ids=lambda c: c.label)
def test_at_its_size_unit_an_effect_is_as_large_as_the_drive(kind):
    signals, unit = TypicalMotion(SCALES), kind.size_unit(SCALES)
    tops = [unit * np.abs(kind.unit_columns(s, signals)).max() for s in kind.starts(SCALES)]
    assert max(tops) >= SCALES.torque * (1 - 1e-9), "no start asks for more"
    assert min(t for t in tops if t > 0.01 * max(tops)) == pytest.approx(SCALES.torque)


def test_what_holds_the_drive_is_asked_of_the_equation():
    driven = {c.label for c in catalogue() if c.linear and c.driven}
    assert driven == {"load_friction", "torque_ripple", "parameter_change[gain]"}


@pytest.mark.parametrize("reach", [0.05, 0.5, 3.0])
def test_a_wave_over_the_place_is_sought_from_a_quarter_of_its_period_on(reach):
    """Over less it is a line. From a whole one on, a cogging over half of one was gravity and a hardening spring."""
    scales = Scales(reach=reach)
    for name in ("cogging", "encoder_eccentricity", "position_friction"):
        low, high = candidate(name).ranged(scales)[0]
        assert low * 2.0 * reach >= 0.5 * np.pi * (1.0 - 1e-12)
        assert low < 1.01 * max(0.25 * np.pi / reach, candidate(name).cls.quantities["order"].low)
        assert high > low


def test_what_modifies_friction_waits_for_it():
    names = {c.name for c in usable([])}
    assert "coulomb" in names
    assert "load_friction" in names  # a gear rubs under its load whether or not it does so without
    assert not names & {"stribeck", "position_friction"}
    assert {"stribeck", "position_friction"} <= {c.name for c in usable([candidate("coulomb")])}


def test_a_spring_whose_place_of_rest_is_free_leaves_no_constant_to_find():
    assert "input_offset" in {c.name for c in usable([])}
    assert not {c.name for c in usable([candidate("cable_spring")])} & {"input_offset", "asymmetric_coulomb"}


def test_one_transmission_and_one_of_a_name_but_several_waves():
    taken = [candidate("backlash"), candidate("cogging"), candidate("gravity_imbalance")]
    names = {c.name for c in usable(taken)}
    assert "cogging" in names
    assert not names & {"backlash", "flexible_coupling", "gravity_imbalance"}


@pytest.mark.parametrize("kind", catalogue(), ids=lambda c: c.label)
def test_starts_lie_in_their_range_and_make_an_effect(kind):
    ranges = kind.ranged(SCALES)
    for shape in kind.starts(SCALES):
        assert all(a <= x <= b for x, (a, b) in zip(shape, ranges, strict=True))
        kind.effect(np.array([*[0.1] * kind.linear, *shape]))


def test_lugre_is_sought_beside_dahl_with_its_level_held_until_it_is_taken():
    dahl, lugre = (c for c in catalogue() if c.name == "presliding_hysteresis")
    assert dahl.label != lugre.label
    assert [lugre.fields[lugre.linear + i] for i in lugre.held] == ["ratio", "velocity"]
    row = (0.3, *lugre.starts(SCALES)[0])
    opened = lugre.opened(row, SCALES)
    assert all(kind.held == () and kind.later == () for kind, _ in opened)
    assert {q[2] for _, q in opened} == {1.5}  # at 1 the speed of the fall would move nothing
    assert len({q[3] for _, q in opened}) == 3
    assert all(q[:2] == row[:2] and q[4] == row[4] for _, q in opened)
    assert dahl.opened((0.3, 0.01), SCALES) == []


def test_forces_of_the_place_are_known_by_their_equation():
    of_place = {c.name for c in catalogue() if c.of_place and c.cls.__module__.startswith("whsklearn")}
    assert of_place == {"gravity_imbalance", "cable_spring", "hardening_spring", "end_stop"}


def test_laws_of_one_signal_are_known_by_their_equation():
    signal = {c.name: c.signal for c in catalogue() if c.cls.__module__.startswith("whsklearn")}
    assert {n for n, s in signal.items() if s == "velocity"} >= {"stribeck", "quadratic_drag", "viscous", "coulomb"}
    assert {n for n, s in signal.items() if s == "position"} >= {"cogging", "cable_spring", "gravity_imbalance"}
    several = ("load_friction", "presliding_hysteresis", "position_friction", "disturbance_tone", "saturation")
    assert all(signal[n] == "" for n in several)
