"""A force of the place in free swings: nothing to inverse dynamics, nearly all to the acceleration given the drive."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from whsklearn import ServoAxis
from whsklearn.effects import CableSpring, Coulomb, FrictionLaw, GravityImbalance, Viscous
from whsklearn.gap import GapFinder
from whsklearn.gap.calibration import n_effective
from whsklearn.gap.plants import servo_families
from whsklearn.gap.plants.servo import ServoPlant
from whsklearn.gap.plants.servo_start import start_of
from whsklearn.gap.record import ServoRecord
from whsklearn.gap.tangent import Family
from whsklearn.systems import PIDController

RATE, SECONDS = 300.0, 20.0
LAW = ("viscous", "coulomb")


def swings(*effects, seed=0):
    """A log of an axis that nobody holds: pushes far below what swings, read by a coarse encoder with some noise."""
    rng = np.random.default_rng(seed)
    n = int(RATE * SECONDS)
    push = np.repeat(rng.standard_normal(n // 60), 60) * 0.3
    axis = ServoAxis(inertia=0.15, law=FrictionLaw([Viscous(0.02), Coulomb(0.02)]), effects=effects, sample_rate=RATE)
    run = axis.simulate_drive(push, initial_position=1.2)
    return pd.DataFrame(
        {"time_s": run.time, "torque_nm": run.drive, "position_rad": run.position + 1e-3 * rng.standard_normal(n)}
    )


def view_of(frame):
    return start_of(ServoRecord.from_frame(frame), LAW, 0.004)


@pytest.mark.parametrize("effect", [GravityImbalance(2.8), CableSpring(2.8)])
def test_what_swings_is_told_by_the_acceleration(effect):
    view, model = view_of(swings(effect))
    left = servo_families.acceleration_left(view, model)
    a, _ = servo_families.regression(view, model)
    assert np.std(left) > 0.8 * np.std(a), "the drive says next to nothing of the acceleration"
    tangent = servo_families.acceleration_tangent(view, model, np.random.default_rng(0))
    assert tangent.power[0] == pytest.approx(np.sum(left**2), rel=1e-6)
    column = view.blur(effect.contribution(view.motion))[view.at]
    power = tangent.taken(Family("one", lambda _: iter(()), lambda *_: None), column[:, None, None])[0]
    assert power[0, 0] > 0.9 * tangent.power[0]


def test_gravity_of_a_free_pendulum_is_named_first():
    finder = GapFinder("servo", max_effects=1).fit(swings(GravityImbalance(2.8)))
    first = finder.effects_[0]
    assert "gravity_imbalance" in (first.name, *first.aliases)


def test_both_directions_leave_the_same_of_a_model_that_is_whole():
    frame = swings(seed=3)
    view, model = view_of(frame)
    a, _ = servo_families.regression(view, model)
    inverse, swapped = view.gap(model), servo_families.acceleration_left(view, model)
    drive = view.drive[view.at]
    # of one regression the share that is left is one less the squared correlation, whichever way round
    assert np.var(swapped) / np.var(a) == pytest.approx(np.var(inverse) / np.var(drive), abs=0.05)


def test_a_model_gains_nothing_over_itself():
    view, model = view_of(swings(GravityImbalance(2.8)))
    assert servo_families.explained_acceleration(view, model, model) == (0.0, 0.0)


def test_own_noise_has_the_colour_of_what_is_left():
    view, model = view_of(swings(GravityImbalance(2.8)))
    tangent = servo_families.acceleration_tangent(view, model, np.random.default_rng(0))
    assert np.mean(tangent.null.std(axis=1)) == pytest.approx(np.std(tangent.left), rel=0.1)
    counts = [n_effective(row) for row in tangent.null]
    assert 0.3 < np.median(counts) / n_effective(tangent.left) < 3.0


@pytest.mark.parametrize("seed", [0, 2])
def test_noise_in_the_reading_of_the_drive_is_no_gravity(seed):
    """It leaves the acceleration unexplained, too; a force of the place explains that, and nothing of the drive."""
    rng = np.random.default_rng(seed)
    time = np.arange(3000) / 100.0
    law, controller = FrictionLaw([Viscous(0.02), Coulomb(0.05)]), PIDController(kp=8.0, ki=0.0, kd=0.6)
    axis = ServoAxis(inertia=0.05, law=law, controller=controller, sample_rate=100.0)
    reference = np.sin(2.1 * time) + 0.3 * np.sin(5.3 * time + 1.0)
    run = axis.simulate(reference=reference, noise=1e-5 * rng.standard_normal(time.size))
    drive = run.drive + 4.0 * np.std(run.drive) * rng.standard_normal(time.size)
    log = pd.DataFrame({"time_s": run.time, "torque_nm": drive, "position_rad": run.position})
    plant = ServoPlant(ServoRecord.from_frame(log), LAW, None, 0.004)
    looks = plant.looks(plant.base(rng), rng)
    assert not any(look.swapped for look in looks), "less is left of the acceleration for the drive to explain"
    found = GapFinder("servo").fit(log).diagnosis_
    assert not found.effects
    assert "changes from row to row" in " ".join(found.notes)
    assert "rate of the controller" in found.next_experiment
