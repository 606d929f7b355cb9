"""Odd records of a servo axis: each ends in a verdict with finite, physical base numbers, or in a sentence."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from tests.gap.plants.example_servo import record_of
from whsklearn import ServoAxis
from whsklearn.datasets import make_servo_log
from whsklearn.effects import ActuatorLag, Coulomb, InputDelay, Saturation, Scales, Stribeck, Viscous
from whsklearn.effects.base import rms
from whsklearn.effects.surroundings import chatters
from whsklearn.gap import VERDICTS, GapFinder
from whsklearn.gap.plants import servo_families, servo_own, servo_run, servo_stop
from whsklearn.gap.plants.servo import ServoPlant
from whsklearn.gap.plants.servo_candidates import candidate
from whsklearn.gap.plants.servo_model import ServoTerm
from whsklearn.gap.plants.servo_start import base_model
from whsklearn.gap.proof import free_run_error, prove
from whsklearn.gap.record import ServoRecord
from whsklearn.systems import PIDController, Transmission

INERTIA, VISCOUS, COULOMB = 0.05, 0.12, 0.3


def record(rate=250.0, seconds=8.0, *, motion="rich", gravity=0.0, counts=0, jitter=0.0, units=1.0, seed=0):
    """A log by inverse dynamics: the motion is prescribed, the drive is what it asks for."""
    rng = np.random.default_rng(seed)
    t = np.arange(int(rate * seconds)) / rate
    t = t + jitter / rate * rng.uniform(-0.5, 0.5, t.size)
    ramp = np.clip(t, 0, 1) ** 2 * (3 - 2 * np.clip(t, 0, 1))
    tones = [(0.7, 2.1, 0.3), (0.4, 5.3, 1.1), (0.1, 13.0, 2.0)]
    q = ramp * sum(a * np.sin(w * t + p) for a, w, p in tones)
    if motion == "one way":
        q = 3.0 * t + 0.2 * ramp * np.sin(2.5 * t)
    if motion == "rests":
        q = np.where((t % 2.0) < 1.0, 0.5 - 0.5 * np.cos(np.pi * (t % 2.0)), np.where((t // 2) % 2 == 0, 1.0, 1.0))
        q = np.where((t // 2) % 2 == 0, q, 1.0 - np.where((t % 2.0) < 1.0, 0.5 - 0.5 * np.cos(np.pi * (t % 2.0)), 1.0))
    if motion == "steps":
        q = np.zeros_like(t)
    v = np.gradient(q, t)
    a = np.gradient(v, t)
    u = INERTIA * a + VISCOUS * v + COULOMB * np.tanh(v / 0.01) + gravity * np.cos(q)
    if motion == "steps":
        u, q = _stepped(t)
    q = q + 2e-5 * rng.standard_normal(t.size)
    if counts:
        q = np.round(q * counts / (2 * np.pi)) * 2 * np.pi / counts
    return pd.DataFrame({"time_s": t, "torque_nm": units * u, "position_rad": q})


def _stepped(t):
    """Drive and position under torque steps, forwards in fine steps."""
    u = np.where((t // 1.0) % 3 == 0, 1.0, np.where((t // 1.0) % 3 == 1, -1.0, 0.6 * (-1.0) ** (t // 3.0)))
    q, v, out, h, fine = 0.0, 0.0, np.empty_like(t), t[1] - t[0], 40
    for i in range(t.size):
        out[i] = q
        for _ in range(fine):
            v += h / fine * (u[i] - VISCOUS * v - COULOMB * np.tanh(v / 0.01)) / INERTIA
            q += h / fine * v
    return u, out


@pytest.mark.parametrize(
    "log",
    [
        pytest.param(lambda: record(counts=400, rate=125.0, seconds=6.0), id="coarse encoder"),
        pytest.param(lambda: record(rate=50.0, seconds=10.0), id="50 Hz"),
        pytest.param(lambda: record(rate=10_000.0, seconds=3.2), id="10 kHz"),
        pytest.param(lambda: record(jitter=0.2), id="jitter"),
        pytest.param(lambda: record(motion="one way"), id="one way"),
        pytest.param(lambda: record(motion="steps"), id="steps"),
        pytest.param(lambda: record(motion="rests", seconds=10.0), id="rests"),
    ],
)
def test_an_odd_record_ends_in_a_verdict_with_physical_numbers_or_a_sentence(log):
    finder = GapFinder("servo", max_effects=1).fit(log())
    d = finder.diagnosis_
    assert d.verdict in VERDICTS
    assert len(d.sentence) > 20
    numbers = {r["name"]: (r["before"], r["after"]) for r in d.base_parameters}
    assert all(np.all(np.isfinite(v)) for v in numbers.values())
    assert all(min(numbers[k]) >= 0 for k in ("inertia", "viscous", "coulomb") if k in numbers)
    assert np.all(np.isfinite([d.closure, d.floor, *d.before.values(), *d.after.values(), *d.figures]))


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_lost_sign_is_named_beside_another_effect_on_whichever_side_the_record_begins(side):
    """The path had been unfolded, and only the offset of the drive was named; one that began below zero was not."""
    log = record(rate=100.0, seconds=20.0)
    log = log.assign(torque_nm=side * log["torque_nm"] + 0.3 * COULOMB, position_rad=log["position_rad"].abs())
    finder = GapFinder("servo", max_effects=1).fit(log)
    assert [e.name for e in finder.effects_] == ["sensor_rectification", "input_offset"]


def test_a_limit_of_a_drive_that_changes_from_row_to_row_is_named_if_nothing_else_is_left():
    """Had other values acted between the rows, something would be left; friction by the load was named in its place."""
    rng, t = np.random.default_rng(3), np.arange(10_000) / 500.0
    axis = ServoAxis(
        inertia=INERTIA, law=[Viscous(VISCOUS), Coulomb(COULOMB)], effects=[Saturation(2.0)], sample_rate=500.0
    )
    drive = 1.5 * np.sin(3.0 * t) + np.sin(11.0 * t) + 0.6 * rng.standard_normal(t.size)
    assert chatters(drive - np.clip(drive, -2.0, 2.0))
    r = axis.simulate_drive(drive, noise=2e-5 * rng.standard_normal(t.size))
    finder = GapFinder("servo").fit(ServoRecord(r.time, r.drive, r.position))
    assert [e.name for e in finder.effects_] == ["saturation"]
    assert finder.effects_[0].effect.limit == pytest.approx(2.0, rel=0.02)


def test_a_spring_moves_beside_the_offset_that_it_stood_for():
    """Alone, a cubic moves its centre for a constant torque; beside it there, an offset explained a part."""
    log = record(seconds=12.0)
    plant, base, _ = plant_with(frame=log.assign(torque_nm=log.torque_nm + 2.0 * (log.position_rad - 0.1) ** 3 + 0.5))
    plant.looks(base, np.random.default_rng(0))
    spring = dataclasses.replace(candidate("hardening_spring"), whole=True)
    alone = servo_families.polished(plant.inverse, base, ServoTerm(spring, (0.0, 0.0)))
    grown = plant.refine(alone, SimpleNamespace(start=ServoTerm(candidate("input_offset"), (0.0,))))
    (stiffness, centre), (offset,) = (t.q for t in grown.added)
    assert abs(alone.terms[-1].q[1] - 0.1) > 0.1
    assert (stiffness, centre, offset) == pytest.approx((2.0, 0.1, 0.5), abs=0.03)


@pytest.mark.parametrize("units", [1.0, 1e3, 1e-3])
def test_the_unit_of_the_drive_scales_the_numbers_and_no_more(units):
    d = GapFinder("servo", max_effects=1).fit(record(gravity=5 * COULOMB, units=units)).diagnosis_
    inertia = next(r["after"] for r in d.base_parameters if r["name"] == "inertia")
    assert inertia / units == pytest.approx(INERTIA, rel=0.1)
    assert [e.name for e in d.effects][:1] == ["gravity_imbalance"]


@dataclass(frozen=True)
class Named:
    """A model of which only the name counts."""

    name: str
    timing: float = 0.0
    terms: tuple = ()
    has_play: bool = False

    def has_inertia(self, fitted):
        return True


@pytest.mark.parametrize(
    ("horizon", "asked", "logged", "chosen"),
    [(0.07, 0.1, 1.0, "found"), (0.5, 0.1, 1.0, "refitted"), (0.5, 1.5, 1.0, "found"), (0.5, 0.1, 20.0, "found")],
)
def test_numbers_for_simulation_are_compared_at_the_horizon_that_is_proved(monkeypatch, horizon, asked, logged, chosen):
    """A model that asks for more drive than reaches it stays near the path by its friction alone.

    ``logged``: the drive as logged, in multiples of the one that reaches the axis.
    """
    errors = {("found", 0.07): 1.0, ("found", 0.5): 9.0, ("refitted", 0.07): 5.0, ("refitted", 0.5): 4.0}
    monkeypatch.setattr(servo_run, "train_error", lambda view, m, horizon: errors[m.name, horizon])
    plant = object.__new__(ServoPlant)
    monkeypatch.setattr(ServoPlant, "_horizons", lambda self, m: (horizon, (horizon / 5, horizon, 4 * horizon)))
    monkeypatch.setattr(servo_stop, "holds", lambda m: False)
    found, refitted = Named("found"), Named("refitted")
    plant.observer, plant.corrected = SimpleNamespace(fit=lambda m: refitted), found
    plant.inverse = SimpleNamespace(left=lambda m: np.full(3, asked), target=lambda m: (None, logged))
    plant.scale = 1.0
    assert plant.to_simulate(found).name == chosen
    assert plant.headline == horizon


@pytest.mark.parametrize("name", ["flexible_coupling", "backlash", "cable_spring"])
def test_missing_drive_behind_a_second_mass_is_told_by_the_observer(name):
    plant = object.__new__(ServoPlant)
    for side, gaps in (("inverse", (3.0, 2.9, 0.1)), ("observer", (1.0, 0.2, 0.05))):
        view = SimpleNamespace(gap=lambda m, g=gaps: g[m.at], rms=float, floor=gaps[2])
        view.fit_with_gap = lambda m, g=gaps: (m, g[m.at])
        view.own = object()  # a look has been at what is left
        setattr(plant, side, view)
    plant.own = SimpleNamespace(floor=0.1)
    base = SimpleNamespace(at=0, terms=(), has_curves=False)
    model = SimpleNamespace(at=1, terms=(SimpleNamespace(kind=candidate(name)),), has_curves=False)
    assert plant.figures(base, model, 0.3) == (
        (3.0, 2.9, 0.1, 0.3, False) if name == "cable_spring" else (1.0, 0.2, 0.05, 0.0, True)
    )


@pytest.mark.parametrize("noise", [0.005, 0.02])
def test_a_record_for_the_proof_has_the_noise_of_the_drives_reading(noise):
    """The floor of a free run, which is the error of a true model, grows with what a sensor adds to the drive."""
    log = record_of()
    read = log.drive + noise * rms(log.drive) * np.random.default_rng(4).standard_normal(len(log))
    plant = ServoPlant(dataclasses.replace(log, drive=read), ("viscous",), None, 0.004)
    base = plant.settled(plant.base(np.random.default_rng(0)))
    plant.looks(base, np.random.default_rng(0))
    model = plant.to_simulate(base)
    row = prove(plant, model, model, np.random.default_rng(0))[1]
    own = [free_run_error(plant.made(model, np.random.default_rng(s)), model, row["horizon"])["rmse"] for s in range(5)]
    assert row["after"] == pytest.approx(rms(np.array(own)), rel=0.35)


GAP, CONTACT, SHARE = 0.03, 45.0, 0.5  # rad, Hz, of the inertia behind the play


def log_with_play(side, rate=200.0, seconds=10.0):
    """A log of two masses with play: the controller sees the motor, the log's encoder is on ``side``."""
    t = np.arange(int(rate * seconds)) / rate
    tones = [(1.2, 0.35, 0.0), (0.25, 1.3, 1.0), (0.08, 2.9, 2.0)]
    reference = np.minimum(t, 1.0) ** 2 * sum(a * np.sin(2 * np.pi * f * t + p) for a, f, p in tones)
    stiffness = INERTIA * SHARE * (1 - SHARE) * (2 * np.pi * CONTACT) ** 2
    axis = ServoAxis(
        inertia=INERTIA, law=[Viscous(0.1), Coulomb(0.15)], sample_rate=rate,
        controller=PIDController(kp=15.0, ki=0.0, kd=1.0),
        transmission=Transmission(load_share=SHARE, stiffness=stiffness, damping_ratio=0.5, gap=GAP),
    )  # fmt: skip
    run = axis.simulate(reference, noise=False)
    position = run.load_position if side == "load" else run.true_position
    position = position + 2e-5 * np.random.default_rng(0).standard_normal(t.size)
    return pd.DataFrame({"time_s": t, "torque_nm": run.drive, "position_rad": position})


