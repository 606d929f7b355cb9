"""The whole line on hidden effects and where nothing is missing; records that cannot be used; the page."""

from __future__ import annotations

import dataclasses
import json

import numpy as np
import pytest

from benchmarks._twins import make_coupled_drives
from benchmarks.blind_logs import wiener_hammerstein as blind
from tests.gap.plants.example_chain import PARTS, PLAIN, TRUE, record, term
from whsklearn import WienerHammersteinSystem
from whsklearn.effects import QuadraticDrag
from whsklearn.gap import GapFinder
from whsklearn.gap.calibration import GATE
from whsklearn.gap.data_check import FEWEST_SAMPLES
from whsklearn.gap.plants import Base, make_plant
from whsklearn.gap.plants import chain as readings
from whsklearn.gap.plants import chain_model as cm
from whsklearn.gap.plants.chain import ChainPlant
from whsklearn.gap.plants.chain_fit import coloured
from whsklearn.gap.plants.chain_model import SKIP, Record, chain_free_run, clipped, left, simulate


def diagnose(case, **options):
    return GapFinder("wiener-hammerstein", **options).fit(case.frame, **blind.COLUMNS)


def noise_of(case):
    """What noise alone adds to the output, by the generator's own equations."""
    s = {k: np.array(v) for k, v in case.system.items()}
    rows = np.array([[p.get("size", 0.0), p.get("shape", 0.0), p.get("phase", 0.0), 0.0] for p in case.parameters])
    kinds = np.array([blind.NUMBER[e] for e in case.truth])
    u, y = (case.frame[k].to_numpy() for k in ("u", "y"))
    dt = float(case.frame["time_s"].iloc[1])
    blocks = (s["a"], s["b"], s["c"], s["d"], s["law"])
    return y - blind.run(*blocks, kinds, rows, u, np.zeros(u.size), dt, np.zeros(1))


@pytest.fixture(scope="module")
def drag():
    return diagnose(blind.make_case("named", 11, effects=("quadratic_drag",), size=0.15, noise=30.0, n=1500))


@pytest.mark.slow
def test_a_hidden_drag_is_named_with_its_size(drag):
    assert drag.verdict_ == "named"
    assert [e.name for e in drag.effects_] == ["quadratic_drag"]
    case = blind.make_case("named", 11, effects=("quadratic_drag",), size=0.15, noise=30.0, n=1500)
    found = drag.effects_[0]
    assert found.effect.coefficient == pytest.approx(case.parameters[0]["size"], rel=0.15)
    assert found.errors["coefficient"] > 0.0


def test_the_repaired_model_simulates_better(drag):
    case = blind.make_case("named", 11, effects=("quadratic_drag",), size=0.15, noise=30.0, n=1500)
    d = drag.diagnosis_
    assert d.after["rmse"] < d.before["rmse"]
    noise = noise_of(case)[d.pictures["held"]]
    floor = float(np.sqrt(np.mean(noise**2)))
    assert d.floor == pytest.approx(floor, rel=0.1)
    assert 1.0 - (d.after["rmse"] - floor) / (d.before["rmse"] - floor) > 0.8
    y_hat = drag.model_.simulate(case.frame["u"])
    assert 1.4826 * np.median(np.abs(case.frame["y"] - y_hat)) < 1.2 * d.after["rmse"]


def test_the_file_holds_what_other_programs_read(drag):
    out = json.loads(json.dumps(drag.diagnosis_.as_dict(), allow_nan=False))
    assert set(out) == {"verdict", "effects", "candidates", "where", "before", "after", "noise_floor_rmse", "closure",
                        "next_experiment", "seconds", "file", "units", "version", "test", "missing", "base", "horizon",
                        "learned", "alpha"}  # fmt: skip
    assert {c["status"] for c in out["candidates"]} <= {"named", "ruled_out", "alias", "not_testable"}
    assert {c["name"] for c in out["candidates"]} >= {"dead_zone", "cogging", "backlash", "output_offset"}


