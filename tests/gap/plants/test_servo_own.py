"""Own records of an axis: they leave what the record leaves, and tell how far a fit is off."""

from __future__ import annotations

import dataclasses
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from tests.gap.plants.example_servo import INERTIA, RATE, REFERENCE, opened, shaken
from whsklearn.datasets import make_servo_log
from whsklearn.effects import Cogging, Coulomb, Stribeck, Viscous
from whsklearn.gap.plants import servo_own
from whsklearn.gap.plants.from_log import servo_record
from whsklearn.gap.plants.servo_candidates import candidate
from whsklearn.gap.plants.servo_model import HOLD, ServoTerm
from whsklearn.gap.plants.servo_start import start_of
from whsklearn.gap.record import ServoRecord
from whsklearn.logs.load import Log
from whsklearn.systems import ServoAxis


def view_of(effects, seed=0):
    log = make_servo_log(effects, duration=12.0, random_state=seed)
    return start_of(ServoRecord.from_frame(log), ("viscous", "coulomb"), 0.004)


@pytest.fixture(scope="module")
def empty():
    view, model = view_of([])
    return view, model, *servo_own.own(view, model, np.random.default_rng(0))


def test_artefacts_of_the_filters_are_those_of_the_record(empty):
    view, model, own, _ = empty
    raw = view.gap(model)
    view.own = own
    left = view.rms(view.gap(model))
    view.own = None
    assert left < 0.25 * view.rms(raw)
    assert left < 2.5 * own.floor


@pytest.mark.parametrize("delay", [0.0, 0.004])
def test_the_drive_that_a_path_asks_for_is_as_old_as_one_that_is_held_over_the_sample(empty, delay):
    """With no age of its own it hid the hold, and `compare` told a delay of one sample that had gone."""
    view, model = empty[:2]
    ideal, dt = servo_own.needed(view, model), view.scene.dt
    made = servo_own.own_record(view, model, np.random.default_rng(0), view.record.drive, delay, ideal, held=True)
    seen = view.bare().beside(made)
    assert seen.age(seen.fit_with_gap(model)[0]) == pytest.approx(HOLD * dt + delay, abs=0.05 * dt)


def test_where_the_axis_turns_the_true_model_leaves_noise():
    """A drive that begins without the artefacts of the filters sticks at other times, and that is no missing effect."""
    log = make_servo_log([Cogging(0.03, 12.0)], duration=12.0, amplitude=1.0, random_state=0)
    view, base = start_of(ServoRecord.from_frame(log), ("viscous", "coulomb"), 0.004)
    viscous, coulomb = base.terms
    cogging = ServoTerm(candidate("cogging"), (0.03, 0.0, 12.0))
    terms = (viscous.with_slot(0, 0.12), coulomb.with_slot(0, 0.3), cogging)
    true = dataclasses.replace(base, inertia=0.05, terms=terms)
    bare = view.bare()
    own, _ = servo_own.own(bare, true, np.random.default_rng(0))
    assert view.rms(own.weight * (bare.gap(true) - own.mean)) < 1.8 * own.floor


def test_a_fit_behind_filters_is_corrected_to_the_truth(empty):
    _, model, _, corrected = empty
    truth = np.array([0.05, 0.12, 0.3])  # of make_servo_log
    fitted, mended = (np.array([m.inertia, *(t.q[0] for t in m.terms)]) / truth - 1.0 for m in (model, corrected))
    assert np.abs(mended).max() < 0.02
    assert np.linalg.norm(mended) < np.linalg.norm(fitted)


@pytest.mark.parametrize("factor", [0.8, 1.2])
def test_the_correction_starts_anywhere_and_ends_at_the_record(factor):
    """Numbers of the free run are not those of inverse dynamics, so they are no statistic of the record to be met."""
    axis = ServoAxis(
        inertia=INERTIA, law=[Viscous(0.1), Coulomb(0.34)], effects=[Stribeck(0.8, 0.3, 1.0)], sample_rate=RATE,
        friction="stick",
    )  # fmt: skip
    run = axis.simulate(reference=REFERENCE, random_state=1)
    inverse, _, base = opened(ServoRecord(run.time, run.drive, run.position), ("viscous", "coulomb"))
    model = inverse.fit(base.with_term(ServoTerm(candidate("stribeck"), (0.8, 0.3, 1.0))))
    off = ServoTerm(candidate("stribeck"), (factor * 0.8, 0.3, 1.0))
    _, corrected = servo_own.own(inverse, model.with_terms((*model.terms[:-1], off)), np.random.default_rng(0))
    assert corrected.terms[-1].q[0] == pytest.approx(0.8, rel=0.03)


