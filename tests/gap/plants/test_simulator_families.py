"""What a simulator lacks stands out of its own records; noise, and what its own numbers can do, do not."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from tests.gap.plants.example_simulator import RECORD, TIME, Damper, Told
from whsklearn.effects import CableSpring, Cogging, DisturbanceTone, EndStop
from whsklearn.gap.plants.simulator import SimulatorPlant
from whsklearn.gap.plants.simulator_families import Seen, accelerations, noise_of, slopes
from whsklearn.gap.tangent import with_p_values


def looked(torque, shapes, noise=1e-4, seed=0):
    """(p of every look by name, the smallest of nameless ones) of a free mass that a torque pushes beside noise."""
    path = 0.5 * np.sin(2.0 * TIME) + 0.2 * np.sin(5.3 * TIME)
    rng = np.random.default_rng(seed)
    error = np.cumsum(np.cumsum(torque(path) - torque(path).mean())) * (TIME[1] - TIME[0]) ** 2
    error = error + noise * rng.standard_normal(TIME.size)
    plant = SimulatorPlant(Told(1.0), dataclasses.replace(RECORD, position=path + error), tolerance=0.004)
    base = plant.base(rng)
    plant._shapes = {e.name: [e] for e in shapes}
    seen = Seen.of(plant, dataclasses.replace(base, error=error), rng)
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
    assert named["disturbance_tone"] < 1e-6 < 0.01 < named["cogging"]


def test_a_common_law_is_shown_by_simulation():
    position = Damper(1.0, (CableSpring(0.05, 0.0),)).simulate(RECORD)
    rng = np.random.default_rng(0)
    record = dataclasses.replace(RECORD, position=position + 1e-3 * rng.standard_normal(TIME.size))
    plant = SimulatorPlant(Told(1.0), record, tolerance=0.004)
    found = with_p_values(list(slopes(plant, Seen.of(plant, plant.base(rng), rng))))
    assert {k.name for k in found} == {"cable_spring", "input_offset", "asymmetric_viscous"}
    assert min(found, key=lambda k: k.p_value).name == "cable_spring"
    assert min(k.p_value for k in found) < 1e-3


def test_noise_is_taken_off_a_motion_and_a_slow_error_is_not():
    rng = np.random.default_rng(0)
    noise, slow = 1e-3 * rng.standard_normal(TIME.size), 0.05 * np.sin(0.5 * TIME)
    taken = noise_of(noise + slow, 1e-3)
    assert np.std(taken - noise) < 0.4 * np.std(noise)
    assert np.std(noise_of(noise, 1e-3) - noise) < 0.1 * np.std(noise)
