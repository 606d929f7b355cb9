"""The turntable from log to served model, and the page that shows its runs."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from pipelines._rigs import Task
from pipelines.turntable import excitation_advice, main
from whsklearn import RMILSRegressor, WienerHammersteinLags
from whsklearn.cli import comparison
from whsklearn.datasets import load_turntable, make_wiener_hammerstein
from whsklearn.tracking.store import VIEW_NAME, view_of

COLUMNS = ["--time", "time_s", "--reference", "reference_rad", "--drive", "torque_nm", "--position", "position_rad"]
ROOT = Path(__file__).resolve().parents[2]
PATIENCE = 180  # seconds for a page to answer on a busy machine


@pytest.fixture(scope="module", autouse=True)
def short_paths():
    """Paths of four points and a short warm-up: how many there are, and what a fit takes, is asked elsewhere."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(comparison, "MOST_OF_A_PATH", 4)
        patch.setattr(comparison, "WARM_UP", 60)
        yield


@pytest.fixture(scope="module")
def recorded(short_paths, migrated_database, tmp_path_factory):
    """A log identified with tracking on: the printed text and the address of the store."""
    folder = tmp_path_factory.mktemp("turntable")
    (folder / "mlruns").mkdir()
    store = f"sqlite:///{shutil.copy(migrated_database, folder / 'mlruns' / 'mlflow.db')}"
    load_turntable("multisine").iloc[:160].to_csv(folder / "log.csv", index=False)
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("MLFLOW_TRACKING_URI", store)
        done = CliRunner().invoke(main, ["--log", str(folder / "log.csv"), *COLUMNS])
    assert done.exit_code == 0, done.output
    return done.stdout, store


@pytest.mark.slow
def test_both_pairs_are_compared_within_100_columns(recorded):
    text, _ = recorded
    assert "reference to position, free run" in text
    assert "drive to velocity, free run" in text
    assert text.count("Excitation:") == 2
    lines = [line for line in text.splitlines() if "mlruns" not in line]  # a path is as long as it is
    assert max(map(len, lines)) <= 100


@pytest.mark.parametrize(("u", "told"), [("sine", "show only combinations of"), ("white", "all 9 directions are seen")])
def test_one_sine_cannot_show_the_parameters(u, told):
    X, y = make_wiener_hammerstein(800, random_state=0)
    if u == "sine":
        X, y = (part[:800] for part in load_turntable("sine", return_X_y=True))
    lags, record = WienerHammersteinLags(), comparison.ComparedRecord(u, X, y)
    fitted = RMILSRegressor(lags, gradient="pseudolinear").fit(X, y)
    outcome = comparison.Outcome(comparison.ComparedModel("RMILS", fitted), indices={"nmse": 0.1}, fitted=fitted)
    assert told in excitation_advice(Task("", record, [], 0, ""), lags, [outcome])


def test_champion_is_loaded_and_goes_on_learning(recorded, monkeypatch):
    import mlflow

    monkeypatch.setenv("MLFLOW_TRACKING_URI", recorded[1])
    model = mlflow.sklearn.load_model("models:/turntable@champion")
    X, y = load_turntable("multisine", return_X_y=True)
    before = model.theta_
    model.partial_fit(X[800:900], y[800:900])
    assert np.isfinite(model.predict(X[:100])).all()
    assert not np.array_equal(model.theta_, before)


def test_served_champion_answers(recorded, tmp_path, monkeypatch):
    """As `mlflow models serve` parses and answers a question; its process alone takes half a minute to start."""
    import mlflow

    monkeypatch.setenv("MLFLOW_TRACKING_URI", recorded[1])
    answer = tmp_path / "answer.json"
    mlflow.models.predict(
        "models:/turntable@champion", input_data=[[0.1], [0.2], [0.3]], output_path=str(answer),
        env_manager="local",
    )  # fmt: skip
    said = json.loads(answer.read_text())["predictions"]
    assert len(said) == 3
    assert np.isfinite(said).all()


@pytest.mark.slow
def test_page_shows_runs_and_metrics_in_a_browser(recorded):
    playwright = pytest.importorskip("playwright.sync_api", reason="needs the extra dev")
    browser = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
    if browser is None:
        pytest.skip("no Chromium is installed here; `apt-get install chromium` brings one")
    environment = {**os.environ, "MLFLOW_TRACKING_URI": recorded[1]}
    command = [sys.executable, "-m", "pipelines.ui", "--no-browser", "--port", "0"]
    page = subprocess.Popen(
        command, cwd=ROOT, env=environment, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
    )
    try:
        address = next(m[0] for line in page.stdout if (m := re.search(r"http\S+", line)))
        with playwright.sync_playwright() as p:
            chromium = p.chromium.launch(
                executable_path=browser, args=["--no-sandbox", "--disable-background-networking"]
            )
            tab = chromium.new_page(viewport={"width": 1600, "height": 900})
            tab.goto(address, timeout=PATIENCE * 1000)
            tab.get_by_text("RMILS (full)").first.wait_for(timeout=PATIENCE * 1000)
            shown = tab.inner_text("body")
            tab.goto(address.partition("&viewStateShareKey")[0], timeout=PATIENCE * 1000)  # MLflow's own columns
            tab.get_by_role("button", name="Views").first.click(timeout=PATIENCE * 1000)
            tab.get_by_text(VIEW_NAME, exact=True).first.click()
            tab.get_by_text("mu_e").first.wait_for(timeout=PATIENCE * 1000)
            chromium.close()
        for column in view_of("turntable")["selectedColumns"][:3]:
            assert column.split("`")[1] in shown
        assert "MILS (pseudolinear)" in shown
    finally:
        page.terminate()
        page.wait(timeout=60)
        page.stdout.close()


@pytest.mark.parametrize(
    ("options", "told"),
    [(["--position", "position_rad"], "--log needs --time and --position"), (["--time", "time_s"], "--log needs")],
)
def test_columns_that_are_missing_are_told(tmp_path, options, told):
    load_turntable().iloc[:100].to_csv(tmp_path / "log.csv", index=False)
    done = CliRunner().invoke(main, ["--no-track", "--log", str(tmp_path / "log.csv"), *options])
    assert done.exit_code == 1
    assert told in done.output


def test_a_hole_in_a_log_is_told_and_its_longest_part_used(tmp_path):
    frame = load_turntable().iloc[:200].copy()
    frame.loc[120:, "time_s"] += 0.3
    frame.to_csv(tmp_path / "log.csv", index=False)
    done = CliRunner().invoke(main, ["--no-track", "--log", str(tmp_path / "log.csv"), *COLUMNS])
    assert done.exit_code == 0, done.output
    said = " ".join(done.output.split())
    assert "120 of 200 samples are used" in said
    assert "the longest of 2 segments" in said
