"""The inverse view: numbers of a known axis, large effects found, columns and signs as they must be."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from scipy.signal import cont2discrete, lfilter

from benchmarks.blind_logs import servo
from whsklearn.effects import ActuatorLag, AsymmetricViscous, Coulomb, GravityImbalance, LuGre, Saturation, Viscous
from whsklearn.gap import GapFinder
from whsklearn.gap.plants.servo import ServoPlant
from whsklearn.gap.plants.servo_candidates import candidate, catalogue
from whsklearn.gap.plants.servo_families import polished
from whsklearn.gap.plants.servo_inverse import too_large, unphysical
from whsklearn.gap.plants.servo_model import ServoTerm
from whsklearn.gap.plants.servo_start import filtered_motion, start_of, with_earlier_drive
from whsklearn.gap.proof import closure
from whsklearn.gap.record import ServoRecord
from whsklearn.systems import PIDController, ServoAxis

RATE, SECONDS = 500.0, 10.0
LARGE = {"time": "time_s", "drive": "torque_nm", "position": "position_rad"}
TIME = np.arange(int(RATE * SECONDS)) / RATE
REFERENCE = 1.4 * np.sin(1.7 * TIME) + 0.5 * np.sin(5.1 * TIME + 1) + 0.2 * np.sin(12.3 * TIME)


def log_of(effects=(), law="viscous", **law_numbers):
    axis = ServoAxis(inertia=0.05, law=law, effects=effects, sample_rate=RATE)
    return axis.simulate(reference=REFERENCE, random_state=1)


@pytest.fixture(scope="module")
def plain():
    r = log_of()
    return ServoRecord(r.time, r.drive, r.position)


def test_inertia_of_a_complete_model_is_the_true_one(plain):
    view, model = start_of(plain, ("viscous",), 0.004)
    assert model.inertia == pytest.approx(0.05, rel=0.03)
    assert view.rms(view.gap(model)) < 0.02 * model.scene.torque


def test_a_solution_is_kept_for_the_own_records_that_it_was_solved_with(plain):
    view, model = start_of(plain, ("viscous",), 0.004)
    before = view.gap(model)
    assert view.solved(model) is view.solved(replace(model))
    view.own = SimpleNamespace(mean=np.ones(before.size), weight=np.ones(before.size))
    assert view.rms(view.gap(model) - before) == pytest.approx(1.0, rel=0.2)  # viscous friction takes none of it
    view.own = None
    np.testing.assert_array_equal(view.gap(model), before)


def test_beside_a_lag_the_drive_is_not_early_as_well(plain):
    """The two would cancel: a lag of 240 ms stood beside the gravity of a pendulum, and the drive was as much early."""
    late = with_earlier_drive(plain, -5)  # logged 10 ms after it acted
    view, model = start_of(late, ("viscous",), 0.004)
    lagged = model.with_term(ServoTerm(candidate("actuator_lag"), (1e-6,)))
    assert view.rms(view.gap(model)) < 0.5 * view.rms(view.gap(lagged))


def test_noise_of_the_drive_leaves_the_same_residual_before_any_lag(plain):
    """Behind a lag it is smaller, which is no merit of the lag: one took the place of a motor's cogging."""
    view, model = start_of(plain, ("viscous",), 0.004)
    noise = 0.3 * np.random.default_rng(1).standard_normal(TIME.size)
    left = []
    for seconds in (1e-6, 0.02, 0.05):
        model_with = model.with_term(ServoTerm(candidate("actuator_lag"), (seconds,)))
        torque = plain.drive + seconds * np.gradient(plain.drive, plain.dt)  # what the lag turns into this drive
        noisy = view.beside(ServoRecord(plain.time, torque + noise, plain.position))
        left.append(noisy.rms(noisy.gap(model_with)))
    assert left[1:] == pytest.approx([left[0]] * 2, rel=0.1)


def test_the_drive_before_a_lag_is_that_of_the_log(plain):
    """(1 + T s) undoes 1 / (1 + T s) within half a sample, by which a sampled lag holds the drive."""
    view, model = start_of(plain, ("viscous",), 0.004)
    lagged = model.with_term(ServoTerm(candidate("actuator_lag"), (0.05,)))
    behind, before = view.blur(view.reaching(lagged)), view.target(lagged)[0]
    half = 0.5 * plain.dt * np.gradient(view.drive, view.step)
    error = {name: view.rms((x - view.drive - half)[view.at]) for name, x in (("behind", behind), ("before", before))}
    assert error["before"] < 0.01 * error["behind"]


