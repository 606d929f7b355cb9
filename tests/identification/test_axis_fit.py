"""The axis as physics: a start by inverse dynamics, and a law that bends where friction does."""

from __future__ import annotations

import numpy as np
import pytest

from tests.recursion.axis_log import TRUTH, axis_log, slow_drive
from whsklearn import ServoAxis
from whsklearn.datasets import make_servo_log
from whsklearn.effects import Cogging, GravityImbalance, as_law
from whsklearn.identification.axis_fit import (
    _gravity_errors,
    fit_free_law_axis,
    fit_hanging_axis,
    fit_rigid_axis,
    white,
)
from whsklearn.identification.axis_numbers import gravity_of, sine_and_cosine
from whsklearn.identification.view import view
from whsklearn.identification.windows import residual
from whsklearn.recursion.batch.axis_free_run import free_run
from whsklearn.systems.servo_parts import PIDController

U = slow_drive(3000, 1)
VELOCITY = free_run(TRUTH, axis_log(U))


def test_a_free_law_bends_at_speeds_of_the_record_and_stays_straight_where_friction_is():
    model = fit_free_law_axis(view(U, VELOCITY, 0.005, "velocity"))
    assert model.inertia == pytest.approx(TRUTH[0], rel=0.02)
    hinges = [t for t in model.law.terms if t.name == "speed_hinge"]
    assert len(hinges) == 4
    assert max(t.knot for t in hinges) < np.abs(VELOCITY).max()
    assert max(abs(t.magnitude) for t in hinges) < 0.1 * TRUTH[1]


def test_a_pendulum_is_found_with_intervals_that_hold_it():
    truth = np.array([0.05, 0.1, 0.2, 0.02, 1.5, 0.4])
    u = 2.0 * slow_drive(6000, 3)
    log = axis_log(u)._replace(hangs=True, of_position=True)
    y = free_run(truth, log) + 1e-4 * np.random.default_rng(0).standard_normal(u.size)
    model = fit_hanging_axis(view(u, y, 0.005, "output"))
    gravity = model.effects[1]
    assert model.logged == "position"
    assert model.inertia == pytest.approx(truth[0], rel=0.03)
    assert sine_and_cosine(gravity) == pytest.approx(truth[4:], rel=0.03)
    for name, true in (
        ("gravity_imbalance", np.hypot(1.5, 0.4)),
        ("gravity_imbalance__phase", np.arctan2(-1.5, 0.4)),
        ("coulomb", 0.2),
    ):
        assert abs(model.parameters[name] - true) < 4 * model.standard_errors[name] < 0.2, name


def shoulder(seed):
    """A joint under gravity that is large against its inertia: in closed loop, 125 Hz."""
    rng = np.random.default_rng(seed)
    axis = ServoAxis(
        inertia=10.0,
        law=as_law("viscous,coulomb").reweighted([15.0, 12.0]),
        effects=[GravityImbalance(150.0)],
        controller=PIDController(6000.0, 0.0, 600.0),
        sample_rate=125.0,
        substeps=16,
    )
    t = np.arange(3000) / 125.0
    reference = -1.2 + sum(
        a * np.sin(2 * np.pi * f * t) for a, f in zip(rng.uniform(0.1, 0.4, 4), rng.uniform(0.05, 0.4, 4), strict=True)
    )
    record = axis.simulate(reference)
    return view(record.drive, record.position + 2e-5 * rng.standard_normal(t.size), 0.008, "position")


def test_gravity_that_is_large_against_the_inertia_is_found_from_a_poor_start():
    record = shoulder(0)
    model = fit_hanging_axis(record)
    assert model.inertia == pytest.approx(10.0, rel=0.05)
    assert model.parameters["gravity_imbalance"] == pytest.approx(150.0, rel=0.02)
    assert model.parameters["coulomb"] == pytest.approx(12.0, rel=0.05)


def test_sine_and_cosine_are_one_wave_with_a_phase():
    gravity, q = gravity_of(-0.3, 0.7), np.linspace(-3, 3, 50)
    np.testing.assert_allclose(gravity.value(position=q), -0.3 * np.sin(q) + 0.7 * np.cos(q), atol=1e-12)
    assert sine_and_cosine(gravity) == pytest.approx((-0.3, 0.7))


def test_standard_errors_of_the_wave_are_those_of_its_draws():
    forces, covariance = np.array([-0.3, 0.7]), 1e-4 * np.array([[2.0, 0.6], [0.6, 1.0]])
    draws = np.random.default_rng(0).multivariate_normal(forces, covariance, 4000)
    waves = [gravity_of(*d) for d in draws]
    spread = np.std([w.amplitude for w in waves]), np.std([w.phase for w in waves])
    assert tuple(_gravity_errors(forces, covariance).values()) == pytest.approx(spread, rel=0.05)


def test_gravity_that_is_next_to_nothing_is_refused():
    u = slow_drive(4000, 3)
    y = free_run(TRUTH, axis_log(u)._replace(of_position=True)) + 1e-5 * np.random.default_rng(0).standard_normal(4000)
    with pytest.raises(ValueError, match="% of the drive, so the axis without it is the same"):
        fit_hanging_axis(view(u, y, 0.005, "position"))


def cogged(seed, size):
    """An axis in closed loop whose cogging no model here knows."""
    rng = np.random.default_rng(seed)
    cogging = Cogging(size, float(rng.integers(4, 20)), float(rng.uniform(-3, 3)))
    axis = ServoAxis(inertia=0.05, law=as_law("viscous,coulomb").reweighted([0.12, 0.3]), sample_rate=500.0)
    amplitude = float(rng.uniform(0.5, 2.0))
    log = make_servo_log([cogging], axis=axis, duration=10.0, amplitude=amplitude, random_state=seed)
    return view(log["torque_nm"], log["position_rad"], 0.002, "position")


@pytest.mark.parametrize("size", [0.03, 0.1])
def test_the_truth_is_in_the_intervals_where_cogging_is_missing(size):
    """95 % nominal; of 20 seeds 17 at least, which a coverage of 95 % misses in one of 60 such tests."""
    truth = {"inertia": 0.05, "viscous": 0.12, "coulomb": 0.3}
    held = dict.fromkeys(truth, 0)
    for seed in range(20):
        record = cogged(seed, size)
        model = fit_rigid_axis(record)
        assert not white(residual(model, record), record)
        for name, value in truth.items():
            held[name] += abs(model.parameters[name] - value) < 1.96 * model.standard_errors[name]
    assert min(held.values()) >= 17, held


def test_white_noise_alone_leaves_the_intervals_narrow():
    """A record of an axis that the model can be, its velocity logged with white noise."""
    noise = 0.01 * np.std(VELOCITY) * np.random.default_rng(0).standard_normal(VELOCITY.size)
    record = view(U, VELOCITY + noise, 0.005, "velocity")
    model = fit_rigid_axis(record)
    assert white(residual(model, record), record)
    assert abs(model.inertia - TRUTH[0]) < 3 * model.standard_errors["inertia"] < 0.03 * TRUTH[0]