@pytest.mark.slow
def test_rounding_is_told_beside_another_effect():
    case = blind.make_case("pair", 21, effects=("hardening_spring", "quantization"), size=0.05, noise=35.0, n=1500)
    finder = diagnose(case)
    assert {e.name for e in finder.effects_} == {"hardening_spring", "quantization"}
    told = next(e for e in finder.effects_ if e.name == "quantization")
    assert told.effect.step == pytest.approx(case.parameters[1]["size"], rel=1e-6)
    y = finder.model_.simulate(case.frame["u"])  # the repaired model rounds too
    np.testing.assert_allclose(y, told.effect.step * np.round(y / told.effect.step))


@pytest.mark.slow
def test_a_strong_saturation_does_not_leave_the_blocks_bent():
    # clipped that hard, the model without it ends with zeros in the wrong blocks
    case = blind.make_case("named", 16006, effects=("saturation",), n=1000)
    finder = diagnose(case)
    assert finder.verdict_ == "named"
    assert [e.name for e in finder.effects_] == ["saturation"]
    assert finder.diagnosis_.after["rmse"] < 1.1 * np.std(noise_of(case))  # the noise of the record, by its generator


@pytest.mark.slow
def test_a_delay_within_a_sample_is_not_told_from_a_lag():
    """Of a delay of a tenth of a sample, only the lag was fitted, and named with certainty."""
    case = blind.make_case("named", 1108649, effects=("input_delay",), n=1500)
    plant = make_plant("wiener-hammerstein", case.frame, None, Base(), tolerance=0.004, columns=blind.COLUMNS)
    looks = plant.looks(plant.base(rng := np.random.default_rng(0)), rng)
    lag, delay = (next(k for k in looks if k.name == name) for name in ("actuator_lag", "input_delay"))
    assert abs(lag.gain - delay.gain) < 9.0 < 0.01 * lag.gain
    assert plant.refine(None, delay).terms[-1].effect.delay == pytest.approx(case.parameters[0]["size"], rel=0.05)


@pytest.mark.slow
def test_a_delay_of_hundredths_of_a_sample_is_that_or_a_lag():
    """A ripple was named for a delay of 0.014 samples; a lag of 0.3 dt, behind a hold, is a delay of 0.04."""
    finder = diagnose(blind.make_case("named", 1156649, effects=("input_delay",), n=1500))
    ((told,),) = [finder.effects_]
    assert told.name in ("input_delay", "actuator_lag")
    assert {told.name, *told.aliases} >= {"input_delay", "actuator_lag"}


@pytest.mark.slow
def test_a_model_is_all_there_is_with_the_effect_and_not_without():
    case = blind.make_case("named", 1149679, effects=("friction_drift",), n=1500)
    plant = make_plant("wiener-hammerstein", case.frame, None, Base(), tolerance=0.004, columns=blind.COLUMNS)
    base = plant.base(rng := np.random.default_rng(0))
    best = next(k for k in plant.looks(base, rng) if k.name == "friction_drift")
    without, with_it = (plant.p_of_all(plant.settled(m), rng) for m in (base, plant.refine(base, best)))
    assert without < 0.01 < with_it


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["prbs", "uniform"])
def test_the_coupled_drives_lack_a_sensor_that_knows_the_sign(kind):
    finder = GapFinder("wiener-hammerstein", law="linear").fit(*make_coupled_drives(kind=kind, random_state=1))
    assert (finder.verdict_, [e.name for e in finder.effects_]) == ("named", ["sensor_rectification"])
    assert finder.diagnosis_.closure > 0.9


def test_of_two_names_that_no_record_can_tell_apart_the_simpler_is_first():
    case = blind.make_case("named", 16025, effects=("gravity_imbalance",), n=1000)  # a cogging of order one
    finder = diagnose(case)
    assert finder.verdict_ == "named"
    assert finder.effects_[0].name == "gravity_imbalance"
    assert "cogging" in finder.effects_[0].aliases