@pytest.mark.parametrize("viscous", [0.1, 0.35])
def test_a_slow_log_of_a_true_lag_does_not_speak_against_it(viscous):
    """The drive is held for a sample, half of which inverse dynamics takes for its age: at 50 Hz the run was worse."""
    t = np.arange(1500) / 50.0
    tones = ((3.8, 0.11), (5.0, 0.9), (3.0, 2.3))
    axis = ServoAxis(
        inertia=0.05, law=[Viscous(viscous), Coulomb(0.8 * viscous)], effects=[ActuatorLag(0.03)], sample_rate=50.0
    )
    drive = viscous * sum(a * np.sin(2 * np.pi * f * t) for a, f in tones)
    r = axis.simulate_drive(drive, noise=1e-3 * np.random.default_rng(1).standard_normal(t.size))
    plant = ServoPlant(ServoRecord(r.time, r.drive, r.position), ("viscous", "coulomb"), None, 0.004)
    base = plant.base(np.random.default_rng(0))
    plant.looks(base, np.random.default_rng(0))  # which tell what the filters leave
    lagged = polished(plant.inverse, base, ServoTerm(candidate("actuator_lag"), (0.033,)))  # ages are a tenth apart
    assert lagged.terms[-1].q[0] == pytest.approx(0.03, rel=0.1)
    assert not plant.objection(base, lagged)


def test_a_large_hidden_effect_is_found_first_and_the_base_numbers_stay_physical():
    r = log_of([GravityImbalance(1.5, 0.3)])
    frame = pd.DataFrame({"time_s": r.time, "torque_nm": r.drive, "position_rad": r.position})
    finder = GapFinder("servo", law="viscous", max_effects=1).fit(frame)
    assert finder.effects_[0].name == "gravity_imbalance"
    assert finder.effects_[0].effect.amplitude == pytest.approx(1.5, rel=0.04)
    assert finder.model_.inertia == pytest.approx(0.05, rel=0.1)
    assert finder.diagnosis_.closure > 0.8


@pytest.fixture(scope="module")
def stalled():
    """Six seconds of an axis that lifts a weight until dry friction holds it, against any drive from then on.

    With this noise, unlike that of most seeds, a name was certain.
    """
    time = np.arange(1140) / 190.0
    drive = np.where(time < 2.2, 0.2 + time / 2.2, 1.2 + 0.35 * np.sin(0.9 * (time - 2.2)))
    axis = ServoAxis(inertia=0.02, law=[Viscous(0.8), Coulomb(0.2)], effects=[GravityImbalance(1.5)], sample_rate=190.0)
    r = axis.simulate_drive(drive, noise=3e-4 * np.random.default_rng(4).standard_normal(time.size))
    return ServoRecord(r.time, r.drive, r.position)


def test_rests_say_nothing_of_a_short_log(stalled):
    """With them, a weight of 1.5 Nm was one of 1.41 Nm, and a limit of the drive stood for the friction at rest."""
    view, model = start_of(stalled, ("viscous", "coulomb"), 0.004)
    assert not view.usable[view.time[:: view.every] > 5.0].any()
    weighed = polished(view, model, ServoTerm(candidate("gravity_imbalance"), (1.0, 0.0)))
    assert np.hypot(*weighed.terms[-1].q[:2]) == pytest.approx(1.5, rel=0.04)


def test_no_name_is_certain_in_a_short_log(stalled):
    finder = GapFinder("servo").fit(stalled)
    assert finder.plant_.inverse.n_effective < 30.0
    assert finder.verdict_ != "named"


def test_friction_never_turns_negative(plain):
    pushed = ServoRecord(plain.time, plain.drive - 0.3 * np.gradient(plain.position, plain.time), plain.position)
    _, model = start_of(pushed, ("viscous", "coulomb"), 0.004)
    assert min(t.q[0] for t in model.terms) >= 0.0


