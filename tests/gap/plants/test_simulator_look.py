"""The motion and the shapes that are looked at; what each explains, in the record and in the simulator's own."""

from __future__ import annotations

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest

from tests.gap.plants.example_simulator import RECORD, TIME, Damper, Told
from whsklearn.effects import CableSpring, Cogging, ContactStop, DisturbanceTone, EndStop, LuGre
from whsklearn.gap import ServoRecord
from whsklearn.gap.calibration import coloured, smoothed_power
from whsklearn.gap.plants.simulator import SimulatorPlant
from whsklearn.gap.plants.simulator_look import (
    Errors,
    accelerations,
    addable,
    catalogue,
    followed_motion,
    gone,
    noise_of,
    own_errors,
    sized_by_drive,
    slopes,
)
from whsklearn.gap.tangent import with_p_values


def test_the_smoothed_motion_of_a_wave_is_the_wave_and_its_derivatives():
    m = followed_motion(ServoRecord(TIME, np.cos(TIME), np.sin(2.0 * TIME)))
    inside = slice(500, -500)
    s = m.signals
    np.testing.assert_allclose(s.position[inside], np.sin(2.0 * TIME)[inside], atol=1e-3)
    np.testing.assert_allclose(s.velocity[inside], 2.0 * np.cos(2.0 * TIME)[inside], atol=2e-3)
    np.testing.assert_allclose(s.acceleration[inside], -4.0 * np.sin(2.0 * TIME)[inside], atol=4e-3)


def test_further_shapes_are_looked_at_where_a_simulator_asks_for_them():
    plain = catalogue(RECORD, followed_motion(RECORD).signals)
    asked = catalogue(RECORD, followed_motion(RECORD).signals, (LuGre, ContactStop))
    assert {type(e) for e in plain["end_stop"]}.isdisjoint({ContactStop})
    stops = [e for e in asked["end_stop"] if isinstance(e, ContactStop)]
    assert {e.side for e in stops} == {"upper", "lower", "both"}
    low, high = RECORD.position.min(), RECORD.position.max()
    assert all(low < end < high for e in stops for end in e.ends if np.isfinite(end))
    assert sum(isinstance(e, LuGre) for e in asked["presliding_hysteresis"]) == 3 * len(
        LuGre.quantities["distance"].starts
    )


def test_an_effect_occurs_once_unless_it_repeats():
    plant = SimpleNamespace(shapes={"cable_spring": [CableSpring(1.0)], "cogging": [Cogging(0.1, 6.0)]})
    there = SimpleNamespace(terms=[SimpleNamespace(name=name) for name in plant.shapes])
    assert [name for name, _ in addable(plant, there)] == ["cogging"]
    assert [name for name, _ in addable(plant, SimpleNamespace(terms=[]))] == ["cable_spring", "cogging"]


def test_a_stop_is_as_stiff_as_the_drive_pushes_against_it():
    path = 0.5 * np.sin(2.0 * TIME)
    true = ContactStop(30.0, 0.4, relaxation=0.02)
    velocity, acceleration = np.cos(2.0 * TIME), -2.0 * np.sin(2.0 * TIME)
    drive = 0.05 * acceleration + 0.1 * velocity + true.value(position=path, velocity=velocity)
    m = followed_motion(ServoRecord(TIME, drive, path))
    found = sized_by_drive(m, true.resized(1.0), np.ones(TIME.size, dtype=bool))
    assert found.stiffness == pytest.approx(30.0, rel=0.02)
    assert (found.angle, found.side) == (0.4, "upper")


def test_what_is_gone_is_told_as_a_share_of_the_acceleration():
    record = ServoRecord(TIME, np.cos(TIME), np.sin(2.0 * TIME))
    error = 1e-3 * np.sin(20.0 * TIME)  # a hundred times the share in the acceleration that it has in the position
    assert gone(followed_motion(record), error, np.zeros_like(error), record) == pytest.approx(0.1, rel=0.05)
    assert gone(followed_motion(record), np.zeros_like(error), error, record) == 0.0


def test_a_hole_is_no_acceleration():
    torn = ServoRecord(RECORD.time + np.where(TIME < 2.0, 0.0, 5.0), RECORD.drive,
                       RECORD.position + np.where(TIME < 2.0, 0.0, 3.0), starts=(int(np.sum(TIME < 2.0)),))  # fmt: skip
    whole, seen = followed_motion(RECORD), followed_motion(torn)
    assert 0.8 * whole.usable.sum() < seen.usable.sum() < whole.usable.sum()
    both = seen.usable & whole.usable
    a, b = (m.seen(r.position, 2)[both] for m, r in ((whole, RECORD), (seen, torn)))
    np.testing.assert_allclose(b, a, atol=1e-6 * np.abs(a).max())
    assert seen.signals.time[-1] == pytest.approx(TIME[-1] + 5.0)
    assert [len(r) for r in torn.segments] == [torn.starts[0], TIME.size - torn.starts[0]]
    assert RECORD.segments[0] is RECORD


