"""A load on a measured motor."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from whsklearn.effects import Scales
from whsklearn.gap.plants import servo_two_mass as two_mass
from whsklearn.gap.plants.servo_candidates import candidate
from whsklearn.gap.plants.servo_model import ServoHypothesis, ServoTerm

DT = 0.002
TIME = np.arange(5000) * DT
SCENE = Scales(dt=DT, inertia=0.05)


def view():
    motion = SimpleNamespace(position=np.sin(7 * TIME), velocity=7 * np.cos(7 * TIME))
    return SimpleNamespace(scene=SCENE, motion=motion, blur=lambda a: a)


@pytest.mark.parametrize("damping", [0.05, 1.5])
def test_a_stiff_spring_carries_its_load_along_however_it_is_damped(damping):
    term = two_mass.start(ServoHypothesis(0.05, 0.0, (), SCENE), candidate("backlash"), 0.004, 60.0, damping)
    model = ServoHypothesis(0.05, 0.0, (term,), SCENE)
    a = two_mass.columns(view(), model, term)[1000:, 0]
    assert np.all(np.isfinite(a))
    assert np.sqrt(np.mean(a**2)) == pytest.approx(49 / np.sqrt(2), rel=0.5)


def test_a_contact_pushes_a_load_against_its_friction_and_not_while_the_play_is_crossed():
    none = np.zeros(TIME.size)
    push, place, speed = two_mass.pushed(TIME, none + 1.0, none, none + 1.0, 0.5, 300.0**2, 180.0, 0.0, 2.0, DT, 16)
    assert not push[: int(0.2 / DT)].any(), "the motor is a quarter of a radian away"
    assert push[2000:].mean() == pytest.approx(2.0, rel=0.01)
    assert np.all(place <= TIME)
    assert speed[2000:].mean() == pytest.approx(1.0, rel=0.01)


@pytest.mark.parametrize("name", ["backlash", "flexible_coupling"])
def test_the_friction_of_a_load_keeps_its_size_when_the_inertia_is_split_anew(name):
    model = ServoHypothesis(0.05, 0.0, (), SCENE)
    model = model.with_term(two_mass.start(model, candidate(name), 0.004, 60.0, 0.2, 0.1))
    slowed = two_mass.contact(model, model.terms[0])[3]
    other = two_mass.with_sizes(view(), model, np.array([0.02, 0.06, 0.0]))
    assert two_mass.contact(other, other.terms[0])[3] == pytest.approx(slowed)
    assert other.terms[0].q[-1] == pytest.approx(0.06 * slowed)


@pytest.mark.parametrize(("dry", "n"), [(0.1, 2), (0.0, 1)])
@pytest.mark.parametrize("name", ["backlash", "flexible_coupling"])
def test_a_fit_starts_with_the_friction_of_a_load_on_its_motor_too(name, dry, n):
    model = ServoHypothesis(0.05, 0.0, (ServoTerm(candidate("coulomb"), (0.3,)),), SCENE)
    model = model.with_term(two_mass.start(model, candidate(name), 0.004, 60.0, 0.2, dry))
    first, *other = two_mass.splits_of_friction(model)
    assert first == model
    assert len(other) == n - 1
    for m in other:
        assert (m.terms[0].q[0], m.terms[1].q[-1]) == (pytest.approx(0.4), 0.0)
        assert m.terms[1].q[:-1] == model.terms[1].q[:-1]


@pytest.mark.parametrize("name", ["backlash", "flexible_coupling"])
def test_a_load_that_the_drive_does_not_move_is_no_load_behind_a_transmission(name):
    model = ServoHypothesis(0.05, 0.0, (), SCENE)
    for dry, said in ((0.0, False), (0.5 * SCENE.torque, False), (2.0 * SCENE.torque, True)):
        term = two_mass.start(model, candidate(name), 0.004, 30.0, 0.2, dry)
        assert ("load_coulomb" in model.with_term(term).at_the_end(0)) is said


def test_the_steps_of_a_coupling_go_by_the_fastest_that_a_record_shows():
    def steps(resonance):
        scene = Scales(dt=0.02, resonance=resonance)
        return ServoHypothesis(
            0.05, 0.0, (ServoTerm(candidate("backlash"), (0.01, 0.5, 8.0, 0.1, 0.0)),), scene
        ).longest_step

    assert steps(90.0) == pytest.approx(1.25e-4, rel=0.01)
    assert steps(30.0) == pytest.approx(3 * steps(90.0))
    assert steps(1.0) == pytest.approx(1e-3, rel=0.01)
