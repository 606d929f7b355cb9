"""The record: what a run holds, how it ends, and what happens where there is no MLflow or no server."""

from __future__ import annotations

import os
import signal
import subprocess
import sys

import numpy as np
import pandas as pd
import pytest
from sklearn.linear_model import Ridge
from sklearn.model_selection import GridSearchCV, TimeSeriesSplit

from tests.tracking.recorded import runs
from whsklearn import tracking
from whsklearn.models import LinearModel, save_model
from whsklearn.tracking import open_tracker


def test_run_holds_what_was_logged(tracker):
    with tracker.run("parent") as parent, parent.child("child", tags={"reading": "full"}) as child:
        child.log_params({"p": 4})
        child.log_metrics({"nmse": 0.5})
        parent.log_metrics({"nmse": 0.25})
    parent, child = runs(tracker)["parent"], runs(tracker)["child"]
    assert child.data.tags["mlflow.parentRunId"] == parent.info.run_id
    assert child.data.tags["reading"] == "full"
    assert child.data.tags["data"] == "made up"
    assert child.data.tags["version"]
    assert child.data.params == {"p": "4"}
    assert (parent.data.metrics["nmse"], child.data.metrics["nmse"]) == (0.25, 0.5)
    assert parent.info.status == child.info.status == "FINISHED"


def test_failed_run_says_why_and_keeps_what_it_had(tracker):
    def job(run):
        run.log_metrics({"nmse": 1.0})
        raise ValueError("the log is too short\nand a second line")

    with pytest.raises(ValueError, match="too short"), tracker.run("bad") as run:
        job(run)
    bad = runs(tracker)["bad"]
    assert bad.info.status == "FAILED"
    assert bad.data.tags["reason"] == "ValueError: the log is too short"
    assert bad.data.metrics == {"nmse": 1.0}


def test_interrupted_run_is_killed(tracker):
    with pytest.raises(KeyboardInterrupt), tracker.run("stopped"):
        raise KeyboardInterrupt
    assert runs(tracker)["stopped"].info.status == "KILLED"


@pytest.mark.parametrize("call", ["create_run", "set_terminated"])
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_interruption_within_a_call_leaves_no_run_open(tracker, call, number, monkeypatch):
    """As it lands when the database is slow: after the row is written, before the call returns."""
    # a job in the background of a shell begins with SIGINT ignored
    before = {s: signal.signal(s, signal.default_int_handler) for s in (signal.SIGINT, signal.SIGTERM)}
    whole = getattr(tracker.client._client, call)

    def interrupted(*args, **kwargs):
        result = whole(*args, **kwargs) if call == "create_run" else None
        signal.raise_signal(number)
        return whole(*args, **kwargs) if result is None else result

    monkeypatch.setattr(tracker.client._client, call, interrupted)
    try:
        with pytest.raises(KeyboardInterrupt), tracker.run("stopped"):
            pass
        assert signal.getsignal(signal.SIGTERM) is signal.default_int_handler
    finally:
        for s, handler in before.items():
            signal.signal(s, handler)
    assert runs(tracker)["stopped"].info.status == {"create_run": "KILLED", "set_terminated": "FINISHED"}[call]


def test_paths_are_stepped_and_thinned(tracker):
    path = np.linspace(0.0, 1.0, 5000)
    with tracker.run("paths") as run:
        run.log_paths({"x_hat(k-2)": path, "b[1]": path[:7]}, points=100)
    history = tracker.client.get_metric_history(run.id, "x_hat_k-2")
    assert len(history) == 100
    assert [m.value for m in history] == [path[m.step] for m in history]
    assert history[-1].step == 4999  # the final value is never thinned away
    assert len(tracker.client.get_metric_history(run.id, "b_1")) == 7


def test_what_is_not_finite_becomes_a_tag(tracker):
    with tracker.run("broken") as run:
        run.log_metrics({"nmse": float("nan"), "rmse": float("inf"), "mu_e": 0.0})
    broken = runs(tracker)["broken"]
    assert broken.data.metrics == {"mu_e": 0.0}
    assert broken.data.tags["not_finite"]


