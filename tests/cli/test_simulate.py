"""A model file run with the drive of a log."""

from __future__ import annotations

import dataclasses

import numpy as np
import pandas as pd
import pytest
from click.testing import CliRunner

from whsklearn.cli.simulate import main
from whsklearn.effects import Coulomb, FrictionLaw, GravityImbalance, Viscous, as_law
from whsklearn.logs import load_log
from whsklearn.models import AxisModel, LinearModel, load_model, save_model


@pytest.fixture
def files(tmp_path):
    """A model and a log that it made, but for a constant."""
    model = LinearModel([0.0, 0.5], [1.0, -0.8], dt=0.01, logged="position")
    u = np.random.default_rng(0).normal(size=300)
    save_model(model, tmp_path / "model.json")
    table = pd.DataFrame({"time_s": 0.01 * np.arange(300), "torque_nm": u, "position_rad": 2.0 + model.simulate(u)})
    table.to_csv(tmp_path / "log.csv", index=False)
    return tmp_path


def run(folder, *options):
    arguments = [folder / "model.json", folder / "log.csv", "--out", folder / "out.csv", *options]
    return CliRunner().invoke(main, [str(a) for a in arguments])


def table_of(folder):
    """The table that was written, without the units in the names of its columns."""
    return pd.read_csv(folder / "out.csv").rename(columns=lambda name: name.partition(" [")[0])


def test_it_writes_drive_output_and_measurement_and_judges_what_was_asked_for(files):
    done = run(files)
    assert done.exit_code == 0, done.output
    assert done.output.rstrip().endswith("out.csv: drive in Nm, simulated and measured in rad")
    table = table_of(files)
    assert list(table.columns) == ["time", "drive", "simulated", "measured"]
    again = load_log(files / "out.csv", position="simulated [rad]", drive="drive [Nm]", time="time [s]")
    assert again.units == {"time": "s", "drive": "Nm", "position": "rad"}
    np.testing.assert_allclose(table.simulated, table.measured, atol=1e-9)
    spoilt = pd.read_csv(files / "log.csv")
    spoilt.loc[40:49, "position_rad"] += 1.0
    spoilt.to_csv(files / "log.csv", index=False)
    assert float(run(files).output.split("RMSE ")[1].split()[0]) > 0.1
    assert float(run(files, "--skip", "60").output.split("RMSE ")[1].split()[0]) < 1e-6
    wrong = run(files, "--skip", "999")
    assert wrong.exit_code == 2
    assert "the longest segment has 300 samples" in wrong.output


def test_a_log_that_stands_still_is_simulated_and_has_no_nmse(files):
    log = pd.read_csv(files / "log.csv").assign(position_rad=0.3)
    log.to_csv(files / "log.csv", index=False)
    done = run(files)
    assert done.exit_code == 0, done.output
    assert "the measured output never changes, so it has no NMSE; RMSE " in done.output
    assert table_of(files).measured.eq(0.3).all()


def test_an_axis_with_gravity_starts_where_the_log_does(files):
    gravity = (GravityImbalance(1.5, phase=-1.0),)
    model = AxisModel(0.05, as_law("viscous").reweighted([0.3]), gravity, dt=0.01, logged="position")
    save_model(model, files / "model.json")
    log = pd.read_csv(files / "log.csv")
    log["position_rad"] = model.simulate(log.torque_nm, start=0.7)
    log.to_csv(files / "log.csv", index=False)
    assert float(run(files).output.split("RMSE ")[1].split()[0]) < 1e-6


def test_a_log_without_names_is_simulated_by_the_numbers_of_its_columns(files):
    text = (files / "log.csv").read_text()
    (files / "log.csv").write_text(text.partition("\n")[2])
    done = run(files, "--columns", "0,1,2")  # was refused for want of a name
    assert done.exit_code == 0, done.output
    assert "NMSE" in done.output


def test_a_log_at_another_rate_is_refused(files):
    log = pd.read_csv(files / "log.csv")
    log["time_s"] *= 2.0
    log.to_csv(files / "log.csv", index=False)
    done = run(files)
    assert done.exit_code == 3
    assert "a sample every 0.01 s, the log every 0.02 s" in done.output


@pytest.mark.parametrize("name", ["log.csv", "model.json", "sub/../log.csv"])
def test_a_file_that_is_read_is_not_written_over(files, name):
    (files / "sub").mkdir()
    before = (files / "log.csv").read_bytes(), (files / "model.json").read_bytes()
    done = run(files, "--out", files / name)
    assert done.exit_code == 2
    assert "which is read; give another name" in done.output
    assert ((files / "log.csv").read_bytes(), (files / "model.json").read_bytes()) == before


def test_a_log_in_a_unit_that_is_none_of_the_model_is_refused(files):
    model = load_model(files / "model.json")
    save_model(dataclasses.replace(model, units={"input": "Nm", "output": "rad"}), files / "model.json")
    done = run(files, "--unit", "drive=V")
    assert done.exit_code == 3
    assert "The input of the log is in V, that of the model in Nm" in done.output


