"""A simulator with effects: its numbers, its fits with the numbers of an effect."""

from __future__ import annotations

import numpy as np
import pytest

from tests.gap.plants.example_simulator import RECORD, TIME, Damper, Told
from whsklearn.effects import CableSpring, Cogging, EndStop, HardeningSpring, InputOffset, Saturation, Scales, Stribeck
from whsklearn.gap import ServoRecord
from whsklearn.gap.plants.simulator import SimulatorPlant
from whsklearn.gap.plants.simulator_model import EffectTerm, SimulatorFit, SimulatorModel, refine, sized, sizes
from whsklearn.gap.tangent import Look

TRAIN = np.arange(TIME.size) % 5 < 3


@pytest.mark.parametrize("term", [EffectTerm.of(Cogging(0.3, 7.0, 0.4)), EffectTerm.of(CableSpring(0.3, 0.1))])
def test_a_vector_is_its_effect(term):
    again = term.with_vector(np.array(term.vector()))
    np.testing.assert_allclose(again.vector(), term.vector(), rtol=1e-12)
    assert len(term.steps()) == len(term.vector())
    n = term.kind.linear
    twice = term.with_vector(np.concatenate([2.0 * np.array(term.vector()[:n]), term.vector()[n:]]))
    assert twice.effect.magnitude == pytest.approx(2.0 * term.effect.magnitude)


@pytest.mark.parametrize("simulator", [Damper, Told], ids=["hidden numbers", "numbers to set"])
def test_grown_beside_the_simulators_own_numbers_a_spring_has_its_stiffness(simulator):
    fits = SimulatorFit(simulator(1.2).refit(RECORD, TRAIN), RECORD, TRAIN, simulator(1.2))
    model = fits.build((), refit=False)
    begin = fits.begun(model, EffectTerm.of(CableSpring(0.1, 0.0)))
    grown = fits.grow(model, begin, lambda error: error[TRAIN], again=True)
    assert grown.terms[0].effect.stiffness == pytest.approx(0.3, rel=0.05)
    assert np.std(grown.error) < 0.5 * np.std(begin.error)


def test_a_run_that_diverges_has_a_finite_error():
    class Lost(Damper):
        def simulate(self, record):
            return np.full(len(record), np.nan)

    error = SimulatorFit(None, RECORD, TRAIN).error(Lost())
    assert np.all(np.isfinite(error))
    assert np.min(np.abs(error)) > 100.0 * np.ptp(RECORD.position)


def test_a_simulator_that_gives_another_length_is_told_so():
    class Short(Damper):
        def simulate(self, record):
            return np.zeros(3)

    with pytest.raises(ValueError, match="one value per sample"):
        SimulatorFit(None, RECORD, TRAIN).error(Short())


def test_a_model_without_a_term_is_built_anew():
    model = SimulatorModel(Damper(), (EffectTerm.of(CableSpring(0.3, 0.0)),), np.zeros(3))
    assert (model.without(0).simulator, model.without(0).terms) == (None, ())


def test_a_number_that_is_never_negative_stays_positive_and_within_what_a_record_can_show():
    term = EffectTerm.of(EndStop(10.0, 0.4))
    (_, low), (_, high) = term.bounds(Scales(reach=0.5))
    assert np.exp(low) < 0.4 < np.exp(high)
    assert term.with_vector(np.array([10.0, -50.0])).effect.angle > 0.0
    far = EffectTerm.of(EndStop(10.0, 40.0))  # where a user's own start is, is never out of range
    assert far.bounds(Scales(reach=0.5))[1][1] >= np.log(40.0)


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
    found = sizes(plant, model, start)[0]
    assert found == (start if start.quantities[start.size].low >= 0.0 else sized(plant, model, start))
    by_slope, by_drive = sizes(plant, model, InputOffset(1.0))
    assert InputOffset(1.0) not in (by_slope, by_drive)  # free in sign, so it is taken as the slope has it


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


def test_all_numbers_are_free_but_counts_and_fields_that_the_simulator_fixes():
    assert EffectTerm.of(Stribeck(1.0, 0.1, 2.0)).free == (0, 1, 2)
    assert EffectTerm.of(HardeningSpring(1.0, 0.2)).free == (0, 1)
    assert EffectTerm.of(Cogging(1.0, 6.0), ("order",)).free == (0, 1)
    assert EffectTerm.of(Saturation(0.8)).free == (0,)
