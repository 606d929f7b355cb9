"""An effect brought to its size within a simulator, before its numbers are fitted."""

from __future__ import annotations

import numpy as np
import pytest

from tests.gap.plants.example_simulator import RECORD, Damper, Told
from whsklearn.effects import CableSpring, Cogging, InputOffset
from whsklearn.gap import ServoRecord
from whsklearn.gap.plants.simulator import SimulatorPlant
from whsklearn.gap.plants.simulator_refine import movable, refine, sized, sizes
from whsklearn.gap.tangent import Look


def plant_of(spring):
    """A plant whose simulator lacks a spring, and its base model."""
    position = Damper(1.0, (CableSpring(spring, 0.0),)).simulate(RECORD)
    plant = SimulatorPlant(Told(1.0), ServoRecord(RECORD.time, RECORD.drive, position), tolerance=0.004)
    model = plant.base(np.random.default_rng(0))
    plant.tune(model.error)
    return plant, model


@pytest.mark.parametrize("given", [0.02, 1.0, 30.0])
@pytest.mark.parametrize("true", [0.01, -0.01])
def test_the_size_is_the_small_missing_ones_whatever_the_start_has(given, true):
    found = sized(*plant_of(true), CableSpring(given, 0.0))
    assert found.stiffness == pytest.approx(true, rel=0.2)  # one linear step


def test_a_size_that_cannot_be_negative_keeps_its_start():
    plant, model = plant_of(-0.05)
    start = CableSpring(1.0, 0.0)
    (found,) = sizes(plant, model, start)
    assert found == (start if start.quantities[start.size].low >= 0.0 else sized(plant, model, start))
    (offset,) = sizes(plant, model, InputOffset(1.0))
    assert offset != InputOffset(1.0)  # free in sign, so it is taken as the slope has it


def test_an_effect_that_the_simulator_cannot_hold_is_refused_and_leaves_the_model():
    class Closed(Told):
        def with_effect(self, effect):
            raise NotImplementedError("no such part")

        def with_numbers(self, x):
            return self

        def refit(self, record, keep):
            return self

    closed = SimulatorPlant(Closed(1.0), RECORD, tolerance=0.004)
    model = closed.base(np.random.default_rng(0))
    same = refine(closed, model, Look("cogging", 1.0, np.zeros(2), (Cogging(1.0, 3.0),)))
    assert closed.refused == {"cogging": "no such part"}
    assert same.terms[-1].effect.magnitude == 0.0
    np.testing.assert_array_equal(same.error, model.error)
    assert "cannot hold" in closed.objection(model, same)


def test_exponents_and_counts_stay():
    assert [movable(f) for f in ("order", "exponent", "elements", "centre")] == [True, False, False, True]
