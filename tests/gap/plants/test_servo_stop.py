"""Stops at the ends of the travel, and a drive at its limit: what a few events, or the peaks alone, show."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from whsklearn.effects import CableSpring, ContactStop, GravityImbalance, Saturation
from whsklearn.gap import GapFinder
from whsklearn.gap.plants import servo_stop as stop
from whsklearn.gap.plants.servo import ServoPlant
from whsklearn.gap.plants.servo_candidates import usable
from whsklearn.gap.plants.servo_families import settled
from whsklearn.gap.plants.servo_model import ServoTerm
from whsklearn.gap.plants.servo_start import start_of
from whsklearn.gap.record import ServoRecord
from whsklearn.systems import ServoAxis

RATE, SECONDS = 500.0, 20.0
TIME = np.arange(int(RATE * SECONDS)) / RATE
REFERENCE = 1.3 * np.sin(1.1 * TIME) + 0.5 * np.sin(5.1 * TIME + 1) + 0.2 * np.sin(12.3 * TIME) - 2.0  # away from zero
STOPS = {
    "upper": ContactStop(150.0, -0.5, 0.02, side="upper"),
    "lower": ContactStop(150.0, -3.5, 0.02, side="lower"),
    "both": ContactStop(150.0, 1.5, 0.02, centre=-2.0, side="both"),
}


def log_of(*effects, every=1, seconds=SECONDS):
    """A log under a controller that runs, as the log does, at ``RATE / every``."""
    axis = ServoAxis(inertia=0.05, effects=effects, sample_rate=RATE / every)
    return axis.simulate(reference=REFERENCE[: int(RATE * seconds) : every], random_state=1)


def found(r, law="viscous,coulomb"):
    frame = pd.DataFrame({"time_s": r.time, "torque_nm": r.drive, "position_rad": r.position})
    return GapFinder("servo", law=law).fit(frame)


@pytest.mark.parametrize("side", list(STOPS))
def test_a_stop_is_named_with_its_side_and_its_end(side):
    finder = found(log_of(STOPS[side], every=2, seconds=13.0))
    assert [e.name for e in finder.effects_] == ["end_stop"]
    assert finder.effects_[0].effect.side == side
    np.testing.assert_allclose(finder.effects_[0].effect.ends, STOPS[side].ends, atol=0.02)
    assert finder.model_.inertia == pytest.approx(0.05, rel=0.02), "the samples in contact stay out of the fit"
    assert finder.diagnosis_.closure > 0.88
    age = next(b for b in finder.diagnosis_.base_parameters if b["name"].startswith("age"))
    assert abs(age["after"]) < 2.0 * age["after_error"], "the hold of the drive is no age of it"


def test_a_soft_stop_in_a_slow_log_has_its_own_numbers_and_leaves_those_of_the_axis_alone():
    """At 100 Hz its damper had been half a sample, and an inertia 0.9 % off by 13 of its errors."""
    axis = ServoAxis(inertia=0.05, effects=(ContactStop(10.0, -0.5, 0.0, side="upper"),), sample_rate=100.0)
    finder = found(axis.simulate(reference=REFERENCE[::5], random_state=1))
    assert [e.name for e in finder.effects_] == ["end_stop"]
    assert finder.effects_[0].effect.stiffness == pytest.approx(10.0, rel=0.01)
    assert finder.effects_[0].effect.relaxation < 1e-3
    assert finder.model_.inertia == pytest.approx(0.05, rel=0.002)


@pytest.mark.parametrize(
    "effects", [(), (CableSpring(1.0, -2.4),), (Saturation(2.0),)], ids=["plain", "spring", "limit"]
)
def test_no_stop_is_seen_where_there_is_none(effects):
    r = log_of(*effects)
    view, model = start_of(ServoRecord(r.time, r.drive, r.position), ("viscous", "coulomb"), 0.004)
    assert stop.regions(view, model) == []


def test_the_base_numbers_are_those_without_the_stop_and_the_contact_is_the_true_one():
    struck, free = (ServoRecord(r.time, r.drive, r.position) for r in (log_of(STOPS["both"]), log_of()))
    view, model = start_of(struck, ("viscous", "coulomb"), 0.004)
    (term,) = (t for kind in stop.KINDS if (t := stop.start(kind, stop.regions(view, model))))
    model, (_, plain) = stop.settled(view, model, term), start_of(free, ("viscous", "coulomb"), 0.004)
    assert model.inertia == pytest.approx(plain.inertia, rel=2e-3)
    for with_stop, without in zip(model.terms, plain.terms, strict=False):
        assert with_stop.q[0] == pytest.approx(without.q[0], rel=0.01)
    assert model.terms[-1].q == pytest.approx((150.0, 1.5, 0.02, -2.0), rel=0.06)


def test_beside_a_stop_no_look_explains_more_than_is_left_outside_the_contact():
    """A spring was sized by the pushes of a stage's stop: 43 % of the gap, of which 3 % was left."""
    r = log_of(STOPS["upper"], CableSpring(0.3, -2.4), seconds=13.0)
    plant = ServoPlant(ServoRecord(r.time, r.drive, r.position), ("viscous", "coulomb"), None, 0.004)
    base = plant.base(np.random.default_rng(0))
    view = plant.inverse
    (term,) = (t for kind in stop.KINDS if (t := stop.start(kind, stop.regions(view, base))))
    model = stop.settled(view, base, term)
    looks = plant.looks(model, np.random.default_rng(0))
    assert max(k.size for k in looks) <= 1.01 * view.rms(view.gap(model))


def test_a_hard_limit_of_the_drive_is_named():
    finder = found(log_of(Saturation(2.0), every=2, seconds=13.0))
    assert [e.name for e in finder.effects_] == ["saturation"]
    assert finder.effects_[0].effect.limit == pytest.approx(2.0, rel=0.02)


def test_a_stop_beside_a_weight_that_the_model_lacks_is_found_and_both_are_named():
    """The weight was a slow force that the base numbers took up, so that no event stood out."""
    effects = [STOPS["both"], GravityImbalance(4.0, 0.4)]
    frame = log_of(*effects, every=2, seconds=13.0)
    view, model = start_of(ServoRecord(frame.time, frame.drive, frame.position), ("viscous", "coulomb"), 0.004)
    assert {r.side for r in stop.regions(view, model)} == {1, -1}
    finder = found(frame)
    assert {e.name for e in finder.effects_} == {"end_stop", "gravity_imbalance"}


def test_a_stop_is_settled_again_beside_what_is_found_after_it():
    """Its end was that of a fit without the weight."""
    weight, both = GravityImbalance(1.0, 0.4), STOPS["both"]
    frame = log_of(both, weight, every=2, seconds=13.0)
    view, base = start_of(ServoRecord(frame.time, frame.drive, frame.position), ("viscous", "coulomb"), 0.004)
    (term,) = (t for kind in stop.KINDS if (t := stop.start(kind, stop.regions(view, base))))
    (kind,) = (c for c in usable([]) if c.name == "gravity_imbalance")
    model = view.fit(stop.settled(view, base, term).with_term(ServoTerm(kind, (0.0, 0.0))))
    again = settled(view, model)
    assert stop.unexplained(view, again) < stop.unexplained(view, model)
    off = [np.abs(np.subtract(m.terms[2].effect.ends, both.ends)).max() for m in (model, again)]
    assert off[1] <= off[0]