def looked(torque, shapes, noise=1e-4, seed=0):
    """(p of every look by name, the smallest of nameless ones) of a free mass that a torque pushes beside noise."""
    path = 0.5 * np.sin(2.0 * TIME) + 0.2 * np.sin(5.3 * TIME)
    rng = np.random.default_rng(seed)
    error = np.cumsum(np.cumsum(torque(path) - torque(path).mean())) * (TIME[1] - TIME[0]) ** 2
    error = error + noise * rng.standard_normal(TIME.size)
    plant = SimulatorPlant(Told(1.0), dataclasses.replace(RECORD, position=path + error), tolerance=0.004)
    base = plant.base(rng)
    plant._shapes = {e.name: [e] for e in shapes}
    seen = Errors.of(plant, dataclasses.replace(base, error=error), rng)
    found = with_p_values(list(accelerations(plant, seen)))
    return {k.name: k.p_value for k in found if k.name}, min(k.p_value for k in found if not k.name)


def test_of_two_effects_the_one_that_is_missing_is_shown():
    named, nameless = looked(lambda q: np.maximum(q - 0.3, 0.0), [EndStop(1.0, 0.3), Cogging(1.0, 7.0)])
    assert named["end_stop"] < 1e-6
    assert named["end_stop"] < 1e-3 * named["cogging"]
    assert nameless < 1e-6


@pytest.mark.parametrize("seed", range(3))
def test_noise_shows_nothing(seed):
    named, nameless = looked(np.zeros_like, [EndStop(1.0, 0.3), Cogging(1.0, 7.0)], seed=seed)
    assert min(*named.values(), nameless) > 0.01


def test_a_tone_is_told_although_the_error_that_it_makes_is_one():
    tone = DisturbanceTone(1.0, 3.0, 0.0)
    named, _ = looked(lambda q: np.cos(2 * np.pi * 3.0 * TIME), [tone, Cogging(1.0, 7.0)])
    # among the lines of the record and of all null rows, which is a scan
    assert named["disturbance_tone"] < 1e-3 < 0.01 < named["cogging"]


def test_a_common_law_is_shown_by_simulation():
    position = Damper(1.0, (CableSpring(0.05, 0.0),)).simulate(RECORD)
    rng = np.random.default_rng(0)
    record = dataclasses.replace(RECORD, position=position + 1e-3 * rng.standard_normal(TIME.size))
    plant = SimulatorPlant(Told(1.0), record, tolerance=0.004)
    found = with_p_values(list(slopes(plant, Errors.of(plant, plant.base(rng), rng))))
    assert {k.name for k in found} == {"cable_spring", "input_offset", "asymmetric_viscous"}
    assert min(found, key=lambda k: k.p_value).name == "cable_spring"
    assert min(k.p_value for k in found) < 1e-3


def test_noise_is_taken_off_a_motion_and_a_slow_error_is_not():
    rng = np.random.default_rng(0)
    noise, slow = 1e-3 * rng.standard_normal(TIME.size), 0.05 * np.sin(0.5 * TIME)
    taken = noise_of(noise + slow, 1e-3)
    assert np.std(taken - noise) < 0.4 * np.std(noise)
    assert np.std(noise_of(noise, 1e-3) - noise) < 0.1 * np.std(noise)


def test_a_hardening_spring_is_looked_for_about_other_centres_than_that_of_the_travel():
    """A cubic about the middle of the travel explained nothing of one about its end, and an end stop was named."""
    springs = catalogue(RECORD, followed_motion(RECORD).signals)["hardening_spring"]
    centres = {e.centre for e in springs}
    assert len(centres) > 2
    assert np.ptp(list(centres)) > 0.5 * 0.5 * np.ptp(RECORD.position)


def test_own_records_have_the_roundings_of_an_axis_that_rests():
    """At rest the reading errs by one amount for as long, and so do the records that the model makes."""
    t, step = np.arange(4000) / 200.0, 1e-3
    path = 0.1 * np.sin(np.clip(t % 5.0, 0.0, 2.1) * 0.4 * np.pi)
    position = step * np.round(path / step)
    plant = SimpleNamespace(record=ServoRecord(t, np.ones_like(t), position), noise=step / 12**0.5)
    null = own_errors(plant, SimpleNamespace(error=position - path), np.random.default_rng(0))
    rest = (t % 5.0 > 3.0) & (t % 5.0 < 4.5)
    spectrum_alone = coloured(smoothed_power(position - path), null.shape, np.random.default_rng(0))
    assert np.std(null) == pytest.approx(np.std(spectrum_alone), rel=0.3)
    ours, theirs = (np.abs(np.mean((x * (position - path))[:, rest])) for x in (null, spectrum_alone))
    assert ours > 0.5 * np.mean((position - path)[rest] ** 2) > 5.0 * theirs