def test_input_is_logged_as_a_data_set(tracker):
    X = np.arange(10.0)[:, None]
    with tracker.run("input") as run:
        run.log_input(X, X[:, 0], "ramp")
    (entry,) = runs(tracker)["input"].inputs.dataset_inputs
    assert entry.dataset.name == "ramp"
    assert entry.dataset.digest


def test_model_comes_back_by_its_alias(tracker):
    import mlflow

    X = np.linspace(-1, 1, 30)[:, None]
    model = Ridge().fit(X, X[:, 0])
    with tracker.run("model") as run:
        run.log_model(model, X, registered_name="axis", alias="champion")
        assert run.tracker.client.get_run(run.id).info.status == "RUNNING"
    again = mlflow.sklearn.load_model("models:/axis@champion")
    np.testing.assert_array_equal(again.predict(X), model.predict(X))
    assert len(mlflow.models.get_model_info("models:/axis@champion").signature.inputs.inputs) == 1


BODIES = [
    {"dataframe_split": {"columns": ["u"], "data": [[1], [0.5]]}},
    {"dataframe_records": [{"u": 1}, {"u": 0.5}]},
    {"inputs": [[1], [0.5]]},
    {"inputs": [1, 0.5]},
    {"instances": [[1], [0.5]]},
]


@pytest.mark.filterwarnings("ignore:X has feature names", "ignore:.*Any type hint", "ignore:.*(py|P)ydantic.*")
@pytest.mark.parametrize("kind", ["an estimator", "a model file"])
def test_a_served_model_takes_numbers_of_any_kind(kind, tracker, tmp_path):
    import mlflow
    from mlflow.pyfunc.scoring_server import infer_and_parse_data

    X = np.linspace(-1, 1, 30)[:, None]
    model = LinearModel([0.0, 0.5], [1.0, -0.5]) if kind == "a model file" else Ridge(alpha=1e-9).fit(X, 2 * X[:, 0])
    with tracker.run("model") as run:
        if kind == "a model file":
            save_model(model, tmp_path / "model.json")
            address = run.log_file_model(tmp_path / "model.json", pd.DataFrame(X, columns=["u"]))
        else:
            address = run.log_model(model, X)
    served = mlflow.pyfunc.load_model(address)
    rows = np.array([[1.0], [0.5]])
    wanted = [0.0, 0.5] if kind == "a model file" else [2.0, 1.0]
    assert list(served.input_example.columns) == ["u"]
    given = [rows, rows.astype(np.float32), rows.tolist(), pd.DataFrame({"u": np.float32([1.0, 0.5])})]
    given += [infer_and_parse_data(body, served.metadata.get_input_schema()) for body in BODIES]
    for x in given:
        x = x[0] if isinstance(x, tuple) else x
        np.testing.assert_allclose(np.ravel(served.predict(x)), wanted, rtol=1e-6)
    whole = np.ravel(served.predict([[2], [1]]))
    np.testing.assert_allclose(whole, 2 * np.array(wanted), rtol=1e-6)


@pytest.mark.filterwarnings("ignore:.*Any type hint", "ignore:.*(py|P)ydantic.*")
def test_a_served_model_file_names_its_column_and_units_and_converts_or_refuses(tracker, tmp_path):
    import mlflow

    units = {"input": "Nm", "output": "deg"}
    save_model(LinearModel([0.0, 0.5], [1.0, -0.5], units=units), tmp_path / "model.json")
    with tracker.run("model") as run:
        frame = pd.DataFrame({"torque_nm": [1.0, 1.0, 1.0]})
        address = run.log_file_model(tmp_path / "model.json", frame)
    served = mlflow.pyfunc.load_model(address)
    assert list(served.input_example.columns) == ["torque_nm"]
    assert served.metadata.metadata == {"column": "torque_nm", "units": units}
    wanted = np.ravel(served.predict(frame))
    assert wanted[-1] > 0.0
    np.testing.assert_allclose(np.ravel(served.predict(1000.0 * frame.set_axis(["torque_mnm"], axis=1))), wanted)
    with pytest.raises(ValueError, match="'current_a' is in A, which cannot be converted to Nm"):
        served.predict(frame.set_axis(["current_a"], axis=1))