@pytest.mark.parametrize("side", ["load", "motor"])
def test_a_large_play_is_named_from_either_side(side):
    finder = GapFinder("servo", max_effects=1).fit(log_with_play(side))
    d = finder.diagnosis_
    assert d.verdict == "named"
    assert [e.name for e in d.effects] == ["backlash"]
    effect = d.effects[0].effect
    crossed = INERTIA * (1 - SHARE) * GAP  # what the drive pays for the gap seen from the load
    inertia = next(r["after"] for r in d.base_parameters if r["name"] == "inertia")
    assert inertia * (1 - effect.load_share) * effect.gap == pytest.approx(crossed, rel=0.1)
    assert d.closure > 0.95


def plant_with(*names, frame):
    """(plant, base model, model with these effects fitted)."""
    plant = ServoPlant(ServoRecord.from_frame(frame), ("viscous", "coulomb"), None, 0.004)
    base = plant.settled(plant.base(np.random.default_rng(0)))
    model = base
    for name in names:
        kind = candidate(name)
        model = plant.inverse.fit(
            model.with_term(ServoTerm(kind, (*([0.0] * kind.linear), *kind.starts(base.scene)[0])))
        )
    return plant, base, model


def test_runs_are_compared_by_the_torque_that_they_lack():
    """A sluggish axis leaves the path slowly whatever it lacks; that is no reason to take gravity back."""
    plant, base, model = plant_with("gravity_imbalance", frame=record(gravity=0.6))
    sluggish = dataclasses.replace(base, inertia=20.0 * base.inertia)
    assert plant.contributes(sluggish, model)
    gravity = model.terms[-1]
    wrong = model.with_terms((*model.terms[:-1], dataclasses.replace(gravity, q=tuple(-x for x in gravity.q))))
    assert not plant.contributes(base, wrong)
    assert not plant.contributes(base, dataclasses.replace(base, inertia=0.95 * base.inertia)), "hardly less is lacking"
    assert not plant.contributes(model, base)