@pytest.mark.parametrize("kind", ["none", "coloured"])
def test_silence_where_nothing_is_missing(kind):
    finder = diagnose(blind.make_case(kind, 4, noise=25.0, n=1000))
    assert finder.verdict_ in ("no_gap", "coloured_noise")
    assert finder.effects_ == []


@pytest.mark.parametrize(
    ("u", "y", "code"),
    [
        (np.ones(1000), np.random.default_rng(0).normal(size=1000), "data-no-drive"),
        (np.random.default_rng(0).normal(size=1000), np.zeros(1000), "data-not-moving"),
        (np.random.default_rng(0).normal(size=100), np.random.default_rng(1).normal(size=100), "data-too-short"),
        (np.r_[np.nan, np.random.default_rng(0).normal(size=999)], np.arange(1000.0), "data-not-finite"),
    ],
)
def test_bad_records_end_in_a_data_problem(u, y, code):
    finder = GapFinder("wiener-hammerstein").fit(u, y)
    assert finder.verdict_ == "data_problem"
    assert code in [p.code for p in finder.diagnosis_.problems]


def test_of_a_long_record_a_part_is_searched_and_all_of_it_fitted(drag, monkeypatch):
    from whsklearn.gap.plants import chain

    monkeypatch.setattr(chain, "SEARCHED", 1000)
    case = blind.make_case("named", 11, effects=("quadratic_drag",), size=0.15, noise=30.0, n=1500)
    long = diagnose(case, max_effects=1)  # that nothing more is found is the fixture's affair
    assert [e.name for e in long.effects_] == ["quadratic_drag"]
    one, other = long.effects_[0], drag.effects_[0]
    errors = [e.errors["coefficient"] for e in (one, other)]
    assert one.parameters["coefficient"] == pytest.approx(other.parameters["coefficient"], abs=errors[1])
    # an error falls with the root of the samples; the two searches may end in neighbouring minima of L1, whose
    # numbers differ by more than rounding, so that of all samples must be nearer than that of two thirds of them
    assert abs(np.log(errors[0] / errors[1])) < abs(np.log(errors[0] / (1.5**0.5 * errors[1])))


RNG = np.random.default_rng(0)
U, Y = RNG.normal(size=(2, 2000))


def codes(u, y):
    return [p.code for p in readings.check_chain(np.asarray(u), np.asarray(y))]


def with_spikes(y):
    out = y.copy()
    out[[5, 700]] = 1e4
    return out


@pytest.mark.parametrize(
    ("u", "y", "code"),
    [
        (U, np.where(np.arange(2000) == 7, np.nan, Y), "data-not-finite"),
        (U[: FEWEST_SAMPLES - 1], Y[: FEWEST_SAMPLES - 1], "data-too-short"),
        (np.ones(2000), Y, "data-no-drive"),
        (np.repeat(U[:20], 100), Y, "data-no-drive"),
        (U, np.zeros(2000), "data-not-moving"),
        (U, np.clip(np.cumsum(0.1 * U), -1.0, 1.0), "data-clipped-position"),
        (U, with_spikes(Y), "data-spikes"),
    ],
)
def test_what_cannot_be_used_is_told_and_is_fatal(u, y, code):
    problems = readings.check_chain(u, y)
    assert [p.code for p in problems] == [code]
    assert all(p.fatal for p in problems)


def test_sound_and_coarse_readings_pass():
    assert codes(U, Y) == []
    assert codes(U, np.sign(Y)) == []  # few levels: each is an extreme by rounding
    assert codes(U[:FEWEST_SAMPLES], Y[:FEWEST_SAMPLES]) == []


