"""Files and page of an identification."""

from __future__ import annotations

import json

import numpy as np
from scipy.signal import lfilter

from whsklearn.identification import identify
from whsklearn.identification.report import write
from whsklearn.models import load_model


def test_files_hold_what_the_contract_says(tmp_path):
    rng = np.random.default_rng(0)
    u = rng.standard_normal(280)
    y = lfilter([0.0, 0.5, 0.2], [1.0, -1.2, 0.5], u) + 0.01 * rng.standard_normal(280)
    found = identify(u, y, dt=0.01, units={"input": "V", "output": "rad/s"})
    page = write(found, tmp_path / "out").read_text()
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
