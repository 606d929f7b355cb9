"""The command that asks which structure a log has."""

from __future__ import annotations

import json
import shutil

import numpy as np
import pandas as pd
import pytest
from click.testing import CliRunner
from scipy.ndimage import gaussian_filter1d
from scipy.signal import lfilter

from whsklearn.cli import records
from whsklearn.cli.identify import main
from whsklearn.datasets import make_servo_log
from whsklearn.models import load_model


def linear_log(seed, n=160, step=0.01):
    """A linear plant under a smooth input: its noise shows in differences, and at that floor no chain is tried."""
    rng = np.random.default_rng(seed)
    u = 2.0 * gaussian_filter1d(rng.normal(size=n), 5.0)
    y = lfilter([0.0, 0.5, 0.2], [1.0, -1.2, 0.5], u) + 0.01 * rng.normal(size=n)
    return pd.DataFrame({"time_s": step * np.arange(n), "u": u, "y": y})


@pytest.fixture(scope="module")
def recorded(migrated_database, tmp_path_factory):
    """A linear log identified with tracking on: its input and output, what was printed, and the folder of both."""
    folder = tmp_path_factory.mktemp("identify")
    (folder / "mlruns").mkdir()
    store = f"sqlite:///{shutil.copy(migrated_database, folder / 'mlruns' / 'mlflow.db')}"
    log = linear_log(0)[["u", "y"]]
    log.to_csv(folder / "log.csv", index=False)
    arguments = [folder / "log.csv", "--input", "u", "--output", "y", "--out", folder / "out"]
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("MLFLOW_TRACKING_URI", store)
        done = CliRunner().invoke(main, [str(a) for a in arguments])
    assert done.exit_code == 0, done.output
    return log.u.to_numpy(), log.y.to_numpy(), done.output, folder, store


def test_a_linear_log_gives_a_linear_model_its_numbers_and_a_page(recorded):
    u, y, said, folder, _ = recorded
    found = json.loads((folder / "out" / "identify.json").read_text())
    assert found["recommended"] in ("arx", "output_error")
    assert {m["kind"] for m in found["models"]} >= {"arx", "output_error"}
    numbers = {p["name"]: (p["value"], p["standard_error"]) for p in found["parameters"]}
    for name, truth in (("b1", 0.5), ("f1", -1.2)):
        assert abs(numbers[name][0] - truth) < 4 * numbers[name][1] < 0.1
    model = load_model(folder / "out" / "model.json")
    assert np.std(model.simulate(u) - y) < 0.02
    assert "b1" in said
    head = next(line for line in said.splitlines() if line.startswith("structure"))
    assert head.count(" samples ") > 1  # the log has no time, so its windows have no seconds
    assert " s " not in head.replace("CPU s", "")


def test_a_child_run_a_structure_and_the_model_itself_are_recorded(recorded, monkeypatch):
    import mlflow

    u, _, said, folder, store = recorded
    monkeypatch.setenv("MLFLOW_TRACKING_URI", store)
    assert "experiment identify: sqlite:///" in said
    client = mlflow.MlflowClient(store)
    runs = client.search_runs([client.get_experiment_by_name("identify").experiment_id])
    (parent,) = [r for r in runs if "mlflow.parentRunId" not in r.data.tags]
    found = json.loads((folder / "out" / "identify.json").read_text())
    children = {r.info.run_name: r for r in runs if r is not parent}
    assert set(children) == {m["name"] for m in found["models"]}
    for m in found["models"]:
        metrics = children[m["name"]].data.metrics
        assert metrics.get("nmse") == pytest.approx(m["test"]["nmse"])  # what was skipped has none
    assert children[found["recommended_name"]].data.metrics["nmse"] == parent.data.metrics["nmse"]
    kept = {a.path for a in client.list_artifacts(parent.info.run_id)}
    assert kept >= {"identify.html", "identify.json", "model.json"}
    (model,) = client.search_logged_models([parent.info.experiment_id])
    served = mlflow.pyfunc.load_model(model.model_uri)
    np.testing.assert_allclose(served.predict(u[:, None]), load_model(folder / "out" / "model.json").simulate(u))


def test_a_log_with_a_hole_is_used_on_both_sides_of_it(tmp_path):
    linear_log(0, 240).drop(index=range(90, 105)).to_csv(tmp_path / "log.csv", index=False)
    arguments = [tmp_path / "log.csv", "--time", "time_s", "--input", "u", "--output", "y", "--no-track"]
    arguments += ["--out", tmp_path / "out", "--logged", "output"]
    done = CliRunner().invoke(main, [str(a) for a in arguments])
    assert done.exit_code == 0, done.output
    found = json.loads((tmp_path / "out" / "identify.json").read_text())
    assert found["rows"] == {"used": 225, "given": 225, "segments": 2}
    page = (tmp_path / "out" / "identify.html").read_text()
    assert page.index("225 of 225 in 2 segments") < page.index("<table>")