def test_an_inertia_that_is_lost_is_that_of_the_first_differences():
    frame = record(seconds=12.0)
    frame["torque_nm"] += 2.0 * np.sin(2.1 * frame["time_s"] + 0.3)  # slow, coherent with the motion, in no model here
    plant, _, model = plant_with(frame=frame)
    (found,) = plant.inverse.of_differences(dataclasses.replace(model, inertia=1e-3 * INERTIA))
    assert model.inertia < 0.8 * INERTIA
    assert found.inertia == pytest.approx(INERTIA, rel=0.1)


@pytest.mark.parametrize("share", [0.5, 0.2])
def test_differences_behind_a_limit_tell_the_numbers_of_the_axis(share):
    """A gap is a share of the drive as logged, the numbers of a model are not."""
    frame = record(seconds=12.0)
    plant, _, model = plant_with(frame=frame)
    limit = ServoTerm(candidate("saturation"), (share * float(np.abs(frame["torque_nm"]).max()),))
    limited = plant.inverse.fit(model.with_term(limit))
    (found,) = plant.inverse.of_differences(limited)
    assert found.inertia == pytest.approx(limited.inertia, rel=0.5)
    for one, other in zip(found.terms, limited.terms, strict=True):
        assert one.q[0] == pytest.approx(other.q[0], rel=0.5)