def test_globals_of_mlflow_are_left_alone(tracker, monkeypatch):
    import mlflow

    with tracker.run("model") as run:
        before = dict(os.environ), mlflow.get_tracking_uri()
        run.log_model(Ridge().fit([[0.0], [1.0]], [0.0, 1.0]), [[0.0], [1.0]])
        assert (dict(os.environ), mlflow.get_tracking_uri()) == before
    assert mlflow.active_run() is None


def test_environment_wins_over_the_default(monkeypatch, tmp_path):
    monkeypatch.setenv("MLFLOW_TRACKING_URI", "http://a.team.example")
    assert tracking.tracking_uri(tmp_path) == "http://a.team.example"
    monkeypatch.delenv("MLFLOW_TRACKING_URI")
    assert tracking.tracking_uri(tmp_path) == f"sqlite:///{tmp_path}/mlruns/mlflow.db"


def test_without_tracking_nothing_is_needed_and_nothing_written(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setitem(sys.modules, "mlflow", None)  # makes `import mlflow` raise
    tracker = open_tracker("x", enabled=False)
    with tracker.run("a") as run, run.child("b") as child:
        child.log_params({"p": 1})
        child.log_metrics({"nmse": 1.0})
        child.log_tags({"a": 1})
        child.log_input([[0.0]], [0.0], "d")
        assert child.log_model(object(), [[0.0]]) == ""
    assert not list(tmp_path.iterdir())


def test_library_imports_neither_mlflow_nor_matplotlib():
    code = (
        "import sys, whsklearn, whsklearn.tracking, whsklearn.plot; print({'mlflow', 'matplotlib'} & set(sys.modules))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "set()"


def test_an_address_of_the_environment_is_not_pinned_by_a_logged_model(mlflow_root, monkeypatch):
    import mlflow

    from whsklearn import RLSRegressor

    X, y = np.eye(20, 2), np.arange(20.0)
    with open_tracker("pinned").run("one") as run:
        run.log_model(RLSRegressor().fit(X, y), X)
    monkeypatch.setenv("MLFLOW_TRACKING_URI", "sqlite:///elsewhere.db")
    assert mlflow.get_tracking_uri() == "sqlite:///elsewhere.db"


def test_a_name_with_bytes_that_the_locale_has_no_character_for_is_recorded(tracker):
    name = "Größe".encode().decode("ascii", "surrogateescape")
    with tracker.run(name, tags={"data": name}) as run:
        run.log_params({"log_file": name})
        run.log_tags({"best": name})
    (found,) = runs(tracker).values()
    assert (found.info.run_name, found.data.tags["data"], found.data.tags["best"]) == ("Größe",) * 3
    assert found.data.params["log_file"] == "Größe"


def test_search_gets_a_child_for_each_candidate(tracker):
    X = np.random.default_rng(0).normal(size=(60, 3))
    scoring = {"neg_nmse": "neg_mean_squared_error", "r2": "r2"}
    search = GridSearchCV(Ridge(), {"alpha": [0.1, 1, 10]}, scoring=scoring, refit="neg_nmse", cv=TimeSeriesSplit(4))
    search.fit(X, X @ [1.0, 2.0, 3.0])
    with tracker.run("search") as parent:
        tracking.log_candidates(parent, search.cv_results_)
    children = [r for r in runs(tracker).values() if "mlflow.parentRunId" in r.data.tags]
    assert {r.data.params["alpha"] for r in children} == {"0.1", "1", "10"}
    for run in children:
        folds = tracker.client.get_metric_history(run.info.run_id, "fold/nmse")
        assert [m.step for m in folds] == [0, 1, 2, 3]
        assert np.mean([m.value for m in folds]) == pytest.approx(run.data.metrics["nmse"])
        assert run.data.metrics["nmse"] > 0  # scikit-learn's sign is turned back
        assert run.data.metrics["r2"] > 0


def test_only_candidates_not_yet_recorded_are_logged(tracker):
    results = {"params": [{"p": 1}, {"p": 2}], "mean_test_score": [1, 2], "std_test_score": [0, 0]}
    results |= {"split0_test_score": [1, 2], "mean_fit_time": [0.1, 0.1]}
    with tracker.run("search") as parent:
        tracking.log_candidates(parent, results, first=1)
    assert set(runs(tracker)) == {"search", "p=2"}
