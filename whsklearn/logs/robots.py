"""Logs of robots: MCAP, ROS bags, LeRobot data sets.

A column is a number in a message, by its topic and path: ``/joint_states.position.elbow`` if the message names its
joints, ``/joint_states.position.0`` otherwise. Its stamps are those of the message (``header.stamp``) if it has any,
otherwise those of the recorder.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from whsklearn.logs.binary import open_parquet
from whsklearn.logs.errors import LogError, damaged
from whsklearn.logs.source import Column, Source

_PEEK = 20  # messages of a topic from which its columns are determined
_DEEPEST = 6

Message = tuple[str, int, Any]  # topic, recorder's stamp in ns, decoded message


def open_mcap(path: Path) -> Source:
    """An MCAP file with JSON or ROS 2 messages."""
    from mcap.exceptions import McapError
    from mcap.reader import make_reader

    def messages() -> Iterator[Message]:
        ros2 = cache(_ros2_decoders)  # of this file: they know its schemas by number
        with path.open("rb") as file:
            for schema, channel, message in make_reader(file).iter_messages():
                yield channel.topic, message.log_time, _decoded(schema, channel.message_encoding, message.data, ros2)

    return _of_messages(path, messages, McapError, OSError, ValueError, KeyError, EOFError, struct.error)


def _ros2_decoders() -> Any:
    from mcap_ros2.decoder import DecoderFactory

    return DecoderFactory()


def _decoded(schema: Any, encoding: str, data: bytes, ros2: Callable[[], Any]) -> Any:
    """The content of a message; None for an unsupported encoding."""
    if encoding == "json":
        try:
            return json.loads(data)
        except RecursionError:
            raise ValueError("a JSON message is nested too deeply") from None
    decoder = ros2().decoder_for(encoding, schema) if encoding == "cdr" else None
    return decoder(data) if decoder is not None else None


def open_bag(path: Path) -> Source:
    """A ROS 1 bag, or the folder of a ROS 2 bag."""
    from rosbags.highlevel import AnyReader, AnyReaderError
    from rosbags.typesys import Stores, get_typestore

    def messages() -> Iterator[Message]:
        with AnyReader([path], default_typestore=get_typestore(Stores.LATEST)) as reader:
            for connection, stamp, raw in reader.messages():
                yield connection.topic, stamp, reader.deserialize(raw, connection.msgtype)

    return _of_messages(path, messages, AnyReaderError, OSError, ValueError, KeyError, struct.error)


def _of_messages(path: Path, messages: Callable[[], Iterable[Message]], *failures: type[BaseException]) -> Source:
    """A source of the numbers in messages; the file is read once for names and once for values."""
    names: dict[str, None] = {}
    seen: dict[str, int] = {}
    with damaged(path, "recording", *failures):
        for topic, _, content in messages():
            seen[topic] = seen.get(topic, 0) + 1
            if seen[topic] <= _PEEK:
                names.update(dict.fromkeys(f"{topic}.{k}" for k in numbers_of(content)))
    if not names:
        raise LogError(
            f"{path.name} holds no message with numbers that can be read; record joint states, or export CSV."
        )

    def fetch(wanted: Sequence[str]) -> dict[str, Column]:
        topics = {t for t in seen if any(w.startswith(f"{t}.") for w in wanted)}
        values: dict[str, list[float]] = {w: [] for w in wanted}
        stamps: dict[str, list[int]] = {w: [] for w in wanted}
        for topic, recorded, content in messages():
            if topic not in topics:
                continue
            flat, at = numbers_of(content), _stamp_of(content) or recorded
            for w in wanted:
                key = w.removeprefix(f"{topic}.")
                if key != w and key in flat:
                    values[w].append(flat[key])
                    stamps[w].append(at)
        first = min((s[0] for s in stamps.values() if s), default=0)  # a double resolves ns since 1970 to 256 ns
        return {
            w: Column(
                np.array(values[w]), np.float64(1e-9) * (np.array(stamps[w], dtype=np.int64) - first).astype(np.float64)
            )
            for w in wanted
        }

    return Source(path.name, list(names), fetch)


def _stamp_of(message: Any) -> int | None:
    """The stamp in a message's header in ns; None if there is none, or if the header was left at zero."""
    header = (_fields(message) or {}).get("header")
    stamp = _fields((_fields(header) or {}).get("stamp")) if header is not None else None
    parts = _seconds(stamp) if stamp else None
    return parts[0] * 10**9 + parts[1] if parts and parts[0] else None


