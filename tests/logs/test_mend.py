"""Logs with the usual faults come back mended, and say so."""

from __future__ import annotations

import numpy as np
import pytest

from tests.logs.rig import columns
from whsklearn.logs import LogError, LogWarning
from whsklearn.logs.mend import turn_in


def turning(n=2000):
    table = columns(n)
    table["position_rad"] = 3.0 * table["time_s"] + 0.3 * np.sin(table["time_s"])
    return table


@pytest.mark.parametrize(
    ("name", "turn", "low"),
    [("position_rad", 2 * np.pi, -np.pi), ("position_rad", 2 * np.pi, 0.0), ("position_deg", 360.0, -180.0),
     ("position_counts", 65536.0, 0.0), ("position_counts", 4096.0, 0.0), ("angle", 360.0, 0.0)],
)  # fmt: skip
def test_a_wrapped_angle_goes_on(load, name, turn, low):
    table = turning()
    true = table.pop("position_rad") / (2 * np.pi) * turn
    wrapped = np.mod(true - low, turn) + low
    table[name] = np.round(wrapped) if turn > 400 else wrapped
    log = load(table, position=name)
    assert np.allclose(log.y - log.y[0], true - true[0], atol=1.0 if turn > 400 else 1e-6)
    assert "LOG012" in log.report.codes


def test_what_is_not_wrapped_is_left(load):
    table = turning()
    assert turn_in(table["position_rad"], "rad") is None
    assert turn_in(3.1 * np.sign(np.sin(table["time_s"])), "rad") is None  # a command that steps from end to end
    log = load(columns())
    assert "LOG012" not in log.report.codes


def test_an_emergency_stop_is_cut_out_and_a_coast_is_not(load):
    table = columns(2000)
    rng = np.random.default_rng(0)
    table["torque_nm"] = table["torque_nm"] + 0.01 * rng.normal(size=2000)
    stopped = {k: v.copy() for k, v in table.items()}
    stopped["torque_nm"][1000:1400] = 0.0
    stopped["position_rad"][1040:1400] = stopped["position_rad"][1040]
    with pytest.warns(LogWarning, match="emergency stop"):
        log = load(stopped)
    assert np.bincount(log.groups).tolist() == [1000, 600]
    coast = {k: v.copy() for k, v in table.items()}
    coast["torque_nm"][1000:1400] = 0.0
    assert len(load(coast).y) == 2000


def test_a_velocity_alone_is_summed_up(load):
    table = columns(1000)
    table["velocity_rad_s"] = -2 * np.sin(2 * table["time_s"])
    with pytest.warns(LogWarning, match="Only the velocity"):
        log = load(table, position=None, velocity="velocity_rad_s")
    assert np.allclose(log.y, np.cos(2 * table["time_s"]) - 1, atol=1e-4)
    assert log.units["position"] == "rad"


def test_values_beyond_measure(load):
    table = columns(1000)
    table["torque_nm"][77] = 1e300
    with pytest.warns(LogWarning, match=r"no value at row 77 \(1e\+300"):
        assert np.abs(load(table).X).max() < 2
    table["torque_nm"] = table["torque_nm"] * 0 + 1e-300
    with pytest.raises(LogError, match="never exceeds 1e-300"):
        load(table)
