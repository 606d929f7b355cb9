"""MCAP, ROS bags and LeRobot folders, made with the libraries that people write them with."""

from __future__ import annotations

import json

import numpy as np
import pandas as pd
import pytest

from tests.logs.rig import TABLE, same
from whsklearn.logs import LogError, load_log


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
        frame["action"] = [[np.sin((1 + episode) * x), 0.0] for x in t]
        frame["observation.state"] = [[np.sin(x - 0.1), 1.0] for x in t]
        frame.to_parquet(folder / "data" / "chunk-000" / f"episode_{episode:06d}.parquet")
    with pytest.warns(UserWarning, match="time jumps back"):
        log = load_log(
            folder, time="timestamp", command="action.shoulder_pan.pos", position="observation.state.shoulder_pan.pos"
        )
    assert np.bincount(log.groups).tolist() == [90, 90]
    assert log.sample_rate == pytest.approx(30)
    assert np.allclose(log.command[:90], np.sin(np.arange(90) / 30))


def test_a_message_nested_without_end_is_a_damaged_recording(tmp_path):
    writer_module = pytest.importorskip("mcap.writer")
    with (tmp_path / "axis.mcap").open("wb") as stream:
        writer = writer_module.Writer(stream)
        writer.start()
        channel = writer.register_channel("/deep", "json", writer.register_schema("Deep", "jsonschema", b"{}"))
        writer.add_message(channel, 1, b"[" * 100_000 + b"]" * 100_000, 1)
        writer.finish()
    with pytest.raises(LogError, match="nested too deeply"):
        load_log(tmp_path / "axis.mcap", drive="a", position="b")