def test_the_age_of_the_drive_is_that_beside_the_numbers_that_fit_the_log(monkeypatch):
    """Beside other numbers it is another one, of which own records leave what the log does not."""
    view, model = view_of([])
    fitted = view.fit(model)
    off = fitted.with_terms(tuple(replace(t, q=(0.6 * t.q[0], *t.q[1:])) for t in fitted.terms))
    assert view.age(off) != pytest.approx(view.age(fitted), rel=0.1)
    asked, age = [], type(view).age
    monkeypatch.setattr(type(view), "age", lambda self, m: asked.append(age(self, m)) or asked[-1])
    servo_own.own(view, off, np.random.default_rng(0))
    assert asked[0] == pytest.approx(view.age(fitted), rel=1e-3)


def test_a_shaken_axis_logged_late_makes_the_same_record():
    """The loop runs ahead of the log: without that, a drive that changes at every sample was 0.9 of itself away."""
    view, model = start_of(shaken(), ("viscous", "coulomb"), 0.004)
    own = servo_own.own_record(
        view, model, np.random.default_rng(0), view.record.drive, -0.4 * view.scene.dt, servo_own.needed(view, model)
    )
    away = view.rms(own.drive - view.record.drive) / view.rms(view.record.drive)
    assert away < 0.3


def test_an_axis_that_a_stiff_loop_moves_slower_than_its_friction_falls_is_held_on_its_path():
    """Own records under a softer loop stuck and slipped, and left twenty times as much as the log."""
    rate, law = 50.0, Stribeck(0.18, 0.0055)
    t = np.arange(3000) / rate
    q = 0.12 * np.sin(0.09 * t) + 0.02 * np.sin(0.4 * t + 1.0)
    v = np.gradient(q, t)
    u = 1.7 * np.gradient(v, t) + 1.8 * v + 0.33 * np.tanh(v / 1e-4) + law.value(velocity=v)
    rng = np.random.default_rng(0)
    record = ServoRecord(t, u + 1e-4 * rng.standard_normal(t.size), q + 4e-7 * rng.standard_normal(t.size))
    view, base = start_of(record, ("viscous", "coulomb"), 0.004)
    model = view.fit(base.with_term(ServoTerm(candidate("stribeck"), (0.18, 0.0055, 2.0))))
    own, _ = servo_own.own(view, model, np.random.default_rng(0))
    raw = view.gap(model)
    assert view.rms(raw - own.mean) <= view.rms(raw)
    assert own.floor < view.rms(raw)


def test_null_rows_are_as_large_as_what_is_left(empty):
    view, model, own, _ = empty
    view.own = own
    left = view.rms(view.gap(model))
    view.own = None
    assert np.sqrt(np.mean((own.weight * own.null) ** 2)) == pytest.approx(left, rel=0.25)


def test_what_is_missing_is_in_no_own_record():
    view, model = view_of([Cogging(0.2, 12.0)])
    own, _ = servo_own.own(view, model, np.random.default_rng(0))
    wave = np.exp(1j * 12.0 * view.motion.position[:: view.every][view.at])
    seen, made = (np.abs(np.mean(x * wave)) for x in (view.gap(model), own.mean))
    assert made < 0.1 * seen


def test_a_drive_that_was_never_logged_is_replaced_by_the_torque_along_the_path(empty):
    """A drive that alternates at every sample hardly moves the axis, but no record has it."""
    view, model, *_ = empty
    alternating = view.scene.torque * (-1.0) ** np.arange(len(view.record))
    for size in (0.0, 30.0):
        made = servo_own.own_record(
            view,
            model,
            np.random.default_rng(0),
            view.record.drive + size * alternating,
            0.0,
            servo_own.needed(view, model),
        )
        assert np.abs(made.position - view.motion.position).max() < view.scene.reach
        assert np.std(made.drive) < 1.2 * np.std(view.record.drive)


def test_the_noise_of_a_logged_velocity_is_a_sum_in_its_integral():
    """White noise of the position would be a thirteenth of it: in an empty log, the rest was "something missing"."""
    dt, rng = 0.02, np.random.default_rng(0)
    t = dt * np.arange(3000)
    axis = ServoAxis(inertia=0.4, law=[Viscous(0.03), Coulomb(0.8)], sample_rate=1.0 / dt)
    drive = np.repeat(rng.uniform(-20.0, 20.0, 30), 100)
    run = axis.simulate_drive(drive, noise=False)
    speed = np.gradient(run.true_position, dt) + 0.2 * rng.standard_normal(t.size)
    frame = pd.DataFrame({"time": t, "drive": drive, "velocity": speed})
    position = np.r_[0.0, np.cumsum(0.5 * dt * (speed[1:] + speed[:-1]))]
    log = Log(
        time=t, X=drive[:, None], y=position, reference=None, command=None, frame=frame,
        groups=np.zeros(t.size, dtype=int), columns={"velocity": "speed"},
        units={"drive": "Nm", "velocity": "rad/s", "position": "rad"},
    )  # fmt: skip
    record = servo_record(log, {})
    view, model = start_of(record, ("viscous", "coulomb"), 0.004)
    found, _ = servo_own.own(view, model, np.random.default_rng(0))
    assert found.floor == pytest.approx(view.rms(view.gap(model)), rel=0.25)