def test_a_fit_along_the_run_keeps_the_range_of_the_models_inertia():
    plant, base, _ = plant_with(frame=record(seconds=12.0))
    about = dataclasses.replace(base, scene=dataclasses.replace(base.scene, inertia=30.0 * base.scene.inertia))
    assert plant.observer.fit(about).scene.inertia == about.scene.inertia


def test_differences_without_a_positive_inertia_leave_the_models_as_fitted():
    frame = record(seconds=12.0)
    plant, _, model = plant_with(frame=frame)
    plant.looks(model, np.random.default_rng(0))
    lost = plant.corrected = dataclasses.replace(model, inertia=1e-3 * INERTIA)
    plant.inverse.drive = -plant.inverse.drive  # a drive against the motion: the differences tell a negative inertia
    assert plant.inverse.of_differences(lost) == []
    assert plant.to_simulate(lost).inertia > 0.0


def test_a_fit_along_the_run_leaves_a_poor_minimum_and_never_a_good_one():
    """Shapes fitted with the artefacts of another model; here simply wrong ones."""
    true = Stribeck(0.3, 0.1)
    log = make_servo_log([true], duration=12.0, random_state=3)
    plant, _, model = plant_with("stribeck", frame=log)
    at = model.terms[-1]
    wrong = plant.inverse.fit(model.with_terms((*model.terms[:-1], at.with_slot(1, 6.0 * true.velocity))))
    plant.inverse.own = servo_own.own(plant.inverse, wrong, np.random.default_rng(0))[0]
    found = plant.along_the_run(wrong)
    assert found.terms[-1].q[1] == pytest.approx(true.velocity, rel=0.2)
    left = [plant.rms(plant.errors(m)) for m in (found, plant.along_the_run(found))]
    assert left[1] <= left[0]


