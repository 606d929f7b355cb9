"""Every format gives the same log: files are made with the libraries that people write them with."""

from __future__ import annotations

import builtins
import json

import numpy as np
import pandas as pd
import pytest

from tests.logs.rig import RATE, columns
from whsklearn.logs import LogError, load_log, open_source

TABLE = columns(400)


def same(log, atol=1e-9):
    assert np.allclose(log.X[:, 0], TABLE["torque_nm"], rtol=0, atol=atol)
    assert np.allclose(log.y, TABLE["position_rad"], rtol=0, atol=atol)
    assert log.sample_rate == pytest.approx(RATE, rel=1e-6)


def test_parquet_with_lists_and_numbers(tmp_path):
    pytest.importorskip("pyarrow")
    path = tmp_path / "axis.parquet"
    frame = pd.DataFrame(TABLE)
    frame["state"] = [[p, 2 * p] for p in TABLE["position_rad"]]
    frame.to_parquet(path)
    same(load_log(path, time="time_s", drive="torque_nm", position="position_rad"))
    same(load_log(path, time="time_s", drive="torque_nm", position="state.0"))


def test_a_wrong_ending_does_not_mislead(tmp_path):
    pytest.importorskip("pyarrow")
    pd.DataFrame(TABLE).to_parquet(tmp_path / "axis.csv")
    same(load_log(tmp_path / "axis.csv", time="time_s", drive="torque_nm", position="position_rad"))
    (tmp_path / "axis.tdms").write_text("time,u\n")
    with pytest.raises(LogError, match="is no tdms file"):
        open_source(tmp_path / "axis.tdms")


def test_matlab_vectors_structures_and_matrices(tmp_path):
    from scipy.io import savemat

    path = tmp_path / "axis.mat"
    savemat(path, {"log": {"t": TABLE["time_s"], "tau": TABLE["torque_nm"]}, "data": np.c_[*TABLE.values()]})
    same(load_log(path, time="log.t", drive="log.tau", position="data.2"))


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
    with pytest.raises(LogError, match="no whole NumPy file"):
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
    assert any("brought to the stamps" in n for n in slow.notes)


def test_mcap_with_json_joint_states(tmp_path):
    writer_module = pytest.importorskip("mcap.writer")
    path = tmp_path / "axis.mcap"
    with path.open("wb") as stream:
        writer = writer_module.Writer(stream)
        writer.start()
        schema = writer.register_schema("JointState", "jsonschema", b"{}")
        channel = writer.register_channel("/joint_states", "json", schema)
        for t, u, y in zip(*TABLE.values(), strict=True):
            message = {"name": ["base", "elbow"], "position": [0.0, y], "effort": [0.0, u]}
            at = int(1.7e18) + round(t * 1e9)
            writer.add_message(channel, at, json.dumps(message).encode(), at)
        writer.finish()
    log = load_log(path, drive="/joint_states.effort.elbow", position="/joint_states.position.elbow")
    same(log)


