"""Files and page of an identification."""

from __future__ import annotations

import json
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.signal import lfilter

from whsklearn.effects import Cogging, Coulomb, FrictionLaw, InputOffset, Viscous
from whsklearn.identification import identify
from whsklearn.identification.report import _force, figure, on_intervals, write
from whsklearn.models import AxisModel, load_model
from whsklearn.recursion.batch.axis_free_run import behind_the_spring


def test_files_hold_what_the_contract_says(tmp_path):
    rng = np.random.default_rng(0)
    u = rng.standard_normal(280)
    y = lfilter([0.0, 0.5, 0.2], [1.0, -1.2, 0.5], u) + 0.01 * rng.standard_normal(280)
    found = identify(u, y, dt=0.01, units={"input": "V", "output": "rad/s"})
    page = write(found, tmp_path / "out", ["log.csv: 280 samples at 100 Hz."]).read_text()
    assert "log.csv: 280 samples" in page
    assert "one free run on the held-out end of the log" in page
    assert figure(found).axes[1].get_ylabel() == "dB of rad/s per V"
    document = json.loads((tmp_path / "out" / "identify.json").read_text())
    assert document["recommended"] in ("arx", "output_error")
    assert document["model_file"] == "model.json"
    for model in document["models"]:
        assert {"kind", "structure", "criterion", "train", "test", "seconds"} <= model.keys()
        assert {"nmse", "rmse"} == model["test"].keys()
    named = {p["name"]: p for p in document["parameters"]}
    assert abs(named["f1"]["value"] + 1.2) < 4 * named["f1"]["standard_error"] < 0.1
    model = load_model(tmp_path / "out" / "model.json")
    np.testing.assert_allclose(model.simulate(u), found.model.simulate(u))
    assert found.recommended.name in page
    assert "data:image/png" in page
    assert '<td class="n"></td>' not in page


def test_intervals_of_an_axis_on_a_spring_are_not_said_to_be_widened():
    law = FrictionLaw([Viscous(0.1), Coulomb(0.1)])
    spring = behind_the_spring(np.array([0.1, 0.1, 0.1, 0.0, 0.05, 0.05, 20.0, 0.5, 0.02]))
    for effects, told in (((), True), (spring, False)):
        model = AxisModel(0.1, law, (InputOffset(0.0), *effects), dt=0.001, logged="position")
        train = SimpleNamespace(y=np.random.default_rng(0).normal(size=300))
        found = SimpleNamespace(white=False, recommended=SimpleNamespace(kind="axis"), model=model, train=train)
        text = on_intervals(found)
        assert "something may be missing" in text
        assert ("widened" in text) == told
        assert ("do not include" in text) != told


def test_the_force_over_the_position_is_drawn_in_the_units_of_the_log():
    matplotlib = pytest.importorskip("matplotlib.figure")
    law, cogging = FrictionLaw([Viscous(0.1), Coulomb(0.1)]), Cogging(0.2, 8.0, 0.5)
    units = {"input": "mNm", "output": "deg"}
    model = AxisModel(0.1, law, (InputOffset(0.3), cogging), dt=0.001, logged="position", units=units)
    train = SimpleNamespace(y=np.linspace(-40.0, 20.0, 300), si=(1e-3, np.pi / 180.0))
    ax = matplotlib.Figure().subplots()
    _force(ax, SimpleNamespace(model=model, train=train), [cogging])
    place, force = ax.lines[0].get_data()
    assert (place.min(), place.max()) == (-40.0, 20.0)
    np.testing.assert_allclose(force, 200.0 * np.cos(8.0 * np.radians(place) + 0.5), atol=1e-9)
    assert "deg" in ax.get_xlabel()
    assert "mNm" in ax.get_ylabel()