def test_what_the_blocks_absorb_is_fitted_where_nothing_is_seen():
    """A dead zone of 2 % of the input moves the blocks, beside which no look shows anything."""
    case = blind.make_case("named", 1304455, effects=("dead_zone",), n=1500)
    u, y = (case.frame[k].to_numpy() for k in ("u", "y"))
    plant, rng = ChainPlant(u, y, (None, (2, 2, 2, 2), 0), tolerance=0.004), np.random.default_rng(0)
    base = plant.base(rng)
    assert plant.seen(base, rng).p_value > GATE
    first = next(k for k in plant.looks(base, rng) if k.name)
    assert first.name == "dead_zone"
    assert first.p_value < 0.01
    assert plant.refine(base, first).terms[-1].q[0] == pytest.approx(case.parameters[0]["size"], rel=0.2)


def test_a_grid_is_told_where_it_is_coarse_and_not_where_noise_is_larger():
    coarse, fine = (
        Record.of(PLAIN.u, step * np.round(PLAIN.y / step), PLAIN.dt, PLAIN.dims, PLAIN.law) for step in (0.1, 0.001)
    )
    assert readings.coarse_grid(coarse, coloured(coarse, TRUE), 0.004) == pytest.approx(0.1)
    assert readings.coarse_grid(fine, coloured(fine, TRUE), 0.004) == 0.0
    assert readings.coarse_grid(PLAIN, coloured(PLAIN, TRUE), 0.004) == 0.0


def test_signals_are_one_sample_late_as_l2_is():
    shown = readings.signals_of(PLAIN, TRUE, ("A", "mm"))
    x = simulate(PLAIN, TRUE)[0]
    np.testing.assert_array_equal(shown["x"][0][1:], x[:-1])
    np.testing.assert_array_equal(shown["input"][0][1:], PLAIN.u[:-1])
    np.testing.assert_array_equal(shown["output"][0], chain_free_run(PLAIN, TRUE))
    assert [shown[k][1] for k in ("time", "input", "output")] == ["samples", "A", "mm"]  # the example has no clock


def test_gaps_and_their_spectra_are_those_of_the_two_models():
    """Half the squared amplitudes sum to the variance, up to the window's own 1.5 bins."""
    s = record(QuadraticDrag(0.05))
    base, model = coloured(s, TRUE), coloured(s, TRUE.with_term(term("quadratic_drag", 0.05)))
    plant = readings.ChainPlant(s.u, s.y, (None, (2, 2, 2, 2), 0), tolerance=0.004)
    plant.record = plant.everything = s
    plant.unit = 2.0
    told = plant.told(base, model)
    shown = told.pictures
    np.testing.assert_array_equal(shown["gap_after"], cm.loudness(model.ar) * clipped(left(s, model)))
    assert shown["usable"].sum() == s.u.size - SKIP
    for spectrum, gap in zip(shown["spectrum"], (shown["gap_before"], shown["gap_after"]), strict=True):
        assert np.sum(0.5 * spectrum**2) / 1.5 == pytest.approx(np.var(gap[SKIP:]), rel=0.1)
    before, after = plant.told(TRUE, model).tests
    assert before["p_value"] < 1e-4 < after["p_value"]


def test_the_floor_is_the_noise_of_the_output_whatever_colour_the_gap_had():
    noise = 0.02 * np.random.default_rng(3).normal(size=PLAIN.u.size)
    y = WienerHammersteinSystem(**PARTS).simulate(PLAIN.u) + noise
    plant = ChainPlant(PLAIN.u, y, (None, (2, 2, 2, 2), 0), tolerance=0.004)
    model = plant.base(np.random.default_rng(0))
    coloured = dataclasses.replace(model, ar=np.array([-0.95, 0.0, 0.0, 0.0, 0.0, 0.0]))
    plant.unit = cm.loudness(coloured.ar)  # that of a base model with a slow gap
    floor = plant.shown_by(model) * plant.figures(coloured, model).floor
    assert floor == pytest.approx(np.std(noise), rel=0.1)
