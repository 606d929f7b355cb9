"""The numbers of an effect within a simulator: there and back, held in, and grown to where they belong."""

from __future__ import annotations

import numpy as np
import pytest

from tests.gap.plants.example_simulator import RECORD, TIME, Damper, Told
from whsklearn.effects import CableSpring, Cogging, ContactStop
from whsklearn.gap.plants.simulator_model import EffectTerm, SimulatorFit, SimulatorModel

TRAIN = np.arange(TIME.size) % 5 < 3


@pytest.mark.parametrize(
    "term", [EffectTerm(Cogging(0.3, 7.0, 0.4), ("order",)), EffectTerm(CableSpring(0.3, 0.1), ("centre",))]
)
def test_a_vector_is_its_effect(term):
    again = term.with_vector(np.array(term.vector()))
    np.testing.assert_allclose(again.vector(), term.vector(), rtol=1e-12)
    assert len(term.steps()) == len(term.vector())
    twice = term.with_vector(2.0 * np.array(term.vector()))
    assert twice.effect.magnitude == pytest.approx(2.0 * term.effect.magnitude)


@pytest.mark.parametrize("simulator", [Damper, Told], ids=["hidden numbers", "numbers to set"])
def test_grown_beside_the_simulators_own_numbers_a_spring_has_its_stiffness(simulator):
    fits = SimulatorFit(simulator(1.2).refit(RECORD, TRAIN), RECORD, TRAIN, simulator(1.2))
    model = fits.build((), refit=False)
    begin = fits.begun(model, EffectTerm(CableSpring(0.1, 0.0)))
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
    model = SimulatorModel(Damper(), (EffectTerm(CableSpring(0.3, 0.0)),), np.zeros(3))
    assert (model.without(0).simulator, model.without(0).terms) == (None, ())


def test_a_step_changes_no_number_that_is_never_negative_by_more_than_threefold():
    term = EffectTerm(
        ContactStop(10.0, 0.4, relaxation=0.02, centre=0.1, side="both"), ("angle", "relaxation", "centre")
    )
    step = term.held_in(np.array([-50.0, -5.0, 0.5, 4.0]))
    assert step.tolist() == pytest.approx([-50.0, -5.0, 0.04, 4.0])  # only the relaxation is never negative
    assert term.held_in(np.array([0.0, 0.0, -1.0, 0.0]))[2] == pytest.approx(0.02 / 3.0 - 0.02)
