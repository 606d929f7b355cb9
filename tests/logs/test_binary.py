"""Parquet, MATLAB, HDF5, NumPy, TDMS and MDF4 files give the columns that were put in."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from tests.logs.rig import RATE, TABLE, same
from whsklearn.logs import LogError, load_log, open_source


def test_parquet_with_lists_and_numbers(tmp_path):
    pytest.importorskip("pyarrow")
    path = tmp_path / "axis.parquet"
    frame = pd.DataFrame(TABLE)
    frame["state"] = [[p, 2 * p] for p in TABLE["position_rad"]]
    frame.to_parquet(path)
    same(load_log(path, time="time_s", drive="torque_nm", position="position_rad"))
    same(load_log(path, time="time_s", drive="torque_nm", position="state.0"))


def test_parquet_states_units_in_the_metadata_of_its_columns_and_may_hold_text(tmp_path):
    arrow, parquet = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    units = {"time": (b"unit", "ms", 1e3), "torque": (b"Units", "mNm", 1e3), "position": (b"unit", "mrad", 1e3)}
    names = dict(zip(units, TABLE, strict=True))
    fields = [arrow.field(n, arrow.string(), metadata={key: unit}) for n, (key, unit, _) in units.items()]
    cells = [arrow.array([repr(float(by * v)) for v in TABLE[names[n]]]) for n, (_, _, by) in units.items()]
    parquet.write_table(arrow.table(cells, schema=arrow.schema(fields)), tmp_path / "a.parquet")
    log = load_log(tmp_path / "a.parquet")
    assert log.units == {"time": "s", "drive": "mNm", "position": "mrad"}
    assert log.sample_rate == pytest.approx(RATE, rel=1e-6)
    assert np.allclose(log.y, 1e3 * TABLE["position_rad"], rtol=1e-12)


def test_feather(tmp_path):

    pd.DataFrame({"t": [0.0, 1.0, 2.0], "q": [1, 2, 3]}).to_feather(tmp_path / "a.feather")
    source = open_source(tmp_path / "a.feather")
    assert source.names == ["t", "q"]
    assert source.fetch(["q"])["q"].values.tolist() == [1, 2, 3]


def test_matlab_vectors_structures_and_matrices(tmp_path):
    from scipy.io import savemat

    path = tmp_path / "axis.mat"
    savemat(path, {"log": {"t": TABLE["time_s"], "tau": TABLE["torque_nm"]}, "data": np.c_[*TABLE.values()]})
    same(load_log(path, time="log.t", drive="log.tau", position="data.2"))


def test_signals_of_a_simulink_structure_with_time_are_called_by_their_labels(tmp_path):
    from scipy.io import savemat

    signals = np.empty(3, dtype=object)
    names = zip(("torque", "position", "position"), TABLE.values(), strict=True)
    signals[:] = [{"values": values, "label": label} for label, values in names]
    savemat(tmp_path / "a.mat", {"out": {"time": TABLE["time_s"], "signals": signals}})
    assert open_source(tmp_path / "a.mat").names == [
        "out.time", "out.signals.torque", "out.signals.position", "out.signals.2.values",
    ]  # fmt: skip


def test_hdf5_and_its_units(tmp_path):
    h5py = pytest.importorskip("h5py")
    path = tmp_path / "axis.h5"
    with h5py.File(path, "w") as file:
        file["run/time"], file["run/current"] = TABLE["time_s"], TABLE["torque_nm"]
        file["run/current"].attrs["unit"] = "A"
        file["run/motion"] = np.c_[TABLE["position_rad"], TABLE["position_rad"]]
    log = load_log(path, time="run/time", drive="run/current", position="run/motion.1")
    same(log)
    assert log.units["drive"] == "A"


def test_numpy_archives_hold_no_code(tmp_path):
    np.savez(tmp_path / "axis.npz", **TABLE)
    same(load_log(tmp_path / "axis.npz", time="time_s", drive="torque_nm", position="position_rad"))
    np.savez(tmp_path / "objects.npz", a=np.array([{}, {}], dtype=object))
    with pytest.raises(LogError, match="not a complete NumPy file"):
        open_source(tmp_path / "objects.npz")


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


@pytest.mark.parametrize("name", ["Unit", "UNITS", "units"])
def test_units_of_hdf5_are_found_in_any_case(tmp_path, name):
    h5py = pytest.importorskip("h5py")
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["q"] = np.arange(5.0)
        file["q"].attrs[name] = b"deg"
    assert open_source(tmp_path / "a.h5").units == {"q": "deg"}


def test_units_of_the_columns_of_one_hdf5_data_set_are_a_list(tmp_path):
    h5py = pytest.importorskip("h5py")
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["log"] = np.zeros(9, dtype=[("t", "f8"), ("u", "f4")])
        file["log"].attrs["units"] = ["ms", "mNm"]
        file["both"] = np.zeros((9, 2))
        file["both"].attrs["unit"] = np.array([b"deg", b""])
        file["odd"] = np.zeros((9, 2))
        file["odd"].attrs["unit"] = ["deg", "rad", "Nm"]  # for another number of columns: whose they are is unknown
        file["one"] = np.zeros((9, 2))
        file["one"].attrs["unit"] = "deg"  # as before, a single unit of several columns is no unit of each
    assert open_source(tmp_path / "a.h5").units == {"log.t": "ms", "log.u": "mNm", "both.0": "deg"}
