"""TDMS and MDF4 files, made with the libraries that people write them with."""

from __future__ import annotations

import numpy as np
import pytest

from tests.logs.rig import RATE, TABLE, same
from whsklearn.logs import load_log


def test_tdms_with_a_waveform_and_with_a_time_channel(tmp_path):
    nptdms = pytest.importorskip("nptdms")
    for track in ({"wf_increment": 1 / RATE, "wf_start_offset": 0.0, "wf_samples": 1}, {}):
        path = tmp_path / f"axis{len(track)}.tdms"
        with nptdms.TdmsWriter(path) as writer:
            writer.write_segment(
                [
                    nptdms.ChannelObject("rig", k, v, {**track, "unit_string": u})
                    for (k, v), u in zip(TABLE.items(), ("s", "Nm", "deg"), strict=True)
                ]
            )
        log = load_log(path, time=None if track else "time_s", drive="torque_nm", position="position_rad")
        same(log)
        assert (log.units["drive"], log.units["position"]) == ("Nm", "deg")


def test_mdf4_with_two_groups_of_their_own_clock(tmp_path):
    asammdf = pytest.importorskip("asammdf")
    path = tmp_path / "axis.mf4"
    with asammdf.MDF() as file:
        for name, unit, every in (("torque", "Nm", 1), ("angle", "rad", 1), ("slow", "V", 2)):
            key = {"torque": "torque_nm", "angle": "position_rad", "slow": "torque_nm"}[name]
            file.append(asammdf.Signal(TABLE[key][::every], TABLE["time_s"][::every], name=name, unit=unit))
        file.save(path)
    log = load_log(path, drive="torque", position="angle")
    same(log)
    assert log.units == {"time": "s", "drive": "Nm", "position": "rad"}
    slow = load_log(path, drive="slow", position="angle")
    assert np.corrcoef(slow.X[:, 0], TABLE["torque_nm"][: len(slow.y)])[0, 1] > 0.99
    assert any("interpolated linearly at the stamps" in n for n in slow.notes)
