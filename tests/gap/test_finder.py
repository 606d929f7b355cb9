"""The line end to end on logs that the library's simulator did not make."""

from __future__ import annotations

import json

import numpy as np
import pandas as pd
import pytest

from benchmarks.blind_logs.servo import COLUMNS, make_case
from tests.foreign_frame import ForeignFrame
from tests.gap.plants.example_servo import shaken
from whsklearn.datasets import make_servo_log
from whsklearn.effects import Coulomb, PositionFriction, Quantization, Viscous
from whsklearn.gap import VERDICTS, GapFinder
from whsklearn.gap.plant import Linearised
from whsklearn.gap.plants.servo import ServoPlant
from whsklearn.gap.plants.servo_candidates import candidate
from whsklearn.gap.plants.servo_model import ServoTerm
from whsklearn.gap.plants.servo_start import start_of
from whsklearn.gap.record import ServoRecord
from whsklearn.gap.standard_errors import labelled_errors
from whsklearn.systems import PIDController, ServoAxis

SHORT = {"seconds": 14.0, "rate": 500.0, "noise": 1e-4}


@pytest.fixture(scope="module")
def cogging():
    case = make_case("named", 21, effects=("cogging",), size=0.06, **SHORT)
    return case, GapFinder("servo").fit(case.frame, **COLUMNS)


@pytest.mark.slow
@pytest.mark.parametrize(
    "name", ["stribeck", "cable_spring", "torque_ripple", "saturation", "disturbance_tone", "dead_zone"]
)
def test_hidden_effect_gets_its_name(name):
    case = make_case("named", 33, effects=(name,), size=0.06, **SHORT)
    finder = GapFinder("servo").fit(case.frame, **COLUMNS)
    assert (finder.verdict_, [e.name for e in finder.effects_]) == ("named", [name])
    assert finder.diagnosis_.after["rmse"] < finder.diagnosis_.before["rmse"]


@pytest.mark.parametrize("order", [1.0, 2.0])
def test_friction_that_varies_along_a_short_travel_gets_its_name(order):
    """Less than a period of it is passed, so its order may stay unknown, but no other effect is like it."""
    log = make_servo_log(
        [PositionFriction(0.1, order, phase=0.4)], amplitude=0.7, duration=14.0, sample_rate=500.0, random_state=0
    )
    assert order * np.ptp(log["position_rad"]) < 2.0 * np.pi
    finder = GapFinder("servo").fit(log)
    assert [e.name for e in finder.effects_] == ["position_friction"]
    assert finder.diagnosis_.closure > 0.95


@pytest.mark.slow
@pytest.mark.parametrize("name", ["backlash", "encoder_eccentricity", "sensor_rectification"])
def test_what_changes_the_path_or_the_reading_closes_the_gap_in_simulation(name):
    case = make_case("named", 52, effects=(name,), size=0.06, seconds=14.0, rate=500.0, noise=2e-5)
    finder = GapFinder("servo").fit(case.frame, **COLUMNS)
    assert (finder.verdict_, [e.name for e in finder.effects_]) == ("named", [name])
    assert finder.diagnosis_.closure > 0.8


def test_a_reading_in_degrees_is_taken_as_such_and_the_reference_may_be_left_out(cogging):
    case, finder = cogging
    frame = case.frame.assign(position_deg=np.rad2deg(case.frame["position_rad"]))
    again = GapFinder("servo", max_effects=1).fit(frame, **{**COLUMNS, "position": "position_deg", "reference": None})
    assert again.verdict_ == finder.verdict_
    assert again.effects_[0].effect.labelled()["order"] == pytest.approx(finder.effects_[0].effect.order, rel=1e-6)


def test_a_number_that_moves_no_fitted_sample_has_no_standard_error():
    case = make_case("none", 61, **SHORT)
    record = ServoRecord.from_frame(case.frame, **COLUMNS)
    _, model = start_of(record, ("viscous", "coulomb"), 0.004)
    kind = candidate("parameter_change")
    model = model.with_term(ServoTerm(kind, (0.01, 6.0)))
    jac = np.random.default_rng(0).standard_normal((200, model.vector().size))
    jac[:, -1] = 0.0  # its time lies between two fitted segments
    x, (low, high) = model.vector(), model.bounds()
    errors = labelled_errors(Linearised(x, low, high, np.full(200, 1e-3), jac, model.with_vector), 2)
    assert errors["change"] > 0
    assert "time_s" not in errors


def test_nothing_is_named_where_nothing_is_missing():
    case = make_case("none", 3, **SHORT)
    finder = GapFinder("servo").fit(case.frame, **COLUMNS)
    assert finder.effects_ == []
    assert finder.verdict_ in ("no_gap", "not_testable")


def test_a_drive_that_changes_at_every_sample_hides_nothing():
    """Its own records must be shaken as it is: with a motion that was a sample late, something seemed to be missing."""
    assert GapFinder("servo").fit(shaken()).verdict_ == "no_gap"


