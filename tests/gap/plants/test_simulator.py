"""A user's simulator of three methods goes through the same door; what its page draws."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from tests.gap.plants.example_simulator import RECORD, Damper, Told
from whsklearn.effects import CableSpring, Coulomb, PreslidingHysteresis
from whsklearn.gap import GapFinder
from whsklearn.gap.plants.simulator import SimulatorPlant, pictures, signals
from whsklearn.gap.plants.simulator_model import EffectTerm, SimulatorModel
from whsklearn.gap.standard_errors import errors_of, labelled_errors
from whsklearn.gap.tangent import Look


def test_names_what_the_simulator_lacks():
    finder = GapFinder(Damper(), max_effects=1).fit(RECORD)
    assert [c.name for c in finder.diagnosis_.candidates if c.status == "named"] == ["cable_spring"]
    assert finder.diagnosis_.after["rmse"] < 0.5 * finder.diagnosis_.before["rmse"]


class Rubs:
    """The damper with dry friction, the one effect that it accepts; it leaves to the finder what to try."""

    def __init__(self, dry=()):
        self.dry = tuple(dry)

    def simulate(self, record):
        dry = sum(e.magnitude for e in self.dry)
        velocity = record.drive - np.clip(record.drive, -dry, dry)
        return np.r_[0.0, np.cumsum(record.dt * velocity)[:-1]]

    def refit(self, record, keep):
        return self

    def with_effect(self, effect):
        if effect.name != "coulomb":
            raise NotImplementedError("only dry friction")
        return Rubs((*self.dry, effect))


def test_friction_that_a_simulator_lacks_is_tried_without_being_asked_for():
    measured = Rubs([Coulomb(0.1)]).simulate(RECORD) + 1e-3 * np.random.default_rng(0).standard_normal(len(RECORD))
    finder = GapFinder(Rubs()).fit(dataclasses.replace(RECORD, position=measured))
    assert finder.verdict_ == "named"
    assert [e.parameters for e in finder.effects_] == [{"torque_nm": pytest.approx(0.1, rel=0.01)}]


def test_complete_simulator_lacks_nothing():
    finder = GapFinder(Damper(1.0, (CableSpring(0.3, 0.0),))).fit(RECORD)
    assert (finder.verdict_, finder.effects_) == ("no_gap", [])


def test_numbers_that_can_be_set_have_errors_without_a_refit():
    plant = SimulatorPlant(Told(1.2), RECORD, tolerance=0.004)
    base = plant.base(np.random.default_rng(0))
    look = Look("cable_spring", 1.0, np.zeros(2), (CableSpring(1.0, 0.0),))
    model = plant.refine(base, look)
    spring = model.terms[0].effect
    assert (spring.stiffness, model.simulator.damping) == pytest.approx((0.3, 1.0), rel=2e-3)
    before = Told.refits
    errors = errors_of(plant.linearised(model), lambda m: {k: v for k, (v, _) in plant.numbers(m).items()})
    of_spring = labelled_errors(plant.linearised(model), 0)
    assert Told.refits == before
    # y moves by about itself when the damping is off by all of itself: noise over root n over that
    rough = 1e-3 / np.std(RECORD.position) / np.sqrt(0.6 * len(RECORD))
    assert rough / 3 < errors["damping"] < 10 * rough
    assert 0 < next(iter(of_spring.values())) < 0.01 * spring.stiffness


def test_a_simulator_that_lacks_nothing_more_leaves_noise():
    plant = SimulatorPlant(Told(1.0), RECORD, tolerance=0.004)
    base = plant.base(np.random.default_rng(0))
    half = plant.fits.build((EffectTerm.of(CableSpring(0.15, 0.0)),))
    whole = plant.refine(base, Look("cable_spring", 1.0, np.zeros(2), (CableSpring(1.0, 0.0),)))
    assert [plant.complete(base.error, m) for m in (base, half, whole)] == [False, False, True]


def test_series_are_of_one_length_and_runs_those_of_the_models():
    plant = SimulatorPlant(Told(1.0), RECORD, tolerance=0.004)
    base = plant.base(np.random.default_rng(0))
    model = plant.fits.build((EffectTerm.of(CableSpring(0.3, 0.0)),))
    shown = pictures(plant, base, model)
    np.testing.assert_allclose(shown["runs"]["after"], model.simulator.simulate(RECORD))
    n = shown["gap_time"].size
    assert {x.size for x, _ in signals(plant).values()} == {n, shown["gap_before"].size}
    assert np.std(shown["gap_after"]) < 0.5 * np.std(shown["gap_before"])
    assert len(shown["spectrum"]) == len(shown["order_spectrum"]) == 2
    np.testing.assert_array_equal(shown["held"], ~plant.train)


def test_bristles_within_a_step_of_the_encoder_are_dry_friction():
    step = 1e-3
    log = dataclasses.replace(RECORD, position=step * np.round(RECORD.position / step))
    plant = SimulatorPlant(Damper(), log, tolerance=0.004)

    def said(distance):
        bristles = EffectTerm.of(PreslidingHysteresis(0.1, distance))
        return plant.objection(None, SimulatorModel(None, (bristles,)))

    assert said(0.2 * step) == "it builds up within one step of the encoder"
    assert said(5.0 * step) == ""
