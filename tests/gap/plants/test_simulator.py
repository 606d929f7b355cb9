"""A user's simulator of three methods goes through the same door."""

from __future__ import annotations

import numpy as np
import pytest

from whsklearn.effects import AsymmetricViscous, CableSpring, ContactStop, InputOffset, LuGre
from whsklearn.gap import GapFinder, ServoRecord
from whsklearn.gap.plants.simulator import SimulatorPlant
from whsklearn.gap.plants.simulator_look import catalogue, motion, sized_by_drive
from whsklearn.gap.plants.simulator_model import EffectTerm, SimulatorModel
from whsklearn.gap.standard_errors import errors_of, labelled_errors
from whsklearn.gap.values import Look

TIME = np.arange(8000) * 2e-3
DRIVE = np.sin(3 * TIME) + 0.5 * np.sin(11 * TIME + 1) + 0.3 * np.sin(0.7 * TIME)


class Damper:
    """x' = (u - effects) / b, stepped by Euler: as small as a simulator can be."""

    effects_to_try = (CableSpring(1.0, 0.0), InputOffset(1.0), AsymmetricViscous(1.0))

    def __init__(self, damping=1.0, effects=()):
        self.damping, self.effects = damping, tuple(effects)

    def simulate(self, record):
        x, v, out = 0.0, 0.0, np.empty(len(record))
        for i, u in enumerate(record.drive):
            out[i] = x
            force = 0.0
            for e in self.effects:
                force += {"cable_spring": x, "input_offset": 1.0, "asymmetric_viscous": abs(v)}[e.name] * e.magnitude
            v = (u - force) / self.damping
            x += 2e-3 * v
        return out

    def refit(self, record, keep):
        def error(damping):
            return np.sum((record.position - Damper(damping, self.effects).simulate(record))[keep] ** 2)

        grid = self.damping * np.linspace(0.9, 1.1, 9)
        return Damper(float(grid[np.argmin([error(d) for d in grid])]), self.effects)

    def with_effect(self, effect):
        return Damper(self.damping, (*self.effects, effect))


@pytest.fixture(scope="module")
def record():
    truth = Damper(1.0, (CableSpring(0.3, 0.0),))
    record = ServoRecord(TIME, DRIVE, np.zeros_like(TIME))
    noise = 1e-3 * np.random.default_rng(0).standard_normal(TIME.size)
    return ServoRecord(TIME, DRIVE, truth.simulate(record) + noise)


def test_names_what_the_simulator_lacks(record):
    finder = GapFinder(Damper(), max_effects=1).fit(record)
    assert [c.name for c in finder.diagnosis_.candidates if c.status == "named"] == ["cable_spring"]
    assert finder.diagnosis_.after["rmse"] < 0.5 * finder.diagnosis_.before["rmse"]


def test_complete_simulator_lacks_nothing(record):
    finder = GapFinder(Damper(1.0, (CableSpring(0.3, 0.0),))).fit(record)
    assert (finder.verdict_, finder.effects_) == ("no_gap", [])


class Told(Damper):
    """The same, with its one number to set."""

    refits = 0

    @property
    def parameters(self):
        return {"damping": self.damping}

    @property
    def numbers(self):
        return np.log([self.damping])

    def with_numbers(self, x):
        return Told(float(np.exp(x[0])), self.effects)

    def refit(self, record, keep):
        Told.refits += 1
        return Told(super().refit(record, keep).damping, self.effects)

    def with_effect(self, effect):
        return Told(self.damping, (*self.effects, effect))


def test_numbers_that_can_be_set_have_errors_without_a_refit(record):
    plant = SimulatorPlant(Told(1.2), record, tolerance=0.004)
    base = plant.base(np.random.default_rng(0))
    look = Look("cable_spring", 1.0, (CableSpring(1.0, 0.0),))
    plant.look(base)
    model = plant.refine(base, look)
    spring = model.terms[0].effect
    assert (spring.stiffness, model.simulator.damping) == pytest.approx((0.3, 1.0), rel=2e-3)
    before = Told.refits
    errors = errors_of(plant.linearised(model), plant.parameters)
    of_spring = labelled_errors(plant.linearised(model), 0)
    assert Told.refits == before
    # y moves by about itself when the damping is off by all of itself: noise over root n over that
    rough = 1e-3 / np.std(record.position) / np.sqrt(0.6 * len(record))
    assert rough / 3 < errors["damping"] < 10 * rough
    assert 0 < next(iter(of_spring.values())) < 0.01 * spring.stiffness


def test_two_effects_that_predict_the_same_are_one(record):
    plant = SimulatorPlant(Told(1.2), record, tolerance=0.004)
    base = plant.base(np.random.default_rng(0))
    near, far = (
        SimulatorModel(base.simulator, (), base.error + share * plant.noise * np.ones(len(record)))
        for share in (0.01, 1.0)
    )
    assert (plant.same_signature(base, near), plant.same_signature(base, far)) == (True, False)


def test_further_shapes_are_looked_at_where_a_simulator_asks_for_them(record):
    plain = catalogue(record, motion(record).signals)
    asked = catalogue(record, motion(record).signals, (LuGre, ContactStop))
    assert {type(e) for e in plain["end_stop"]}.isdisjoint({ContactStop})
    stops = [e for e in asked["end_stop"] if isinstance(e, ContactStop)]
    assert {e.side for e in stops} == {"upper", "lower", "both"}
    low, high = record.position.min(), record.position.max()
    assert all(low < end < high for e in stops for end in e.ends if np.isfinite(end))
    assert sum(isinstance(e, LuGre) for e in asked["presliding_hysteresis"]) == 24


def test_a_stop_is_as_stiff_as_the_drive_pushes_against_it(record):
    path = 0.5 * np.sin(2.0 * TIME)
    true = ContactStop(30.0, 0.4, relaxation=0.02)
    velocity, acceleration = np.cos(2.0 * TIME), -2.0 * np.sin(2.0 * TIME)
    drive = 0.05 * acceleration + 0.1 * velocity + true.value(position=path, velocity=velocity)
    m = motion(ServoRecord(TIME, drive, path))
    found = sized_by_drive(m, true.resized(1.0), np.ones(TIME.size, dtype=bool))
    assert found.stiffness == pytest.approx(30.0, rel=0.02)
    assert (found.angle, found.side) == (0.4, "upper")


def test_a_step_changes_no_number_that_is_never_negative_by_more_than_threefold():
    term = EffectTerm(
        ContactStop(10.0, 0.4, relaxation=0.02, centre=0.1, side="both"), ("angle", "relaxation", "centre")
    )
    step = term.held_in(np.array([-50.0, -5.0, 0.5, 4.0]))
    assert step.tolist() == pytest.approx([-50.0, -5.0, 0.04, 4.0])  # only the relaxation is never negative
    assert term.held_in(np.array([0.0, 0.0, -1.0, 0.0]))[2] == pytest.approx(0.02 / 3.0 - 0.02)