@pytest.mark.parametrize(("share", "refused"), [(0.02, True), (0.5, False)])
def test_a_limit_at_which_the_drive_always_stands_is_refused(plain, share, refused):
    view, model = start_of(plain, ("viscous",), 0.004)
    limited = model.with_term(ServoTerm(candidate("saturation"), (share * float(np.abs(plain.drive).max()),)))
    assert ("beside its sign" in unphysical(view, limited, 1)) == refused


def test_a_limit_is_named_under_a_controller_that_winds_up():
    """It asks for 4,000 times the limit; the base model has 160 times the inertia, and no limit leaves nothing."""
    goals = np.repeat(np.random.default_rng(0).uniform(-0.8, 0.8, 24), 400)
    winding_up = PIDController(kp=100.0, ki=200.0, kd=5.0)
    law = [Viscous(0.05), Coulomb(0.1)]
    axis = ServoAxis(inertia=0.04, law=law, effects=[Saturation(0.5)], controller=winding_up, sample_rate=RATE)
    r = axis.simulate(goals, random_state=0)
    assert np.abs(r.drive).max() > 1000.0
    finder = GapFinder("servo").fit(ServoRecord(r.time, r.drive, r.position))
    assert (finder.verdict_, [e.name for e in finder.effects_]) == ("named", ["saturation"])
    found = finder.effects_[0]
    error = next(iter(found.standard_errors.values()))
    assert abs(found.effect.limit - 0.5) < max(3.0 * error, 0.001)
    assert error < 0.01, "as large as what is left of the drive behind the limit, not of all that was asked for"


def test_what_a_limited_model_leaves_is_a_share_of_the_drive_as_logged_with_its_own_numbers_too(plain):
    view, model = start_of(plain, ("viscous", "coulomb"), 0.004)
    limit = ServoTerm(candidate("saturation"), (0.3 * float(np.abs(plain.drive).max()),))
    limited = view.fit(model.with_term(limit))
    assert view.rms(view.as_learned(limited)) == pytest.approx(view.rms(view.gap(limited)), rel=0.05)


def test_a_dead_zone_of_the_whole_drive_explains_nothing(plain):
    view, model = start_of(plain, ("viscous",), 0.004)
    dead = ServoTerm(candidate("dead_zone"), (1.01 * float(np.abs(plain.drive).max()),))
    assert view.rms(view.gap(model.with_term(dead))) == pytest.approx(view.rms(view.gap(model)))


def test_beside_a_limit_that_leaves_little_of_the_drive_nothing_is_named():
    """Its controller asks for ten times the limit, as scripts for MuJoCo do; stiff couplings were named, certain."""
    goals = np.repeat(np.random.default_rng(0).uniform(-0.8, 0.8, 24), 400)
    steps = cont2discrete((60.0, [1.0, 14.0, 60.0]), 1.0 / RATE)
    reference = lfilter(steps[0].ravel(), steps[1], goals)
    stiff = PIDController(kp=36.0, ki=0.0, kd=1.8)
    law = [Viscous(0.2), Coulomb(0.25)]
    axis = ServoAxis(inertia=0.04, law=law, effects=[Saturation(0.7)], controller=stiff, sample_rate=RATE)
    r = axis.simulate(reference, random_state=0)
    finder = GapFinder("servo").fit(ServoRecord(r.time, r.drive, r.position))
    assert (finder.verdict_, [e.name for e in finder.effects_]) == ("named", ["saturation"])
    assert finder.effects_[0].effect.limit == pytest.approx(0.7, rel=1e-3)


@pytest.mark.parametrize(("steps", "refused"), [(0.4, True), (3.0, False)])
def test_a_play_narrower_than_a_step_of_the_encoder_is_refused(plain, steps, refused):
    """The friction of MuJoCo creeps; a play of 0.4 steps was named for it, with certainty, beside a true delay."""
    step = 0.002 * float(np.ptp(plain.position))
    counted = ServoRecord(plain.time, plain.drive, step * np.round(plain.position / step))
    view, model = start_of(counted, ("viscous",), 0.004)
    loose = model.with_term(ServoTerm(candidate("backlash"), (steps * step, 0.3, 30.0, 0.5, 0.0)))
    assert ("narrower" in unphysical(view, loose, 1)) == refused