def test_ros_bags_of_both_generations(tmp_path):
    rosbags = pytest.importorskip("rosbags")
    del rosbags
    from rosbags.rosbag1 import Writer as Writer1
    from rosbags.rosbag2 import Writer as Writer2
    from rosbags.typesys import Stores, get_typestore

    for store, writer, path in (
        (get_typestore(Stores.ROS1_NOETIC), lambda p: Writer1(p), tmp_path / "axis.bag"),
        (get_typestore(Stores.LATEST), lambda p: Writer2(p, version=9), tmp_path / "folder"),
    ):
        names = ("sensor_msgs/msg/JointState", "std_msgs/msg/Header", "builtin_interfaces/msg/Time")
        state, header, stamp = (store.types[n] for n in names)
        with writer(path) as bag:
            connection = bag.add_connection("/joints", state.__msgtype__, typestore=store)
            for i, (t, u, y) in enumerate(zip(*TABLE.values(), strict=True)):
                nanoseconds = round(t * 1e9)
                time = stamp(sec=1_700_000_000 + nanoseconds // 10**9, nanosec=nanoseconds % 10**9)
                extra = {"seq": i} if path.suffix == ".bag" else {}
                message = state(
                    header=header(stamp=time, frame_id="", **extra), name=["elbow"], position=np.array([y]),
                    velocity=np.zeros(0), effort=np.array([u]),
                )  # fmt: skip
                serialise = store.serialize_ros1 if path.suffix == ".bag" else store.serialize_cdr
                bag.write(connection, 1_700_000_000 * 10**9 + nanoseconds + 500, serialise(message, state.__msgtype__))
        same(load_log(path, drive="/joints.effort.elbow", position="/joints.position.elbow"))


def test_a_lerobot_folder_is_one_segment_an_episode(tmp_path):
    pytest.importorskip("pyarrow")
    folder = tmp_path / "so101"
    (folder / "meta").mkdir(parents=True)
    (folder / "data" / "chunk-000").mkdir(parents=True)
    names = ["shoulder_pan.pos", "gripper.pos"]
    info = {"fps": 30, "features": {"action": {"names": names}, "observation.state": {"names": {"motors": names}}}}
    (folder / "meta" / "info.json").write_text(json.dumps(info))
    for episode in range(2):
        t = np.arange(90) / 30
        frame = pd.DataFrame({"timestamp": t, "episode_index": episode})
        frame["action"] = [[np.sin(x), 0.0] for x in t]
        frame["observation.state"] = [[np.sin(x - 0.1), 1.0] for x in t]
        frame.to_parquet(folder / "data" / "chunk-000" / f"episode_{episode:06d}.parquet")
    with pytest.warns(UserWarning, match="time falls back"):
        log = load_log(
            folder, time="timestamp", command="action.shoulder_pan.pos", position="observation.state.shoulder_pan.pos"
        )
    assert np.bincount(log.groups).tolist() == [90, 90]
    assert log.sample_rate == pytest.approx(30)
    assert np.allclose(log.command[:90], np.sin(np.arange(90) / 30))


@pytest.mark.parametrize(
    ("magic", "package"),
    [(b"PAR1", "pyarrow"), (b"\x89HDF\r\n", "h5py"), (b"TDSm", "nptdms"), (b"MDF     4.10", "asammdf"),
     (b"\x89MCAP0", "mcap"), (b"#ROSBAG V2.0", "rosbags")],
)  # fmt: skip
def test_an_absent_extra_is_one_sentence_with_the_line_that_installs_it(tmp_path, monkeypatch, magic, package):
    path = tmp_path / "log.bin"
    path.write_bytes(magic + bytes(64))
    real = builtins.__import__

    def without(name, *rest, **options):
        if name.split(".")[0] == package:
            raise ImportError(name)
        return real(name, *rest, **options)

    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(ImportError, match=r"pip install 'whsklearn\["):
        open_source(path)


@pytest.mark.parametrize("magic", [b"PAR1", b"\x89HDF\r\n", b"TDSm", b"MDF     4.10", b"\x89MCAP0", b"#ROSBAG V2.0"])
def test_a_damaged_file_is_one_sentence(tmp_path, magic):
    path = tmp_path / "log.bin"
    path.write_bytes(magic + bytes(range(200)))
    try:
        with pytest.raises(LogError, match=r"no whole|holds no channel"):
            open_source(path)
    except ImportError as error:
        pytest.skip(str(error))


def test_folders_sheets_and_files_that_are_not_there(tmp_path):
    with pytest.raises(LogError, match="is a folder"):
        open_source(tmp_path)
    (tmp_path / "log.xlsx").write_bytes(b"PK\x03\x04")
    with pytest.raises(LogError, match="spreadsheet"):
        open_source(tmp_path / "log.xlsx")
    with pytest.raises(FileNotFoundError, match="no file"):
        open_source(tmp_path / "nowhere.csv")