def _seconds(fields: dict[str, Any]) -> tuple[int, int] | None:
    """Seconds and nanoseconds of a stamp, under the names that ROS 1, ROS 2 and JSON give them."""
    whole = fields.get("sec", fields.get("secs"))
    rest = fields.get("nanosec", fields.get("nsec", fields.get("nsecs")))
    return None if whole is None or rest is None else (int(whole), int(rest))


def numbers_of(message: Any) -> dict[str, float]:
    """The numbers in a message by their paths; lists of joints by the joints' names.

    >>> numbers_of({"name": ["elbow"], "position": [0.5], "header": {"stamp": {"sec": 2, "nanosec": 500000000}}})
    {'position.elbow': 0.5, 'header.stamp': 2.5}
    """
    return dict(_numbers("", message, 0))


def _fields(message: Any) -> dict[str, Any] | None:
    """The fields of a message, whatever library decoded it."""
    if isinstance(message, dict):
        return message
    names = getattr(message, "__slots__", None) or list(getattr(message, "__dict__", {}))
    names = [n for n in names if not n.startswith("_")] or list(getattr(message, "__dataclass_fields__", {}))
    return {n: getattr(message, n) for n in names if hasattr(message, n)} if names else None


def _numbers(path: str, value: Any, depth: int) -> Iterator[tuple[str, float]]:
    if isinstance(value, bool | int | float | np.number):
        yield path, float(value)
    elif depth > _DEEPEST or isinstance(value, str | bytes) or value is None:
        return
    elif isinstance(value, Sequence | np.ndarray):
        for i, item in enumerate(value[:64]):
            yield from _numbers(_below(path, i), item, depth + 1)
    elif fields := _fields(value):
        if (stamp := _seconds(fields)) is not None:
            yield path, stamp[0] + 1e-9 * stamp[1]
            return
        joints = fields.get("name", fields.get("joint_names"))
        joints = list(joints) if isinstance(joints, Sequence | np.ndarray) and not isinstance(joints, str) else []
        for name, item in fields.items():
            if joints and isinstance(item, Sequence | np.ndarray) and len(item) == len(joints):
                for joint, number in zip(joints, item, strict=True):
                    yield from _numbers(f"{_below(path, name)}.{joint}", number, depth + 1)
            elif not name.startswith("_"):
                yield from _numbers(_below(path, name), item, depth + 1)


def _below(path: str, name: Any) -> str:
    return f"{path}.{name}" if path else str(name)


def open_lerobot(path: Path) -> Source:
    """A LeRobot data set: the folder with ``meta/info.json`` and the episodes in ``data/``.

    Columns are ``action.NAME`` and ``observation.state.NAME`` with the names of the motors; each episode restarts the
    clock, which the reader treats as a new experiment.
    """
    description = path / "meta" / "info.json"
    with damaged(description, "LeRobot description", OSError, ValueError, RecursionError):
        info = json.loads(description.read_text(encoding="utf-8"))
    files = sorted((path / "data").rglob("*.parquet"))
    if not files:
        raise LogError(f"{path.name} holds no episode in data/; download the data set again, with its Parquet files.")
    first = open_parquet(files[0])
    named = {}
    for name in first.names:
        stem, _, number = name.rpartition(".")
        motors = _motor_names(info.get("features", {}).get(stem, {}))
        shown = f"{stem}.{motors[int(number)]}" if number.isdigit() and int(number) < len(motors) else name
        named[shown] = name

    def fetch(wanted: Sequence[str]) -> dict[str, Column]:
        parts = [open_parquet(f).fetch([named[w] for w in wanted]) for f in files]
        return {w: Column(np.concatenate([p[named[w]].values for p in parts])) for w in wanted}

    return Source(path.name, list(named), fetch, notes=[f"{len(files)} files of a LeRobot data set were joined."])


def _motor_names(feature: dict[str, Any]) -> list[str]:
    """The names of a feature's elements, in either of the two forms that LeRobot writes."""
    names = feature.get("names") or []
    if isinstance(names, dict):
        names = next(iter(names.values()), [])
    return [str(n) for n in names] if isinstance(names, list) else []
