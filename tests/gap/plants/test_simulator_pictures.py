"""Series of a simulator's page: thinned alike, before and after."""

from __future__ import annotations

import numpy as np

from tests.gap.plants.example_simulator import RECORD, Told
from whsklearn.effects import CableSpring
from whsklearn.gap.plants.simulator import SimulatorPlant
from whsklearn.gap.plants.simulator_model import EffectTerm
from whsklearn.gap.plants.simulator_pictures import pictures, signals


def test_series_are_of_one_length_and_runs_those_of_the_models():
    plant = SimulatorPlant(Told(1.0), RECORD, tolerance=0.004)
    base = plant.base(np.random.default_rng(0))
    model = plant.fits.build((EffectTerm(CableSpring(0.3, 0.0)),))
    shown = pictures(plant, base, model)
    np.testing.assert_allclose(shown["runs"]["after"], model.simulator.simulate(RECORD))
    n = shown["gap_time"].size
    assert {x.size for x, _ in signals(plant).values()} == {n, shown["gap_before"].size}
    assert np.std(shown["gap_after"]) < 0.5 * np.std(shown["gap_before"])
    assert len(shown["spectrum"]) == len(shown["order_spectrum"]) == 2
    np.testing.assert_array_equal(shown["held"], ~plant.train)
