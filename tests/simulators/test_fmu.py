"""An FMU behind the three methods: one that was exported here."""

from __future__ import annotations

import numpy as np
import pytest

from whsklearn import ServoAxis
from whsklearn.effects import CableSpring, InputOffset, OutputDrift
from whsklearn.export import export_model
from whsklearn.gap.record import ServoRecord
from whsklearn.simulators import FMUSimulator

pytest.importorskip("fmpy", reason="fmpy is not installed (extra fmu)")


def test_it_simulates_with_effects_on_its_drive(tmp_path):
    import shutil

    if shutil.which("gcc") is None:
        pytest.skip("no C compiler on this machine")
    t = np.arange(600) / 200.0
    drive = np.sin(2 * np.pi * 1.1 * t) + 0.5 * np.sin(2 * np.pi * 2.7 * t)
    axis = ServoAxis(effects=[CableSpring(3.0)], sample_rate=200.0, substeps=4)
    path = export_model(axis, to="fmu", out=tmp_path).paths[0]
    y = axis.with_effect(InputOffset(0.2)).simulate_drive(drive).position
    record = ServoRecord(t, drive, y)
    simulator = FMUSimulator(path)
    assert (simulator.drive, simulator.position) == ("drive", "y")
    bare, whole = (np.std(y - s.simulate(record)) for s in (simulator, simulator.with_effect(InputOffset(0.2))))
    assert whole < 1e-3 * bare
    with pytest.raises(NotImplementedError, match="output_drift"):
        simulator.with_effect(OutputDrift(0.1))
    with pytest.raises(ValueError, match="no variable 'torque'"):
        FMUSimulator(path, drive="torque")
