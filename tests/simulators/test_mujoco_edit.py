"""Effects by MuJoCo's own means: each acts, is written, and is read back."""

from __future__ import annotations

import numpy as np
import pytest

from tests.simulators.axis_xml import XML
from whsklearn.effects import (
    ActuatorLag,
    CableSpring,
    Cogging,
    DisturbanceTone,
    EndStop,
    GravityImbalance,
    HardeningSpring,
    InputDelay,
    InputOffset,
    QuadraticDrag,
    Saturation,
    Viscous,
)  # fmt: skip
from whsklearn.simulators import MuJoCoSimulator

mujoco = pytest.importorskip("mujoco", reason="mujoco is not installed (extra mujoco)")


@pytest.mark.parametrize(
    "effect",
    [
        ActuatorLag(0.01), CableSpring(0.5, 0.1), Cogging(0.1, 9.0), EndStop(5.0, 0.3), GravityImbalance(0.2, 0.4),
        HardeningSpring(0.2, 0.1), InputDelay(0.008), InputOffset(0.1), QuadraticDrag(0.05), Saturation(0.6),
        Viscous(0.1),
    ],
    ids=lambda e: e.name,
)  # fmt: skip
def test_an_effect_acts_and_is_written(effect, record, tmp_path):
    simulator = MuJoCoSimulator(XML.format(joint=""), joint="axis").with_effect(effect)
    y = simulator.simulate(record)
    assert np.std(y - record.position) > 1e-4
    again = MuJoCoSimulator(simulator.write(tmp_path / "repaired.xml"), joint="axis", actuator="motor")
    np.testing.assert_allclose(again.simulate(record), y, atol=1e-6)


def test_what_mujoco_lacks_is_refused():
    with pytest.raises(NotImplementedError, match="disturbance_tone"):
        MuJoCoSimulator(XML.format(joint=""), joint="axis").with_effect(DisturbanceTone(0.1, 5.0))