def test_a_search_in_vain_at_higher_frequencies_leaves_the_plant_as_it_was():
    log = ServoRecord.from_frame(record(seconds=16.0, rate=500.0, counts=4096))
    plant = ServoPlant(log, ("viscous", "coulomb"), None, 0.004)
    rng = np.random.default_rng(0)
    model = plant.settled(plant.base(rng))
    plant.looks(model, rng)
    own, kept = plant.inverse.own, plant.snapshot()
    assert plant.sharpened(model)
    plant.looks(plant.settled(model), rng)
    assert plant.inverse.cutoff > kept["inverse"].cutoff
    plant.lead, plant.record = 0.01, None  # as if the drive had been found late, and moved
    plant.restore(kept)
    assert [k for k, v in vars(plant).items() if v is not kept[k]] == []
    assert (plant.inverse.own, plant.sharp) == (own, False)


@pytest.mark.parametrize(("inertia", "complete"), [(5.0, True), (1.0, False), (9.0, True)])
def test_the_noise_that_a_complete_model_leaves_is_that_of_its_own_inertia(inertia, complete):
    """A base model compensates for a slow force with inertia, which multiplies the encoder's noise in its records."""
    plant = SimpleNamespace(
        own=SimpleNamespace(floor=1.0), corrected=SimpleNamespace(inertia=5.0), tolerance=0.0, scale=1.0,
        rms=lambda e: e, errors=lambda model: 1.2,
    )  # fmt: skip
    assert ServoPlant.silent(plant, SimpleNamespace(inertia=inertia)) is complete


@pytest.mark.parametrize(
    ("unit", "word"), [("Nm", "torque"), ("mA", "current"), ("Arms", "current"), ("mV", "voltage"), ("%", "drive")]
)
def test_what_is_missing_is_called_by_what_the_drive_is(unit, word):
    t = np.arange(400) / 100
    record = ServoRecord(t, np.cos(t), np.sin(t), units=(unit, "deg"))
    assert ServoPlant(record, ("viscous", "coulomb"), None, 0.004).gap_word == f"missing {word}"


def test_a_limit_that_the_fitted_samples_do_not_reach_runs_no_worse():
    """They run alike with it and without it; a limit reached in one held-out stretch only was refused for that."""
    columns = record().to_numpy().T
    plant = ServoPlant(ServoRecord(*columns), ("viscous", "coulomb"), None, 0.004)
    base = plant.base(np.random.default_rng(0))
    limits = np.abs(columns[1]).max() * np.array([1.1, 0.5])
    worse = [plant._runs_worse(base, base.with_term(ServoTerm(candidate("saturation"), (x,)))) for x in limits]
    assert worse == [False, True]


