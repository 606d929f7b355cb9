"""The start of a servo diagnosis: scales as the record has them, filtered derivatives, room between blocks."""

from __future__ import annotations

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest

from tests.gap.plants.example_servo import INERTIA, RATE, TIME, opened, record_of, shaken
from whsklearn.datasets import make_servo_log
from whsklearn.effects import ActuatorLag, Coulomb, EarlyReversal, GravityImbalance, InputDelay, InputOffset, Viscous
from whsklearn.gap import GapFinder
from whsklearn.gap.plants import servo_start
from whsklearn.gap.plants.servo import servo_plant
from whsklearn.gap.plants.servo_candidates import candidate
from whsklearn.gap.plants.servo_model import ServoTerm
from whsklearn.gap.plants.servo_start import (
    base_model,
    best_view,
    filtered_motion,
    logged_late,
    start_of,
    with_earlier_drive,
)
from whsklearn.gap.record import ServoRecord, noise_level, training_samples
from whsklearn.systems import ServoAxis


@pytest.fixture(scope="module")
def views():
    return opened(record_of())


@pytest.mark.parametrize("centre", [0.0, 1e5])
def test_derivatives_of_a_wave_are_its_own_wherever_the_encoder_counts_from(centre):
    w = 3.0
    q, v, a = filtered_motion(centre + np.sin(w * TIME), 1.0 / RATE, 20.0)
    inside = slice(200, -200)
    np.testing.assert_allclose(q[inside] - centre, np.sin(w * TIME)[inside], atol=2e-3)
    np.testing.assert_allclose(v[inside], w * np.cos(w * TIME)[inside], atol=w * 2e-3)
    np.testing.assert_allclose(a[inside], -(w**2) * np.sin(w * TIME)[inside], atol=w**2 * 2e-3)


def test_scales_are_those_of_the_record(views):
    inverse, _, base = views
    record, scene = inverse.record, base.scene
    assert scene.inertia == pytest.approx(INERTIA, rel=0.05)
    assert scene.torque == pytest.approx(np.sqrt(np.mean(record.drive**2)))
    assert scene.reach == pytest.approx(0.5 * np.ptp(record.position))
    assert scene.speed == pytest.approx(np.sqrt(np.mean(np.gradient(record.position, record.time) ** 2)), rel=0.05)
    assert scene.duration == pytest.approx(record.time.size / RATE)