@pytest.mark.parametrize(
    ("seed", "names"),
    [
        (9052, {"input_offset", "load_friction"}),
        (9030, {"cable_spring", "gravity_imbalance"}),
        (9002, {"cable_spring", "cogging", "input_offset"}),
    ],
    ids=[
        "a gear's friction without Coulomb's",
        "no constant beside a spring's place of rest",
        "a constant that no place of rest can hold",
    ],
)
def test_large_effects_are_found_and_nothing_that_only_stood_for_them(seed, names):
    finder = GapFinder("servo", law="viscous").fit(servo.make_large(seed).frame, **LARGE)
    assert finder.verdict_ == "named"
    assert {e.name for e in finder.effects_} == names


def test_added_columns_never_worsen_the_fit(plain):
    view, model = start_of(plain, ("viscous",), 0.004)
    before = view.rms(view.gap(model))
    for name in ("coulomb", "gravity_imbalance", "cable_spring"):
        kind = candidate(name)
        shape = kind.starts(model.scene)[0]
        grown = view.fit(model.with_term(ServoTerm(kind, (*([0.0] * kind.linear), *shape))))
        assert view.rms(view.gap(grown)) <= before + 1e-4 * model.scene.torque  # the ridge


@pytest.mark.parametrize("rate", [50.0, 1000.0, 10_000.0])
def test_smoothed_motion_has_no_phantom_spring(rate):
    t = np.arange(int(4 * rate)) / rate
    _, _, a = filtered_motion(np.full(t.size, 100.0), 1 / rate, min(8.0, 0.04 * rate))
    assert np.abs(a).max() < 1e-6
    _, _, a = filtered_motion(0.5 * t**2, 1 / rate, min(8.0, 0.04 * rate))
    assert a[t.size // 3 : -t.size // 3] == pytest.approx(1.0, abs=1e-6)


def test_a_run_that_is_worse_has_negative_closure_even_at_the_floor():
    assert closure(1.0, 50.0, 1.0) < 0.0


def test_bristles_with_damping_are_named_and_their_level_is_found_to_fall():
    """As MuJoCo's dcmotor has them: the kick behind a reversal is several times the friction, Dahl's has none."""
    true = LuGre(0.12, distance=2e-3, ratio=1.6, velocity=0.3, damping=0.03)
    axis = ServoAxis(inertia=0.05, law="viscous", effects=[true], sample_rate=RATE)
    r = axis.simulate(reference=REFERENCE, random_state=1)
    frame = pd.DataFrame({"time_s": r.time, "torque_nm": r.drive, "position_rad": r.position})
    finder = GapFinder("servo", law="viscous,coulomb").fit(frame)
    assert [e.name for e in finder.effects_] == ["presliding_hysteresis"]
    found = finder.effects_[0].effect
    assert isinstance(found, LuGre)
    assert (found.ratio, found.damping) == pytest.approx((true.ratio, true.damping), rel=0.1)
    assert finder.diagnosis_.closure > 0.9


@pytest.mark.parametrize(("change", "objected"), [(-0.3, False), (0.5, False), (-0.996, True)])
def test_a_drive_that_loses_all_its_effect_is_no_explanation(change, objected):
    """With next to no gain, inertia and missing torque are next to nothing, and whatever is missing is "explained"."""
    r = log_of()
    view, base = start_of(ServoRecord(r.time, r.drive, r.position), ("viscous",), 0.004)
    gain = replace(candidate("parameter_change"), choice=(("parameter", "gain"),))
    assert bool(unphysical(view, base.with_term(ServoTerm(gain, (change, 3.0))), len(base.terms))) is objected


@pytest.mark.parametrize("name", ["cogging", "load_friction"], ids=["of the motion", "of the model's own torque"])
def test_a_fit_with_its_gap_is_the_fit_and_its_gap(name):
    r = log_of()
    view, base = start_of(ServoRecord(r.time, r.drive, r.position), ("viscous",), 0.004)
    kind = candidate(name)
    grown = base.with_term(ServoTerm(kind, (*([0.0] * kind.linear), *kind.starts(base.scene)[0])))
    fitted, left = view.fit_with_gap(grown)
    np.testing.assert_array_equal(fitted.vector(), view.fit(grown).vector())
    np.testing.assert_allclose(left, view.gap(view.fit(grown)), atol=1e-12)


@pytest.mark.parametrize(("lost", "objected"), [(0.6, False), (0.95, True)], ids=["self-locking screw", "locked"])
def test_a_gear_may_lose_more_than_half_of_its_torque_but_not_nearly_all(lost, objected):
    r = log_of()
    _, base = start_of(ServoRecord(r.time, r.drive, r.position), ("viscous",), 0.004)
    grown = base.with_term(ServoTerm(candidate("load_friction"), (lost,)))
    assert bool(too_large(grown.terms[-1])) is objected


@pytest.mark.parametrize("parameter", ["viscous", "inertia"])
def test_a_change_that_leaves_a_negative_friction_or_inertia_is_no_explanation(parameter):
    """A loop that diverges looked like friction that begins to drive the axis, with certainty."""
    r = log_of(viscous=0.1)
    view, base = start_of(ServoRecord(r.time, r.drive, r.position), ("viscous",), 0.004)
    before = base.inertia if parameter == "inertia" else base.terms[0].q[0]
    changed = replace(candidate("parameter_change"), choice=(("parameter", parameter),))
    for share, objected in ((-0.9, False), (-1.9, False), (-2.1, True), (2.0, False)):  # one of -1.9 may be one of -1
        model = base.with_term(ServoTerm(changed, (share * before, 3.0)))
        assert ("negative" in unphysical(view, model, len(base.terms))) is objected


def test_an_asymmetry_that_dry_friction_outweighs_is_named():
    axis = ServoAxis(
        inertia=0.05, law=[Viscous(0.1), Coulomb(0.5)], effects=[AsymmetricViscous(0.12)], sample_rate=RATE
    )
    r = axis.simulate(reference=REFERENCE, random_state=1)
    finder = GapFinder("servo").fit(ServoRecord(r.time, r.drive, r.position))
    assert (finder.verdict_, [e.name for e in finder.effects_]) == ("named", ["asymmetric_viscous"])


@pytest.mark.parametrize(("viscous", "certain"), [(0.02, True), (0.5, False)])
def test_friction_that_falls_nowhere_is_no_certain_stribeck_curve(plain, viscous, certain):
    """A wide curve beside a larger viscous term bends the friction upwards, as drag does that begins at some speed."""
    plant = ServoPlant(plain, ("viscous",), None, 0.004)
    base = plant.base(np.random.default_rng(0))
    model = base.with_terms((base.terms[0].with_slot(0, viscous), ServoTerm(candidate("stribeck"), (0.1, 0.4, 2.0))))
    assert not unphysical(plant.inverse, model, 1)
    assert plant.enough(model) is certain


@pytest.mark.parametrize(("damping", "objected"), [(0.01, False), (0.3, True)])
def test_bristles_that_are_dampers_are_none(plain, damping, objected):
    """Their damping ratio, c sqrt(s / J) / 2, is 0.7 and 21; fits had ended at 18 and 74 in place of other friction."""
    view, base = start_of(plain, ("viscous",), 0.004)
    bristles = LuGre(torque=1.0, distance=1e-3, ratio=1.0, damping=damping)
    kind = next(c for c in catalogue() if c.cls is LuGre)
    model = base.with_term(ServoTerm(kind, tuple(getattr(bristles, f) for f in kind.fields)))
    assert ("damped" in unphysical(view, model, 1)) is objected


def test_a_change_of_the_gain_takes_no_credit_for_the_gravity_that_it_takes_away():
    """Where gravity is most of the drive, half of the drive gone is half of the gap gone, but half of the whole too."""
    axis = ServoAxis(inertia=0.05, law="viscous", effects=[GravityImbalance(1.5, 0.3)], sample_rate=RATE)
    r = axis.simulate(reference=0.4 * np.sin(0.6 * TIME) + 0.2 * np.sin(1.9 * TIME), random_state=1)
    plant = ServoPlant(ServoRecord(r.time, r.drive, r.position), ("viscous",), None, 0.004)
    base = plant.base(np.random.default_rng(0))
    plant.n_effective = plant.inverse.n_effective
    gain = replace(candidate("parameter_change"), choice=(("parameter", "gain"),))
    terms = {"gain": ServoTerm(gain, (0.0, 3.0)), "gravity": ServoTerm(candidate("gravity_imbalance"), (0.0, 0.0))}
    look = SimpleNamespace(swapped=False)
    size = {name: plant.explained(base, base.with_term(term), look)[1] for name, term in terms.items()}
    assert size["gain"] < 0.5 * size["gravity"]