def test_every_segment_is_simulated_from_its_own_start(files):
    model = AxisModel(0.05, as_law("viscous").reweighted([5.0]), dt=0.01, logged="position")
    save_model(model, files / "model.json")
    u = np.where(np.arange(300) % 50 < 20, 1.0, 0.0)  # at rest for 30 samples, five times the axis's memory
    position = model.simulate(u, start=0.7)
    log = pd.DataFrame({"time_s": 0.01 * np.arange(300), "torque_nm": u, "position_rad": position})
    log.drop(index=range(140, 150)).to_csv(files / "log.csv", index=False)
    done = run(files)
    assert done.exit_code == 0, done.output
    assert "each of its 2 segments is simulated from its own start" in done.output
    table = table_of(files)
    assert table.segment.value_counts().to_dict() == {0: 140, 1: 150}
    np.testing.assert_allclose(table.simulated, table.measured, atol=1e-3)


def test_worse_than_the_mean_is_told(files):
    log = pd.read_csv(files / "log.csv")
    log["torque_nm"] *= -3.0
    log.to_csv(files / "log.csv", index=False)
    assert "Worse than the mean of the output (an NMSE above 1): model.json" in run(files).output


@pytest.mark.parametrize("axis", [True, False])
def test_a_long_free_run_of_an_axis_may_only_have_drifted(files, axis):
    log = pd.read_csv(files / "log.csv")
    if axis:
        model = AxisModel(0.05, as_law("viscous").reweighted([0.3]), (), dt=0.01, logged="position")
        save_model(model, files / "model.json")
    log["torque_nm"] += 3.0
    log.to_csv(files / "log.csv", index=False)
    told = " ".join(run(files).output.split())
    assert "It does not describe this record" in told
    assert ("Or its error only grew: without its loop an axis drifts" in told) is axis


def test_a_velocity_is_integrated_for_a_model_of_the_position(files):
    model = LinearModel([0.0, 0.5], [1.0, -0.8], dt=0.01, logged="position", units={"input": "Nm", "output": "turns"})
    save_model(model, files / "model.json")
    t = 0.01 * np.arange(300)
    u = np.sin(5 * t)
    rpm = 60 * np.gradient(model.simulate(u), t)
    pd.DataFrame({"time_s": t, "torque_Nm": u, "speed_rpm": rpm}).to_csv(files / "log.csv", index=False)
    for asked in ([], ["--output", "speed_rpm"], ["--output", "speed_rpm", "--unit", "position=rpm"]):
        done = run(files, *asked)
        assert done.exit_code == 0, done.output
        assert done.output.rstrip().endswith("simulated and measured in turns")
        assert np.abs(np.subtract(*table_of(files)[["simulated", "measured"]].to_numpy().T)).max() < 0.02


@pytest.mark.parametrize("column", ["position_rad", "velocity_rad_s"])
def test_an_axis_starts_at_the_speed_of_the_log(tmp_path, column):
    logged, unit = ("position", "rad") if column == "position_rad" else ("velocity", "rad/s")
    model = AxisModel(0.1, as_law("viscous"), dt=0.01, logged=logged, units={"input": "Nm", "output": unit})
    save_model(model, tmp_path / "model.json")
    u = np.sin(0.05 * np.arange(300))
    y = model.simulate(u, start=1.0, speed=4.0)
    pd.DataFrame({"time_s": 0.01 * np.arange(300), "torque_nm": u, column: y}).to_csv(tmp_path / "log.csv", index=False)
    assert run(tmp_path).exit_code == 0
    assert np.abs(np.subtract(*table_of(tmp_path)[["simulated", "measured"]].to_numpy().T)).max() < 0.01


def test_an_axis_at_rest_under_a_step_starts_at_rest(tmp_path):
    """Its acceleration is no speed; one of 0.3 rad/s would leave the position 0.07 rad off for good."""
    units = {"input": "Nm", "output": "rad"}
    law = FrictionLaw([Viscous(0.05), Coulomb(0.2)])
    model = AxisModel(0.012, law, dt=0.001, logged="position", units=units)
    u = np.where(np.arange(3000) < 1500, 2.5, -2.5)
    y = model.simulate(u, start=0.0) + 1e-5 * np.random.default_rng(0).normal(size=u.size)
    save_model(model, tmp_path / "model.json")
    table = pd.DataFrame({"time_s": 0.001 * np.arange(3000), "torque_nm": u, "position_rad": y})
    table.to_csv(tmp_path / "log.csv", index=False)
    assert run(tmp_path).exit_code == 0
    assert np.abs(np.subtract(*table_of(tmp_path)[["simulated", "measured"]].to_numpy().T)).max() < 1e-3