def test_of_a_very_long_log_the_part_with_the_most_travel_is_fitted(tmp_path, monkeypatch):
    monkeypatch.setattr(records, "MOST_ROWS", 200)  # the fits take a millisecond a sample
    still = pd.DataFrame({"u": np.zeros(250), "y": 0.01 * np.random.default_rng(1).normal(size=250)})
    log = pd.concat([still, linear_log(0, 250)[["u", "y"]]], ignore_index=True)
    log.drop(index=range(240, 245)).to_csv(tmp_path / "log.csv", index=False)
    arguments = [tmp_path / "log.csv", "--rate", "10", "--no-track", "--out", tmp_path / "out"]
    done = CliRunner().invoke(main, [str(a) for a in arguments])
    assert done.exit_code == 0, done.output
    assert "200 of 495 samples are used" in done.stderr
    assert json.loads((tmp_path / "out" / "identify.json").read_text())["rows"]["used"] == 200


def test_all_segments_of_a_test_log_are_judged(tmp_path):
    # behind its hole the plant of the test log has twice the gain: who judges the longest segment alone sees nothing
    linear_log(0, 240).to_csv(tmp_path / "log.csv", index=False)
    second = linear_log(1, 300).drop(index=range(170, 190))
    arguments = [tmp_path / "log.csv", "--time", "time_s", "--input", "u", "--output", "y", "--no-track"]
    arguments += ["--test", tmp_path / "test.csv", "--out", tmp_path / "out", "--logged", "output"]
    errors = []
    for gain in (1.0, 2.0):
        y = np.where(second.index >= 190, gain * second.y, second.y)
        second.assign(y=y).to_csv(tmp_path / "test.csv", index=False)
        done = CliRunner().invoke(main, [str(a) for a in arguments])
        assert done.exit_code == 0, done.output
        found = json.loads((tmp_path / "out" / "identify.json").read_text())
        (chosen,) = [m for m in found["models"] if m["name"] == found["recommended_name"]]
        errors.append(chosen["test"]["rmse"])
    assert errors[0] < 0.015  # the noise: no run goes on across the hole
    assert errors[1] > 0.1


def test_several_logs_make_one_identification(tmp_path):
    errors = []
    for count in (1, 4):
        files = [tmp_path / f"log{k}.csv" for k in range(count)]
        for k, file in enumerate(files):
            linear_log(k).to_csv(file, index=False)
        arguments = [*files, "--time", "time_s", "--input", "u", "--output", "y", "--no-track", "--out", tmp_path]
        arguments += ["--logged", "output"]  # linear structures alone: how logs are joined is the same for all
        done = CliRunner().invoke(main, [str(a) for a in arguments])
        assert done.exit_code == 0, done.output
        found = json.loads((tmp_path / "identify.json").read_text())
        assert found["rows"] == {"used": 160 * count, "given": 160 * count, "segments": count}
        (b1,) = [p for p in found["parameters"] if p["name"] == "b1"]
        assert abs(b1["value"] - 0.5) < 4 * b1["standard_error"]
        errors.append(b1["standard_error"])
    assert errors[1] < 0.65 * errors[0]  # numbers are shared: four times the samples, half of the error


@pytest.mark.parametrize(("second", "told"), [
    (linear_log(0), "would count twice"), (linear_log(1, step=0.02), "resample them to one rate"),
])  # fmt: skip
def test_logs_that_make_no_one_identification_are_refused(tmp_path, second, told):
    linear_log(0).to_csv(tmp_path / "a.csv", index=False)
    second.to_csv(tmp_path / "b.csv", index=False)
    arguments = [tmp_path / "a.csv", tmp_path / "b.csv", "--time", "time_s", "--input", "u", "--output", "y"]
    done = CliRunner().invoke(main, [str(a) for a in [*arguments, "--no-track", "--out", tmp_path / "out"]])
    assert done.exit_code == 3
    assert told in " ".join(done.output.split())


def test_a_clipped_drive_is_told_where_something_is_missing(tmp_path):
    u = np.random.default_rng(0).normal(size=(14, 1)).repeat(20, axis=1).ravel() + 0.3 * np.sin(np.arange(280.0))
    y = lfilter([0.0, 0.05], [1.0, -0.95], u) + 1e-3 * np.random.default_rng(1).normal(size=280)
    for name, logged in (("clipped", np.clip(u, -0.8, 0.8)), ("whole", u)):
        pd.DataFrame({"u": logged, "y": y}).to_csv(tmp_path / "log.csv", index=False)
        arguments = [tmp_path / "log.csv", "--rate", "100", "--no-track", "--out", tmp_path / "out"]
        arguments += ["--logged", "output"]
        done = CliRunner().invoke(main, [str(a) for a in arguments])
        assert done.exit_code == 0, done.output
        assert ("log.csv: drive stays at its extreme values" in " ".join(done.output.split())) == (name == "clipped")


def test_degrees_called_radians_are_asked_about_as_gap_does(tmp_path):
    log = make_servo_log(duration=3.0, sample_rate=100.0, random_state=0)
    log["position_rad"] *= 180.0 / np.pi
    log.to_csv(tmp_path / "log.csv", index=False)
    said = CliRunner().invoke(
        main,
        [str(tmp_path / "log.csv"), "--input", "torque_nm", "--output", "position_rad", "--out", str(tmp_path / "o"),
         "--no-track"],
    )  # fmt: skip
    assert said.exit_code == 0, said.output
    assert "are those degrees? If so, add --unit position=deg." in " ".join(said.stderr.split())
