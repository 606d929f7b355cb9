"""An MJCF model behind the three methods, and its repair."""

from __future__ import annotations

import numpy as np
import pytest

from tests.simulators.axis_xml import XML
from whsklearn.effects import HardeningSpring, InputDelay, PreslidingHysteresis
from whsklearn.simulators import MuJoCoSimulator

mujoco = pytest.importorskip("mujoco", reason="mujoco is not installed (extra mujoco)")


def test_it_replays_its_own_log(record):
    y = MuJoCoSimulator(XML.format(joint=""), joint="axis").simulate(record)
    assert np.std(record.position - y) < 1e-3 * np.std(record.position)


def test_refit_finds_a_wrong_damping(record):
    wrong = MuJoCoSimulator(XML.format(joint="").replace('damping="0.1"', 'damping="0.15"'), joint="axis")
    found = wrong.refit(record, np.ones(len(record), dtype=bool))
    assert found.parameters["damping"] == pytest.approx(0.1, rel=0.05)


def test_friction_that_is_not_there_is_tried():
    assert [e.name for e in MuJoCoSimulator(XML.format(joint=""), joint="axis").also_try] == ["coulomb"]


def test_a_joint_that_is_not_there_is_named():
    with pytest.raises(ValueError, match="no joint 'elbow'"):
        MuJoCoSimulator(XML.format(joint=""), joint="elbow", actuator="motor")


def test_a_delay_is_held_between_two_steps(record):
    a, b, c = (
        MuJoCoSimulator(XML.format(joint=""), joint="axis").with_effect(InputDelay(t)).simulate(record)
        for t in (0.008, 0.0083, 0.009)
    )
    assert np.std(b - a) == pytest.approx(0.3 * np.std(c - a), rel=0.02)


def test_an_unstable_trial_says_nothing_and_writes_nothing(record, tmp_path, monkeypatch, capfd):
    monkeypatch.chdir(tmp_path)
    wild = MuJoCoSimulator(XML.format(joint=""), joint="axis").with_effect(HardeningSpring(-1e9))
    assert np.isnan(wild.simulate(record)[-1])
    assert list(tmp_path.iterdir()) == []
    assert "".join(capfd.readouterr()) == ""


def test_a_bristle_that_pushes_is_refused():
    with pytest.raises(ValueError, match="bristle"):
        MuJoCoSimulator(XML.format(joint=""), joint="axis").with_effect(PreslidingHysteresis(-0.1, 0.01))
