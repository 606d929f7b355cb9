"""An axis as one vector of numbers: there and back, within its bounds, and physics in its runs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from whsklearn.effects import Scales
from whsklearn.gap.plants.servo_candidates import candidate, catalogue
from whsklearn.gap.plants.servo_model import LONGEST_STEP, ServoHypothesis, ServoTerm

SCENE = Scales(
    torque=0.5, peak=1.4, speed=2.0, reach=2.5, centre=0.3, duration=4.0, dt=1e-3, inertia=0.05, resonance=90.0
)
TIME = np.arange(2000) * SCENE.dt


def started(kind):
    """The candidate at its first start, of a tenth of the usual size."""
    return ServoTerm(kind, (*(0.1 * kind.size_unit(SCENE),) * kind.linear, *kind.starts(SCENE)[0]))


def model(*terms, inertia=0.05, timing=0.0):
    return ServoHypothesis(inertia, timing, tuple(terms), SCENE)


def friction(viscous=0.0, coulomb=0.0):
    return ServoTerm(candidate("viscous"), (viscous,)), ServoTerm(candidate("coulomb"), (coulomb,))


KINDS = [c for c in catalogue() if not c.scanned]


@pytest.mark.parametrize("kind", KINDS, ids=lambda c: c.label)
def test_a_vector_is_its_model_and_lies_within_its_bounds(kind):
    m = model(*friction(0.1, 0.2), started(kind), inertia=0.04, timing=0.3)
    x, (low, high) = m.vector(), m.bounds()
    again = m.with_vector(x)
    assert again.inertia == pytest.approx(m.inertia)
    for a, b in zip(again.terms, m.terms, strict=True):
        np.testing.assert_allclose(a.q, b.q, rtol=1e-12)
    assert x.shape == low.shape == high.shape == m.steps().shape
    held = kind.name == "input_delay"  # the delay is the timing then, which has no room of its own
    assert np.all((low <= x) | (np.arange(x.size) == 1) * held)
    assert np.all((x <= high) | (np.arange(x.size) == 1) * held)
    assert np.all(m.steps() > 0.0)


def test_an_inertia_far_above_that_of_the_first_regression_has_room_on_either_side():
    """As of a pendulum that swings freely, whose first regression, without gravity, finds almost none."""
    m = model(*friction(0.1, 0.2), inertia=20.0 * SCENE.inertia)
    x, (low, high) = m.vector(), m.bounds()
    assert low[0] + np.log(2.0) < x[0] < high[0] - np.log(2.0)
    assert m.has_inertia(replace(m, inertia=25.0 * SCENE.inertia))
    assert not m.has_inertia(replace(m, inertia=200.0 * SCENE.inertia))
    assert not model(inertia=0.04).has_inertia(model(inertia=1e-3 * SCENE.inertia))


@pytest.mark.parametrize("times", [0.1, 30.0, -30.0])
def test_a_spring_that_holds_far_more_than_the_drive_has_room_on_either_side(times):
    """An axis swings on it under a small drive; a fit along the run had begun at half of its stiffness."""
    spring = candidate("hardening_spring")
    m = model(ServoTerm(spring, (times * spring.size_unit(SCENE), 0.0)))
    low, high = m.bounds()
    assert np.all(low < m.vector())
    assert np.all(m.vector() < high)


def test_a_step_of_one_number_moves_that_number_alone():
    m = model(*friction(0.1, 0.2), started(candidate("stribeck")))
    x = m.vector()
    for i in range(x.size):
        moved = x.copy()
        moved[i] += m.steps()[i]
        changed = np.flatnonzero(~np.isclose(m.with_vector(moved).vector(), x, rtol=0, atol=1e-15))
        assert changed.tolist() == [i]


def test_friction_of_the_base_law_gives_no_energy_and_that_of_an_effect_may():
    m = replace(model(*friction(0.1, 0.2), ServoTerm(candidate("asymmetric_coulomb"), (0.1,))), n_base=2)
    low, _ = m.bounds()
    assert low[2:4].tolist() == [0.0, 0.0]
    assert low[4] < 0.0


def test_friction_that_goes_on_drifting_evenly_is_at_no_end():
    """Its time constant is longer than any range; a step in the middle of a record had stood in its place."""
    kind = candidate("friction_drift")
    ((low, high),) = kind.ranged(SCENE)
    assert model(ServoTerm(kind, (0.1, high))).at_the_end(0) == ""
    assert "time_constant" in model(ServoTerm(kind, (0.1, low))).at_the_end(0)


def test_a_number_at_the_end_of_its_range_is_told_and_one_within_is_not():
    kind = candidate("stribeck")
    low, high = kind.ranged(SCENE)[0]
    inside, at_end = (model(ServoTerm(kind, (0.1, v, 2.0))).at_the_end(0) for v in (np.sqrt(low * high), high))
    assert inside == ""
    assert "velocity" in at_end


@pytest.mark.parametrize("name", ["flexible_coupling", "backlash"])
def test_a_load_at_the_limit_of_its_share_is_told_and_of_damping_only_a_spring_that_does_not_ring(name):
    kind = candidate(name)
    start = dict(zip(kind.fields, kind.starts(SCENE)[0], strict=True))
    limits = dict(zip(kind.fields, kind.ranged(SCENE), strict=True))

    def said(**numbers):
        return model(ServoTerm(kind, tuple((start | numbers).values()))).at_the_end(0)

    assert said() == ""
    low, high = limits["damping_ratio"]
    assert said(damping_ratio=low) == ""
    assert ("damping_ratio" in said(damping_ratio=high)) is (name == "flexible_coupling")
    assert all("load_share" in said(load_share=end) for end in limits["load_share"])


def test_a_constant_torque_on_a_free_mass_is_a_parabola():
    drive, still = np.full(TIME.size, 0.1), np.zeros(TIME.size)
    y, angle, speed, _ = model(inertia=0.05).follow(drive, still, (0.0, 0.0), start=(still, still))
    np.testing.assert_allclose(angle, 0.5 * 0.1 / 0.05 * TIME**2, atol=1e-6)
    np.testing.assert_allclose(speed, 0.1 / 0.05 * TIME, atol=1e-6)
    np.testing.assert_array_equal(y, angle)


def test_viscous_friction_is_an_exponential():
    drive, still = np.full(TIME.size, 0.1), np.zeros(TIME.size)
    speed = model(*friction(0.2), inertia=0.05).follow(drive, still, (0.0, 0.0), start=(still, still))[2]
    np.testing.assert_allclose(speed, 0.1 / 0.2 * (1.0 - np.exp(-TIME * 0.2 / 0.05)), atol=1e-6)


@pytest.mark.parametrize("age", [0.25, 0.5, 1.0])
def test_timing_is_the_age_of_the_drive_in_samples(age):
    """An impulse of speed, J v = T dt, comes ``age`` samples late: the path is behind by v age dt ever after."""
    drive, still = np.zeros(TIME.size), np.zeros(TIME.size)
    drive[100:110] = 1.0
    runs = [
        model(inertia=0.05, timing=t).follow(drive, still, (0.0, 0.0), start=(still, still))[1][-1] for t in (0.0, age)
    ]
    assert runs[0] - runs[1] == pytest.approx(10 * SCENE.dt / 0.05 * age * SCENE.dt, rel=1e-3)


def test_steps_are_no_longer_than_the_finest_effect_asks_for():
    m = model(*friction(0.1))
    assert m.longest_step == LONGEST_STEP
    kind = candidate("flexible_coupling")
    assert m.with_term(ServoTerm(kind, kind.starts(SCENE)[0])).longest_step < LONGEST_STEP


def test_a_run_in_pieces_begins_anew_in_each_at_the_time_of_its_start():
    tone = ServoTerm(candidate("disturbance_tone"), (0.3, 0.1, 2.3))
    m = model(*friction(0.1, 0.0), tone)
    whole = m.follow(np.zeros(2000), np.zeros(2000), (0.0, 0.0), start=(np.zeros(2000), np.zeros(2000)))
    angle, speed = whole[1], whole[2]
    there = np.r_[0:800, 1300:2000]  # a hole of half a second
    pieces = [(slice(0, 800), 0.0), (slice(800, 1500), 1300 * SCENE.dt)]
    start = angle[there], speed[there]
    y, *_ = m.follow(np.zeros(1500), np.zeros(1500), (0.0, 0.0), start=start, pieces=pieces)
    np.testing.assert_allclose(y, angle[there], atol=1e-9)
