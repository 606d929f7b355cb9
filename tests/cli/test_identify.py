"""The command that asks which structure a log has."""

from __future__ import annotations

import json

import numpy as np
import pandas as pd
import pytest
from click.testing import CliRunner
from scipy.signal import lfilter

from whsklearn.cli.identify import log_of, main
from whsklearn.models import load_model


def test_a_linear_log_gives_a_linear_model_its_numbers_and_a_page(tmp_path):
    u = np.random.default_rng(0).normal(size=110)
    y = lfilter([0.0, 0.5, 0.2], [1.0, -1.2, 0.5], u) + 0.01 * np.random.default_rng(1).normal(size=110)
    pd.DataFrame({"u": u, "y": y}).to_csv(tmp_path / "log.csv", index=False)
    arguments = [tmp_path / "log.csv", "--input", "u", "--output", "y", "--no-track", "--out", tmp_path / "out"]
    done = CliRunner().invoke(main, [str(a) for a in arguments])
    assert done.exit_code == 0, done.output
    found = json.loads((tmp_path / "out" / "identify.json").read_text())
    assert found["recommended"] in ("arx", "output_error")
    assert {m["kind"] for m in found["models"]} >= {"arx", "output_error"}
    numbers = {p["name"]: (p["value"], p["standard_error"]) for p in found["parameters"]}
    for name, truth in (("b1", 0.5), ("f1", -1.2)):
        assert abs(numbers[name][0] - truth) < 4 * numbers[name][1] < 0.1
    model = load_model(tmp_path / "out" / "model.json")
    assert np.std(model.simulate(u) - y) < 0.02
    assert "b1" in done.output


def test_columns_must_be_named():
    with pytest.raises(ValueError, match="Give --input and --output"):
        log_of("log.csv", {"columns": None, "input_column": "u", "output_column": None})