def test_a_run_is_judged_with_numbers_that_are_fitted_along_it(monkeypatch):
    """Those of inverse dynamics ran a true friction by the load farther off than the model without it."""
    plant = ServoPlant(ServoRecord.from_frame(record()), ("viscous", "coulomb"), None, 0.004)
    base = plant.base(np.random.default_rng(0))
    grown = base.with_term(ServoTerm(candidate("load_friction"), (0.04,)))
    error = {base: 2.4, grown: 3.0, "base along the run": 1.9, "grown along the run": 0.06}
    monkeypatch.setattr(servo_run, "train_error", lambda view, model, horizon: error[model])
    along = {base: "base along the run", grown: "grown along the run"}
    monkeypatch.setattr(type(plant.observer), "fit", lambda view, model: along[model])
    assert not plant._runs_worse(base, grown)
    error["grown along the run"] = 2.0
    assert plant._runs_worse(base, grown)


def test_a_long_lag_is_no_delay():
    """Before a lag the noise of the encoder is larger, so that inverse dynamics had a delay of 10.4 ms leave less."""
    finder = GapFinder().fit(make_servo_log([ActuatorLag(0.012)], duration=15.0, sample_rate=500.0, random_state=0))
    assert (finder.verdict_, [e.name for e in finder.effects_]) == ("named", ["actuator_lag"])
    assert finder.effects_[0].effect.time_constant == pytest.approx(0.012, rel=0.02)


def test_a_short_lag_is_no_delay_for_certain():
    """Without a free run of each it was `named` a delay, of an axis whose drive is mostly friction."""
    axis = ServoAxis(
        0.012, law=[Viscous(0.03), Coulomb(0.18)], controller=PIDController(kp=6.0, ki=0.0, kd=0.2), substeps=10
    )
    log = make_servo_log([ActuatorLag(0.004)], axis=axis, duration=15.0, amplitude=1.0, noise=2e-5, random_state=0)
    ((told,),) = [GapFinder().fit(log).effects_]
    assert "actuator_lag" in (told.name, *told.aliases)


@pytest.mark.parametrize(("error", "name", "open_"), [
    (0.6, "actuator_lag", ()), (0.8, "actuator_lag", ("input_delay",)), (1.3, "input_delay", ("actuator_lag",)),
    (1.5, "input_delay", ()),
])  # fmt: skip
def test_a_delay_and_a_lag_are_rivals_unless_a_run_halves_the_power_of_the_error(error, name, open_, monkeypatch):
    plant = ServoPlant(ServoRecord.from_frame(record()), ("viscous", "coulomb"), None, 0.004)
    late = plant.settled(plant.base(np.random.default_rng(0))).with_term(ServoTerm(candidate("input_delay"), (0.008,)))
    monkeypatch.setattr(type(plant.observer), "fit", lambda view, model: model)
    errors = {"input_delay": 1.0, "actuator_lag": error, "cogging": 1.0}
    monkeypatch.setattr(servo_run, "train_error", lambda view, model, horizon: errors[model.terms[-1].name])
    for before in ([], ["input_delay", "actuator_lag"]):
        told, rivals = plant.told_by_run(late, [*before, "backlash"])
        assert (told.terms[-1].name, rivals) == (name, ["backlash", *open_])
    _, rivals = plant.told_by_run(late.with_term(ServoTerm(candidate("cogging"), (0.1, 0.1, 3.0))), ["stribeck"])
    assert rivals == ["stribeck"]  # of the cogging


def test_a_model_has_no_more_numbers_than_the_record_has_independent_samples():
    """With 14 numbers for 13.6 samples, waves of friction and of the gain took the place of a pendulum's gravity."""
    plant = ServoPlant(ServoRecord.from_frame(record(seconds=4.0)), ("viscous", "coulomb"), None, 0.004)
    base = plant.base(np.random.default_rng(0))
    grown = plant.inverse.fit(base.with_term(ServoTerm(candidate("cogging"), (0.1, 0.0, 9.0))))
    before = plant.objection(base, grown)
    assert "more numbers" not in before
    plant.inverse.n_effective = grown.vector().size - 0.5
    assert "more numbers" in plant.objection(base, grown)


@pytest.mark.parametrize(("name", "periods", "silent", "too_little"), [
    ("cogging", 0.4, False, True), ("cogging", 0.4, True, False), ("cogging", 1.2, False, False),
    ("position_friction", 0.4, False, False),
])  # fmt: skip
def test_a_part_of_a_wave_is_a_name_only_if_nothing_else_is_missing(name, periods, silent, too_little, monkeypatch):
    """Any smooth function of the place was one: it was named for the gravity of three joints of an arm."""
    plant = object.__new__(ServoPlant)
    monkeypatch.setattr(ServoPlant, "silent", lambda *_: silent)
    scene = Scales(reach=0.2)
    kind = candidate(name)
    wave = ServoTerm(kind, (*(0.1,) * kind.linear, periods * np.pi / scene.reach))
    said = plant.too_little(base_model(("viscous", "coulomb"), scene).with_term(wave))
    assert bool(said) is too_little
    assert plant.too_little(base_model(("viscous", "coulomb"), scene)) == ""


