"""repaired.json is a model file like any other."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from tests.gap.plants.test_servo_model import friction, started
from tests.gap.plants.test_servo_model import model as axis_model
from whsklearn import ServoAxis, WienerHammersteinSystem
from whsklearn.effects import Cogging, FlexibleCoupling, InputOffset, as_law
from whsklearn.gap.diagnosis import Diagnosis
from whsklearn.gap.plants.servo import ServoPlant
from whsklearn.gap.plants.servo_candidates import catalogue
from whsklearn.gap.repaired import as_model
from whsklearn.gap.report import write_report
from whsklearn.models import AxisModel, load_model, save_model
from whsklearn.systems.servo_parts import Drive

DRIVE = np.sin(np.arange(400) / 20.0)


def test_an_axis_comes_back_with_its_units(tmp_path):
    axis = ServoAxis(effects=[Cogging(0.1, 12.0)], drive=Drive(delay=0.003), sample_rate=500.0)
    save_model(as_model(axis, ("A", "rad")), tmp_path / "repaired.json")
    model = load_model(tmp_path / "repaired.json")
    assert model.units == {"input": "A", "output": "rad"}
    own = axis.simulate_drive(DRIVE, noise=False).position
    np.testing.assert_allclose(model.simulate(DRIVE), own, atol=1e-3 * np.std(own))  # four fine steps in place of 20


KINDS = [c for c in catalogue() if c.cls.__module__.startswith("whsklearn")]  # other tests define more


@pytest.mark.parametrize("kind", KINDS, ids=lambda c: c.label)
def test_any_candidate_of_an_axis_is_the_same_free_run_from_its_file(kind, tmp_path):
    found = dataclasses.replace(axis_model(*friction(0.1, 0.05), started(kind), timing=0.4), n_base=2)
    axis = ServoPlant.system(None, found)
    assert [e.name for e in axis.effects] == [kind.name]
    save_model(as_model(axis), tmp_path / "repaired.json")
    own = axis.simulate_drive(DRIVE, noise=False).position
    assert np.ptp(own) > 1e-3
    np.testing.assert_allclose(load_model(tmp_path / "repaired.json").simulate(DRIVE), own, rtol=0, atol=1e-9)


def test_a_slow_log_of_a_coupling_is_simulated_in_steps_that_it_needs():
    slow = AxisModel(0.05, as_law("viscous"), (FlexibleCoupling(2e-3),), dt=0.01, logged="position")
    finer = slow.system(substeps=16 * slow.system().substeps)
    drive = np.repeat(np.random.default_rng(0).normal(size=40), 10)
    run, fine = (axis.simulate_drive(drive, noise=False).position for axis in (slow.system(), finer))
    np.testing.assert_allclose(run, fine, rtol=0, atol=1e-4 * np.std(fine))


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
