"""Searches: candidates recorded as they finish, on this machine's processes and on a Dask cluster."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from click.testing import CliRunner

from whsklearn import RMILSRegressor, ServoAxis, WienerHammersteinLags
from whsklearn.cli.tune import main
from whsklearn.datasets import make_wiener_hammerstein


def run(*arguments):
    return CliRunner().invoke(main, [str(a) for a in arguments])


def test_every_candidate_is_a_run_and_the_best_a_champion(mlflow_root):
    import mlflow

    done = run("--samples", 200, "--p", "1,2", "--folds", 2, "--jobs", 1)
    assert done.exit_code == 0, done.output
    assert (
        max(len(line) for line in done.stdout.splitlines() if "mlruns" not in line) <= 100
    )  # a path is as long as it is
    client = mlflow.MlflowClient()
    found = client.search_runs([e.experiment_id for e in client.search_experiments()])
    children = [r for r in found if "mlflow.parentRunId" in r.data.tags]
    (parent,) = (r for r in found if "mlflow.parentRunId" not in r.data.tags)
    assert {r.data.params["p"] for r in children} == {"1", "2"}
    assert all(len(client.get_metric_history(r.info.run_id, "fold/nmse")) == 2 for r in children)
    assert parent.data.metrics["nmse"] == pytest.approx(min(r.data.metrics["nmse"] for r in children))
    model = mlflow.sklearn.load_model("models:/tuned@champion-example-5-1")
    assert model.p == int(parent.data.tags["best_p"])


@pytest.mark.parametrize(
    ("option", "value", "says"),
    [("--law", "viskous", "Unknown effect 'viskous'; expected one of"), ("--p", "4,0", "p is 0, expected a whole"),
     ("--forgetting", "1.5", "forgetting is 1.5, expected a number above 0 and at most 1"), ("--P0", "-1", "P0 is -1")],
)  # fmt: skip
def test_a_value_that_no_fit_takes_is_one_sentence(option, value, says):
    done = run("--samples", 200, "--folds", 2, "--jobs", 1, "--no-track", option, value)
    assert done.exit_code != 0
    assert says in done.output
    assert "Traceback" not in done.output


def written(path, u, y, rate=100.0):
    table = np.column_stack([np.arange(len(u)) / rate, u, y])
    np.savetxt(path, table, delimiter=",", header="time_s,torque_nm,position_rad", comments="")
    return path


@pytest.fixture
def axis_log(tmp_path):
    """Position of an axis; the drive moves it to and fro and leaves it where friction does."""
    t = np.arange(800) / 100.0
    u = 1.2 * np.sin(np.pi * t) + 0.6 * np.sin(3.4 * np.pi * t + 1.0) + 0.5 * np.sin(6.2 * np.pi * t + 2.0)
    return written(tmp_path / "axis.csv", u, ServoAxis(sample_rate=100.0).simulate_drive(u).position)


COLUMNS = ("--input", "torque_nm", "--output", "position_rad", "--time", "time_s", "--folds", 2, "--jobs", 1)


def held():
    """Version of the model by alias."""
    import mlflow

    found = mlflow.MlflowClient().search_registered_models()
    return {alias: int(version) for model in found for alias, version in model.aliases.items()}


def test_a_position_is_tuned_by_its_velocity_and_each_log_has_its_champion(mlflow_root, axis_log):
    import mlflow

    done = run("--log", axis_log, *COLUMNS, "--p", 1, "--P0", "default,1")
    assert done.exit_code == 0, done.output
    assert "its velocity is fitted" in done.stderr
    assert held() == {"champion-axis": 1}
    model = mlflow.sklearn.load_model("models:/tuned@champion-axis")
    u, position = np.loadtxt(axis_log, delimiter=",", skiprows=1)[:, 1:].T
    velocity = np.gradient(position, 0.01)
    frame = pd.DataFrame({"torque_nm": u})
    assert np.var(velocity - model.predict(frame)) < 0.1 * np.var(velocity)  # at 1.2 today it knew nothing
    with pytest.raises(ValueError, match="torque_mnm"):
        model.predict(frame.set_axis(["torque_mnm"], axis=1))
    assert run("--samples", 200, "--folds", 2, "--jobs", 1, "--p", 1).exit_code == 0
    assert held() == {"champion-axis": 1, "champion-example-5-1": 2}


def test_a_champion_gives_way_to_nothing_worse(mlflow_root):
    options = ("--samples", 300, "--folds", 2, "--jobs", 1, "--p", 1)
    assert run(*options).exit_code == 0
    done = run(*options, "--orders", "1,2,2,2")
    assert done.exit_code == 0, done.output
    assert "present champion's settings" in " ".join(done.stdout.split())
    assert held() == {"champion-example-5-1": 1}
    assert run(*options, "--orders", "1,2,2,2", "--register", "small").exit_code == 0
    assert run(*options).exit_code == 0  # as good as the champion: it is fitted anew
    assert held() == {"champion-example-5-1": 2}


def test_nothing_is_registered_that_is_worse_than_the_mean(mlflow_root, tmp_path):
    u, y = np.random.default_rng(0).standard_normal((2, 160))
    done = run("--log", written(tmp_path / "noise.csv", u, y), *COLUMNS, "--p", 1, "--law", "viscous,coulomb,offset")
    assert done.exit_code == 0, done.output
    assert "Nothing is registered" in done.stdout
    assert held() == {}


def test_the_estimators_own_setting_is_one_of_those_tried():
    done = run("--samples", 200, "--folds", 2, "--jobs", 1, "--no-track", "--p", 1, "--P0", "default,1,1e6")
    assert done.exit_code == 0, done.output
    assert "The best 3" in done.stdout
    assert "default" in done.stdout


@pytest.mark.parametrize("kind", ["halving", "random"])
def test_other_searches_score_all_that_they_try(kind):
    done = run(
        "--samples", 320, "--folds", 2, "--p", "1,2", "--jobs", 1, "--no-track", "--search", kind, "--candidates", 2
    )
    assert done.exit_code == 0, done.output  # a failed score is a warning, and a warning an error
    assert "nan" not in done.stdout


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::ResourceWarning")  # distributed leaves sockets to the collector
def test_dask_cluster_searches_the_same():
    pytest.importorskip("distributed", reason="needs the extra dask")
    done = run("--samples", 200, "--p", "1,2", "--folds", 2, "--backend", "dask", "--no-track")
    assert done.exit_code == 0, done.output
    assert "2 workers" in done.stderr
    assert "The best 2" in done.stdout


def test_scheduler_that_is_down_is_told(monkeypatch):
    pytest.importorskip("distributed", reason="needs the extra dask")
    monkeypatch.setattr("whsklearn.cli.job.ANSWERS", 1.0)
    done = run("--samples", 200, "--backend", "dask", "--scheduler", "tcp://127.0.0.1:9", "--no-track")
    assert done.exit_code == 1
    assert "does not answer" in done.output


@pytest.mark.parametrize(("option", "value"), [("--p", "1,x"), ("--forgetting", "")])
def test_unreadable_grid_is_told(option, value):
    done = run("--no-track", option, value)
    assert done.exit_code == 1
    assert f"{option} is" in done.output


@pytest.mark.parametrize("kind", ["grid", "halving"])
def test_every_segment_counts_and_none_follows_on_another(tmp_path, kind, mlflow_root):
    import mlflow

    X, y = make_wiener_hammerstein(1500, snr_db=30, random_state=0)
    X[700:] *= 1.3
    kept = np.r_[0:700, 730:1500]
    table = np.column_stack([np.arange(1500) / 100.0, X[:, 0], y])[kept]
    np.savetxt(tmp_path / "holes.csv", table, delimiter=",", header="time_s,u,y", comments="")
    done = run("--log", tmp_path / "holes.csv", "--input", "u", "--output", "y", "--time", "time_s", "--search", kind,
               "--logged", "output", "--p", "1,2", "--folds", 2, "--jobs", 1)  # fmt: skip
    assert done.exit_code == 0, done.output
    assert "restarts in each of its 2 segments" in done.output
    model = mlflow.sklearn.load_model("models:/tuned@champion-holes")
    assert model.state_["seen"] == 1470
    segment = np.repeat([0, 1], [700, 770])
    apart = RMILSRegressor(WienerHammersteinLags(), p=model.p, random_state=0).fit(X[kept], y[kept], groups=segment)
    np.testing.assert_allclose(model.theta_, apart.theta_, rtol=1e-9)