@pytest.mark.parametrize(("beside", "too_little"), [
    ("hardening_spring", True), ("cable_spring", True), ("quadratic_drag", False)
])  # fmt: skip
def test_a_part_of_a_wave_beside_another_force_over_the_position_is_no_name(beside, too_little, monkeypatch):
    """With a third of a wave, a spring about a wrong centre did what it does about its own beside an offset."""
    plant = object.__new__(ServoPlant)
    monkeypatch.setattr(ServoPlant, "silent", lambda *_: True)
    scene, kind = Scales(reach=0.2), candidate(beside)
    other = ServoTerm(kind, (0.1,) * len(kind.fields))
    wave = ServoTerm(candidate("cogging"), (0.1, 0.1, 0.4 * np.pi / scene.reach))
    grown = base_model(("viscous", "coulomb"), scene).with_term(other).with_term(wave)
    assert bool(plant.too_little(grown)) is too_little


@pytest.mark.parametrize("share", [0.3, 0.7])
@pytest.mark.parametrize("order", [("backlash", "stribeck"), ("stribeck", "backlash")])
def test_a_play_and_what_comes_beside_it_explain_most_of_what_is_left(order, share, monkeypatch):
    """Beside a motor's cogging a play of 3 % of the drive bent all other numbers, until no name was left."""
    plant = object.__new__(ServoPlant)
    left = np.ones(100)
    monkeypatch.setattr(ServoPlant, "errors", lambda _, m: left * np.sqrt(1.0 - share * (len(m.terms) == 4)))
    monkeypatch.setattr(ServoPlant, "silent", lambda *_: True)
    scene = Scales(reach=1.0)
    model = base_model(("viscous", "coulomb"), scene)
    for name in order:
        kind = candidate(name)
        model = model.with_term(ServoTerm(kind, (*(0.1,) * kind.linear, *kind.starts(scene)[0])))
    assert ("impacts" in plant.too_little(model)) is (share < 0.5)


def test_a_fit_along_the_run_starts_with_the_friction_of_a_load_on_its_motor_too(monkeypatch):
    """Behind a filter that hides the resonance the two are nearly one, and the run has a minimum at either."""
    coupling = ServoTerm(candidate("flexible_coupling"), (8.7e-4, 0.335, 0.022, 0.145))
    found = base_model(("viscous", "coulomb"), Scales(dt=0.002, inertia=0.08)).with_term(coupling)
    starts = []
    plant = object.__new__(ServoPlant)
    monkeypatch.setattr(servo_run, "train_error", lambda view, m, horizon: m.terms[-1].q[-1])
    monkeypatch.setattr(ServoPlant, "_horizons", lambda self, m: (0.5, (0.1, 0.5, 2.0)))
    plant.observer, plant.corrected = SimpleNamespace(fit=lambda m: starts.append(m) or m), found
    plant.inverse = SimpleNamespace(left=lambda m: np.zeros(3), target=lambda m: (None, 1.0))
    plant.scale = 1.0
    assert plant.to_simulate(found).terms[-1].q[-1] == 0.0
    assert [m.terms[1].q[0] for m in starts] == [0.0, 0.145]


def test_the_error_of_a_delay_is_not_shared_with_the_age_that_is_held_beside_it():
    """Together they are known to a hundredth of a sample, and their split not at all."""
    log = make_servo_log([InputDelay(0.012)], duration=12.0, sample_rate=250.0, random_state=1)
    d = GapFinder(random_state=0).fit(log).diagnosis_
    assert [e.name for e in d.effects] == ["input_delay"]
    assert 0.0 < d.effects[0].standard_errors["delay_s"] < 0.25 / 250.0
    age = next(row for row in d.base_parameters if row["name"].startswith("age"))
    assert (age["after"], age["after_error"]) == (0.0, None)