def test_what_is_fitted_and_what_is_held_out_keep_their_distance(views):
    _, observer, _ = views
    reach = min(observer.filter.half_width, TIME.size // 50) - 1
    beside = np.convolve(~training_samples(observer.record.position), np.ones(2 * reach + 1), mode="same") > 0.5
    assert reach > 10
    assert not np.any(observer.train & beside[:: observer.filter.every])
    assert np.mean(observer.train) > 0.4


def test_motion_at_the_sampling_rate_is_not_taken_for_noise():
    record = shaken(noise=2e-5)
    view, _ = start_of(record, ("viscous", "coulomb"), 0.004)
    assert 2e-5 < view.noise < 0.5 * noise_level(record.position)


def test_a_noisier_encoder_asks_for_a_lower_cut_off(views):
    record = views[0].record
    noise = np.random.default_rng(0).standard_normal(TIME.size)
    cutoffs = []
    for size in (1e-6, 1e-4, 1e-3):
        inverse, _, base = opened(dataclasses.replace(record, position=record.position + size * noise))
        cutoffs.append(best_view(inverse, base, 0.004).cutoff)
    assert cutoffs == sorted(cutoffs, reverse=True)
    assert cutoffs[-1] < 0.5 * cutoffs[0]


def test_a_lag_asks_for_a_lower_cut_off():
    """Models with one are compared by the drive before it, in which the noise is larger by T d/dt."""
    noise, cutoffs = np.random.default_rng(0).standard_normal(TIME.size), []
    for lag in (0.0, 0.01, 0.04):
        record = record_of([ActuatorLag(lag)] if lag else [])
        inverse, _, base = opened(dataclasses.replace(record, position=record.position + 1e-4 * noise))
        model = base.with_term(ServoTerm(candidate("actuator_lag"), (lag,))) if lag else base
        cutoffs.append(best_view(inverse, model, 0.004).cutoff)
    assert cutoffs[0] > cutoffs[1] > cutoffs[2], cutoffs


def test_waves_are_looked_for_up_to_frequencies_at_which_single_samples_are_noise(views):
    record = views[0].record
    noise = np.random.default_rng(0).standard_normal(TIME.size)
    inverse, _, base = opened(dataclasses.replace(record, position=record.position + 1e-3 * noise))
    plain, sharp = (best_view(inverse, base, 0.004, sharp=sharp).cutoff for sharp in (False, True))
    assert sharp > 1.5 * plain


def test_a_base_model_has_the_terms_of_its_law_and_nothing_else(views):
    model = base_model(("viscous", "coulomb"), views[2].scene)
    assert ([t.name for t in model.terms], model.n_base) == (["viscous", "coulomb"], 2)


@pytest.mark.parametrize("late", [0, 8, 30])
def test_a_drive_that_was_logged_late_is_found_and_moved(late):
    frame = make_servo_log([], duration=12.0, random_state=0)
    record = ServoRecord.from_frame(frame)
    held = np.concatenate([np.full(late, record.drive[0]), record.drive[: record.drive.size - late]])
    logged = dataclasses.replace(record, drive=held)
    view, model = start_of(logged, ("viscous", "coulomb"), 0.004)
    lead = logged_late(view, model)
    assert abs(lead - late) <= 1, "a sample is bookkeeping"
    np.testing.assert_array_equal(
        with_earlier_drive(logged, late).drive[: -late or None], record.drive[: -late or None]
    )


@pytest.mark.parametrize("viscous", [0.2, 0.4, 0.8])
def test_friction_that_the_law_lacks_is_no_drive_that_was_logged_late(viscous):
    """It had moved the drive by 6 to 28 ms, and a delay was named that moved it back."""
    axis = ServoAxis(inertia=INERTIA, law=[Viscous(viscous), Coulomb(0.05)], sample_rate=RATE)
    r = axis.simulate(reference=0.5 * np.sin(20.0 * TIME) + 0.2 * np.sin(22.0 * TIME + 1.0), random_state=1)
    assert logged_late(*start_of(ServoRecord(r.time, r.drive, r.position), ("coulomb",), 0.004)) == 0


def test_a_drive_that_acts_later_than_it_was_logged_is_a_question():
    record = ServoRecord.from_frame(make_servo_log([InputDelay(0.02)], duration=12.0, random_state=0))
    assert logged_late(*start_of(record, ("viscous", "coulomb"), 0.004)) == 0


def early_log(*effects):
    """A log of the example axis whose dry friction reverses as early as MuJoCo's."""
    return make_servo_log([EarlyReversal(9.5e-3), *effects], duration=12.0, sample_rate=500.0, random_state=3)


def test_friction_that_reverses_early_belongs_to_the_base_model():
    empty, swinging = (GapFinder("servo").fit(early_log(*e)) for e in ([], [GravityImbalance(0.1)]))
    assert empty.verdict_ == "no_gap"
    assert (swinging.verdict_, [e.name for e in swinging.effects_]) == ("named", ["gravity_imbalance"])
    for model in (empty.model_, swinging.model_):
        early = next(e for e in model.effects if e.name == "early_reversal")
        assert early.lead == pytest.approx(9.5e-3, rel=0.05)
    assert f"reverses about {1e3 * early.lead:.1f} ms before the velocity" in " ".join(swinging.diagnosis_.notes)


def test_friction_that_reverses_with_the_velocity_is_not_called_early():
    finder = GapFinder("servo").fit(make_servo_log(duration=20.0, sample_rate=500.0, random_state=3))
    assert finder.verdict_ == "no_gap"
    assert [e.name for e in finder.model_.effects] == []


@pytest.mark.parametrize("rate", [100.0, 500.0])
@pytest.mark.parametrize(("effects", "expected"), [([EarlyReversal(9.5e-3)], True), ([], False)])
def test_an_axis_creeps_at_rest_only_if_its_friction_reverses_early(rate, effects, expected):
    """Also with a load that the model lacks, as far as that is steady."""
    axis = ServoAxis(
        inertia=INERTIA, law=[Viscous(0.12), Coulomb(0.3)], effects=[*effects, InputOffset(0.02)], sample_rate=rate
    )
    t = np.arange(int(16.0 * rate)) / rate
    steps = np.random.default_rng(1).uniform(-0.6, 0.6, 17)
    k, moved = np.floor(t).astype(int), np.clip((t % 1.0) / 0.7, 0.0, 1.0)
    r = axis.simulate(reference=steps[k] + (steps[k + 1] - steps[k]) * moved**2 * (3.0 - 2.0 * moved), random_state=1)
    view, model = start_of(ServoRecord(r.time, r.drive, r.position), ("viscous", "coulomb"), 0.004)
    assert servo_start.creeps(view, model, EarlyReversal(9.5e-3), model.terms[1].q[0]) is expected
    few = ServoRecord(r.time[: r.time.size // 4], r.drive[: r.time.size // 4], r.position[: r.time.size // 4])
    view, model = start_of(few, ("viscous", "coulomb"), 0.004)
    assert servo_start.creeps(view, model, EarlyReversal(9.5e-3), model.terms[1].q[0]) is None


@pytest.mark.parametrize(
    ("share", "creeps", "early"),
    [(0.45, None, True), (0.6, None, False), (0.6, True, True), (1.1, True, False), (0.1, False, False)],
)
def test_friction_is_early_if_that_is_most_of_the_gap_or_the_axis_creeps(views, share, creeps, early):
    """Beside the edges of a contact it took a quarter of the rest, 3.4 ms for 1 ms, and a coupling was named beside it.

    ``share``: of the gap's power, what is left with the best lead. ``creeps``: what rests show, if there are enough.
    """

    class View:
        scene, slowest, rms = views[0].scene, 1e-3, staticmethod(abs)

        def gap(self, model):
            return 1.0 if model.early is None else np.sqrt(share) + abs(np.log(model.early.lead / 0.01))

        def bare(self):
            return self

        def fit_with_gap(self, model):
            return model, self.gap(model)

    model = base_model(("viscous", "coulomb"), views[2].scene)
    model = model.with_terms((model.terms[0], model.terms[1].with_slot(0, 0.3)))
    nothing = SimpleNamespace(mean=0.0)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(servo_start, "own", lambda *_: (nothing, None))
        patch.setattr(servo_start, "creeps", lambda *_: creeps)
        assert bool(servo_start.reversing_early(View(), model).early) == early


@pytest.mark.parametrize(("rate", "lead"), [(100.0, 9.5e-3), (50.0, None), (100.0, None)])
def test_a_reversal_within_a_row_is_early_only_if_the_friction_is(rate, lead):
    """What a drive held over a row does to a reversal, the model's own records show, too."""
    effects = [EarlyReversal(lead)] if lead else []
    log = make_servo_log(effects, duration=12.0, sample_rate=rate, random_state=4)
    plant = servo_plant("servo", log, law=None, tolerance=0.004, columns={})
    early = plant.settled(plant.base(np.random.default_rng(0))).early
    assert (early and early.lead) == (
        lead and pytest.approx(lead, abs=0.25 / rate)
    )  # the hold moves it by a part of one