def test_coloured_noise_gets_no_name():
    case = make_case("coloured", 8, size=0.05, **SHORT)
    assert GapFinder("servo").fit(case.frame, **COLUMNS).effects_ == []


def test_numbers_of_the_effect_are_near_the_truth(cogging):
    case, finder = cogging
    found = finder.effects_[0]
    labels = found.effect.labelled()
    assert labels["amplitude_nm"] == pytest.approx(case.parameters["cogging"], rel=0.05)
    assert labels["order"] == pytest.approx(case.parameters["cogging_k"], abs=0.05)
    assert found.standard_errors["amplitude_nm"] < 0.05 * labels["amplitude_nm"]


def test_file_keeps_the_contract(cogging, tmp_path):
    _, finder = cogging
    page = finder.report(tmp_path)
    data = json.loads((tmp_path / "gap.json").read_text(encoding="utf-8"))
    assert list(data)[:10] == [
        "verdict", "effects", "candidates", "where", "before", "after", "noise_floor_rmse", "closure",
        "next_experiment", "seconds",
    ]  # fmt: skip
    assert data["verdict"] in VERDICTS
    assert set(data["effects"][0]) == {
        "name", "place", "equation", "parameters", "standard_errors", "delta_bic", "p_value", "confidence", "aliases"
    }  # fmt: skip
    assert {c["status"] for c in data["candidates"]} <= {"named", "ruled_out", "alias", "not_testable"}
    assert set(data["before"]) == {"nmse", "mu_e", "rmse"}
    assert 0.8 < data["closure"] <= 1.0
    text = page.read_text(encoding="utf-8")
    assert "cogging" in text
    assert "http" not in text.replace("http-equiv", "")


def test_repaired_model_holds_the_effect(cogging):
    _, finder = cogging
    assert [e.name for e in finder.model_.effects] == ["cogging"]
    assert finder.model_.inertia > 0


def test_same_seed_same_answer(cogging):
    case, finder = cogging
    again = GapFinder("servo").fit(case.frame, **COLUMNS).diagnosis_.as_dict()
    first = finder.diagnosis_.as_dict()
    assert again == first


def test_an_interruption_keeps_what_is_finished():
    case = make_case("named", 21, effects=("cogging",), size=0.06, **SHORT)

    def stop(_):
        raise KeyboardInterrupt

    finder = GapFinder("servo", on_round=stop).fit(case.frame, **COLUMNS)
    assert finder.diagnosis_.interrupted
    assert [e.name for e in finder.effects_] == ["cogging"]


