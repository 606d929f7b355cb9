"""repaired.json is a model file like any other."""

from __future__ import annotations

import numpy as np
import pytest

from whsklearn import ServoAxis, WienerHammersteinSystem
from whsklearn.effects import Cogging, InputOffset
from whsklearn.gap.diagnosis import Diagnosis
from whsklearn.gap.repaired import as_model
from whsklearn.gap.report import write_report
from whsklearn.models import load_model, save_model
from whsklearn.systems.servo_parts import Drive

DRIVE = np.sin(np.arange(400) / 20.0)


def test_an_axis_comes_back_with_its_units(tmp_path):
    axis = ServoAxis(effects=[Cogging(0.1, 12.0)], drive=Drive(delay=0.003), sample_rate=500.0)
    save_model(as_model(axis, ("A", "rad")), tmp_path / "repaired.json")
    model = load_model(tmp_path / "repaired.json")
    assert model.units == {"input": "A", "output": "rad"}
    own = axis.simulate_drive(DRIVE, noise=False).position
    np.testing.assert_allclose(model.simulate(DRIVE), own, atol=1e-3 * np.std(own))  # fewer fine steps


@pytest.mark.parametrize("direct", [0, 1, 2])
@pytest.mark.parametrize("effects", [(), (InputOffset(0.2),)])
def test_a_chain_comes_back_with_its_effects_and_direct_paths(effects, direct, tmp_path):
    system = WienerHammersteinSystem([1.0, 0.5], [-0.5], [1.0], [-0.2], effects=effects, dt=0.01, direct=direct)
    save_model(as_model(system, ("V", "")), tmp_path / "repaired.json")
    model = load_model(tmp_path / "repaired.json")
    np.testing.assert_allclose(model.simulate(DRIVE), system.simulate(DRIVE), atol=1e-12)
    assert model.units == {"input": "V"}


def test_a_simulator_that_writes_itself_is_written(tmp_path, monkeypatch):
    class Model:
        def to_xml(self):
            return "<mujoco/>"

    monkeypatch.setattr("whsklearn.gap.html_report.render", lambda d: "")
    write_report(Diagnosis("no_gap", ""), tmp_path, Model())
    assert (tmp_path / "repaired.xml").read_text() == "<mujoco/>"
    assert not (tmp_path / "repaired.json").exists()
