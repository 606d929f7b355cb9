"""Models in files."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from whsklearn.effects import (
    Coulomb,
    FrictionLaw,
    GravityImbalance,
    InputOffset,
    Power,
    SpeedHinge,
    Viscous,
)
from whsklearn.models import AxisModel, ChainModel, LinearModel, load_model, save_model

U = np.sin(np.arange(200) / 7)
MODELS = {
    "arx": LinearModel(
        [0.0, 0.4], [1.0, -0.6], 0.1, criterion="prediction", dt=0.01, units={"input": "V", "output": "m/s"}
    ),
    "output_error": LinearModel([0.2, 0.4], [1.0, -0.6], dt=0.01, logged="position"),
    "wiener-hammerstein": ChainModel(
        [0.3, 0.1],
        [1.0, -0.5],
        FrictionLaw([Power(1.0, 1), Power(0.2, 3)]),
        [1.0],
        [1.0, 0.3],
        standard_errors={"x3": 0.1},
    ),
    "axis": AxisModel(
        0.05, FrictionLaw([Viscous(0.1), Coulomb(0.2)]), (InputOffset(0.05),), dt=0.01, logged="position"
    ),
}


@pytest.mark.parametrize("kind", MODELS)
def test_a_model_comes_back_as_it_was(kind, tmp_path):
    model, path = MODELS[kind], tmp_path / "model.json"
    save_model(model, path)
    again = load_model(path)
    assert again == model
    assert again.kind == kind == json.loads(path.read_text())["kind"]
    np.testing.assert_array_equal(again.simulate(U), model.simulate(U))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"format": "other"}, "identify or gap wrote"),
        ({"version": 3}, "upgrade"),
        ({"version": 1}, "identify again"),
        ({"version": True}, "upgrade"),
        ({"kind": "oracle"}, "expected one of"),
        ({"dt": -1.0}, "above zero"),
        ({"structure": {}}, "missing"),
        ({"structure": {"inertia": 1.0, "law": [{"class": "os.system", "fields": {}}], "effects": []}}, "No Effect"),
    ],
)
def test_what_cannot_be_is_refused_in_one_sentence(change, message, tmp_path):
    path = tmp_path / "model.json"
    save_model(MODELS["axis"], path)
    path.write_text(json.dumps(json.loads(path.read_text()) | change))
    with pytest.raises(ValueError, match=message):
        load_model(path)


def test_no_json_is_refused(tmp_path):
    path = tmp_path / "model.json"
    path.write_text("kind: axis")
    with pytest.raises(ValueError, match="holds no model that can be read: it is not JSON"):
        load_model(path)


def test_a_position_is_the_integral_of_the_velocity():
    velocity, position = (LinearModel([0.0, 0.4], [1.0, -0.6], dt=0.01, logged=s) for s in ("velocity", "position"))
    np.testing.assert_allclose(np.diff(position.simulate(U)) / 0.01, velocity.simulate(U)[1:])


def test_an_axis_says_what_it_answers_with():
    with pytest.raises(ValueError, match="say which"):
        AxisModel(0.05, FrictionLaw([Viscous(0.1)]))


def test_a_document_that_is_nested_without_end_is_refused(tmp_path):
    path = tmp_path / "model.json"
    path.write_text("[" * 100_000 + "]" * 100_000)
    with pytest.raises(ValueError, match="nested too deeply"):
        load_model(path)


DEG = np.pi / 180
LAW = FrictionLaw([Viscous(0.12), Coulomb(0.3), SpeedHinge(0.05, 0.5)])
GRAVITY = (InputOffset(0.05), GravityImbalance(0.2, phase=0.3))
NAMED = {"inertia": 1e-3, "viscous": 2e-3, "gravity_imbalance__phase": 0.1}
TRUTH = AxisModel(0.05, LAW, GRAVITY, dt=0.01, logged="position", standard_errors=NAMED)


def test_a_file_says_the_unit_of_every_number_and_column(tmp_path):
    for model in (*MODELS.values(), TRUTH, replace(TRUTH, units={"input": "mA", "output": "mm"})):
        save_model(model, tmp_path / "model.json")
        written = json.loads((tmp_path / "model.json").read_text())
        assert set(written["parameter_units"]) == set(written["parameters"])
        assert all(written["parameter_units"].values())
        assert set(written["units"]) == {"time", "input", "output"}
        assert all(written["units"].values())
    assert written["parameter_units"] | {} == {
        "inertia": "A s²/m", "viscous": "A s/m", "coulomb": "A", "speed_hinge": "A s/m", "speed_hinge__knot": "m/s",
        "input_offset": "A", "gravity_imbalance": "A", "gravity_imbalance__phase": "rad",
    }  # fmt: skip


@pytest.mark.parametrize("logged", ["position", "velocity"])
def test_a_model_takes_and_gives_its_columns_and_holds_si(logged):
    out = {"position": "deg", "velocity": "rpm"}[logged]
    scale = {"deg": 1 / DEG, "rpm": 30 / np.pi}[out]
    truth = replace(TRUTH, logged=logged)
    model = replace(truth, units={"input": "mNm", "output": out})
    np.testing.assert_allclose(model.simulate(1e3 * U, start=scale * 0.2), scale * truth.simulate(U, start=0.2))
    assert model.parameters == truth.parameters


@pytest.mark.parametrize(("unit", "factor"), [("Nm", 1e3), ("mNm", 1.0), ("as logged", 1.0)])
def test_a_column_is_brought_to_the_models(unit, factor):
    model = replace(TRUTH, units={"input": "mNm", "output": "deg"})
    assert model.column_factor("input", unit) == pytest.approx(factor)
    with pytest.raises(ValueError, match=r"in A, that of the model in mNm.*--unit drive=UNIT"):
        model.column_factor("input", "A")