def test_a_search_interrupted_in_its_first_round_does_not_say_that_nothing_is_missing(monkeypatch):
    case = make_case("named", 21, effects=("cogging",), size=0.06, **SHORT)

    def stop(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr("whsklearn.gap.plants.servo_families.looks", stop)
    d = GapFinder("servo").fit(case.frame, **COLUMNS).diagnosis_
    assert d.verdict == "unknown"
    assert "interrupted" in d.sentence


@pytest.mark.parametrize(
    ("spoil", "code"),
    [
        (lambda f: f.iloc[:300], "data-too-short"),
        (lambda f: f.assign(position_rad=0.3), "data-not-moving"),
        (lambda f: f.assign(position_rad=1e-5 * np.random.default_rng(0).standard_normal(len(f))), "data-not-moving"),
        (lambda f: f.assign(torque_nm=1.0), "data-no-drive"),
        (lambda f: f.assign(position_rad=f.position_rad.clip(-1, 1)), "data-clipped-position"),
        (lambda f: f.assign(time_s=f.time_s * 1000), "data-time-unit"),
        (lambda f: f.drop(index=range(3000, 3400)), "data-uneven-time"),
        (lambda f: f.assign(time_s=f.time_s[::-1].to_numpy()), "data-time-order"),
        (lambda f: f.assign(torque_nm=f.torque_nm.where(f.index != 500, np.nan)), "data-not-finite"),
    ],
)
def test_bad_data_end_in_a_problem_and_never_in_a_name(spoil, code):
    case = make_case("none", 3, **SHORT)
    finder = GapFinder("servo").fit(spoil(case.frame), **COLUMNS)
    assert finder.verdict_ == "data_problem"
    assert finder.effects_ == []
    assert code in [p.code for p in finder.diagnosis_.problems]


def test_a_drive_at_its_limit_and_a_rest_at_the_extreme_are_no_reason_to_refuse():
    from whsklearn.gap.data_check import check_servo

    t = np.arange(7000) / 500
    position = np.round(1.0 - np.cos(np.minimum(t, 2 * np.pi)), 3)
    found = check_servo(ServoRecord(t, np.clip(np.sin(3 * t), -0.7, 0.7), position))
    assert [p.code for p in found if p.fatal] == []
    assert "data-drive-at-limit" in [p.code for p in found]
    step = check_servo(ServoRecord(t, np.where((t // 1.0) % 2 > 0, 1.0, -1.0), np.sin(t) + 1e-3 * t))
    assert [p.code for p in step if p.fatal] == []


@pytest.mark.parametrize("model", ["servo", "wiener-hammerstein"])
def test_a_frame_of_another_library_is_read_by_its_columns(model):
    t = np.arange(100) / 1000
    frame = ForeignFrame({"time_s": t, "torque_nm": t, "position_rad": t, "u": t, "y": t})
    finder = GapFinder(model).fit(frame)
    assert finder.verdict_ == "data_problem"
    np.testing.assert_array_equal(finder.plant_.record.time if model == "servo" else finder.plant_.u, t)


def test_missing_column_is_told():
    case = make_case("none", 3, **SHORT)
    with pytest.raises(ValueError, match="has no column 'torque'"):
        GapFinder("servo").fit(case.frame, **{**COLUMNS, "drive": "torque"})


def test_unknown_model_is_told():
    with pytest.raises(ValueError, match="expected 'servo'"):
        GapFinder("axis").fit(make_case("none", 3, **SHORT).frame, **COLUMNS)


def test_a_repair_that_runs_worse_loses_its_last_effect_only(monkeypatch):
    from whsklearn.gap import conclude

    prove, seen = conclude.prove, []

    def worse(plant, base, model, rng, given=None):
        rows = prove(plant, base, model, rng, given)
        seen.append(len(model.terms) - model.n_base)
        if seen[-1] > 0:
            for r in rows:
                r["closure"], r["after"] = -0.05, 1.05 * r["before"]
        return rows

    monkeypatch.setattr(conclude, "prove", worse)
    monkeypatch.setattr(ServoPlant, "contributes", lambda self, base, model: False)  # nor do the runs lack less torque
    case = make_case("named", 5, effects=("cogging",), size=0.15, seconds=10.0)
    finder = GapFinder("servo").fit(case.frame, **COLUMNS)
    taken_back = list(dict.fromkeys(seen[: seen.index(0) + 1]))  # once settled, once as found; then what is learned
    assert taken_back == list(range(len(taken_back)))[::-1]
    assert finder.verdict_ == "unknown"
    assert finder.effects_ == []
    assert finder.model_.effects == ()
    assert finder.diagnosis_.after == finder.diagnosis_.before
    assert len(finder.diagnosis_.horizons) == 3


@pytest.mark.slow
@pytest.mark.parametrize(("effect", "verdict"), [("friction_drift", "named"), (None, "no_gap")])
def test_a_log_with_holes_tells_what_the_whole_one_tells(effect, verdict):
    frame = make_servo_log([effect] if effect else [], duration=16.0, random_state=3)
    time = frame["time_s"].to_numpy()
    kept = np.flatnonzero(~((time >= 5.0) & (time < 5.5) | (time >= 10.0) & (time < 11.5)))
    signals = (frame[c].to_numpy()[kept] for c in ("time_s", "torque_nm", "position_rad"))
    starts = tuple(int(k) + 1 for k in np.flatnonzero(np.diff(kept) > 1))
    holed, whole = GapFinder("servo").fit(ServoRecord(*signals, starts=starts)), GapFinder("servo").fit(frame)
    assert holed.verdict_ == whole.verdict_ == verdict
    assert [e.name for e in holed.effects_] == ([effect] if effect else [])
    for a, b in zip(holed.effects_, whole.effects_, strict=True):
        assert a.parameters == pytest.approx(b.parameters, rel=0.02, abs=0.02)
        assert holed.diagnosis_.closure > 0.9


@pytest.mark.parametrize("seed", [0, 2])
def test_an_axis_that_comes_to_rest_slower_than_its_encoder_tells_lacks_nothing(seed):
    """Where it creeps and sticks, own records differ from the log: 4 % of the drive was missing, and had a name."""
    rng, path = np.random.default_rng(seed), [0.0]
    while len(path) < 10_000:
        to = rng.uniform(-0.8, 0.8)
        s = np.linspace(0.0, 1.0, int(500.0 * (abs(to - path[-1]) / rng.uniform(0.6, 4.0) + 0.1)))
        path += [*(path[-1] + (to - path[-1]) * s * s * (3.0 - 2.0 * s)), *[to] * int(500.0 * rng.uniform(0.1, 0.5))]
    axis = ServoAxis(
        inertia=0.32, law=[Viscous(0.8), Coulomb(2.1)], effects=[Quantization(2.0 * np.pi / 2**14)], sample_rate=500.0,
        controller=PIDController(kp=220.0, ki=120.0, kd=14.0), friction="stick",
    )  # fmt: skip
    r = axis.simulate(reference=np.array(path[:10_000]))
    log = pd.DataFrame({"t": r.time, "u": r.drive + rng.normal(0.0, 0.15, r.time.size), "q": r.position})
    found = GapFinder("servo").fit(log, time="t", drive="u", position="q").diagnosis_
    assert found.verdict in ("no_gap", "coloured_noise")
    assert found.figures[0] < 0.01
    truth = {"inertia": 0.32, "viscous": 0.8, "coulomb": 2.1}
    for row in found.base_parameters:
        if row["name"] in truth:
            assert abs(row["after"] - truth[row["name"]]) < 3.0 * row["after_error"], row
