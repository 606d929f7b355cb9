"""Models in files."""

from __future__ import annotations

import json

import numpy as np
import pytest

from whsklearn.effects import Coulomb, FrictionLaw, InputOffset, Power, Viscous
from whsklearn.models import AxisModel, ChainModel, LinearModel, load_model, save_model

U = np.sin(np.arange(200) / 7)
MODELS = {
    "arx": LinearModel(
        [0.0, 0.4], [1.0, -0.6], 0.1, criterion="prediction", dt=0.01, units={"input": "V", "output": "m/s"}
    ),
    "output_error": LinearModel([0.2, 0.4], [1.0, -0.6], dt=0.01, logged="position"),
    "wiener_hammerstein": ChainModel(
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
        ({"version": 2}, "upgrade"),
        ({"version": True}, "upgrade"),
        ({"kind": "oracle"}, "expected one of"),
        ({"dt": -1.0}, "above zero"),
        ({"structure": {}}, "missing"),
        ({"structure": {"inertia": 1.0, "law": [{"class": "os.system", "fields": {}}], "effects": []}}, "no Effect"),
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
    with pytest.raises(ValueError, match="holds no model"):
        load_model(path)


def test_a_position_is_the_integral_of_the_velocity():
    velocity, position = (LinearModel([0.0, 0.4], [1.0, -0.6], dt=0.01, logged=s) for s in ("velocity", "position"))
    np.testing.assert_allclose(np.diff(position.simulate(U)) / 0.01, velocity.simulate(U)[1:])


def test_an_axis_says_what_it_answers_with():
    with pytest.raises(ValueError, match="say which"):
        AxisModel(0.05, FrictionLaw([Viscous(0.1)]))
