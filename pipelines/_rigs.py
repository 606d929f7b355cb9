"""Records of turntables for the W-H reading: the simulated rig, measured axes, a user's log."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from whsklearn.cli.comparison import ComparedRecord
from whsklearn.cli.job import root
from whsklearn.cli.records import longest, read
from whsklearn.datasets import fetch_emps, fetch_kr300, load_turntable

RATE = 100.0  # Hz; the rig of section 5.2 is logged at this rate, faster logs are brought down to it


@dataclass(frozen=True)
class Task:
    """One input and one output of a rig: what to learn from, what to judge by, from which sample on."""

    title: str
    train: ComparedRecord
    test: list[ComparedRecord]
    skip: int
    output: str


def data_folder(given: str | None) -> str | None:
    """Where measured records are: the option, ``WHSKLEARN_DATA``, or a folder beside the checkout."""
    beside = root().parent / "shared" / "data"
    return given or os.environ.get("WHSKLEARN_DATA") or (str(beside) if beside.is_dir() else None)


def tasks_of(options: dict[str, Any]) -> list[Task]:
    """Reference to position, and drive to velocity, of the rig that the options name."""
    if options["log_file"]:
        return _of_log(options)
    if options["rig"] == "simulated":
        frame = load_turntable(options["experiment"])
        assert isinstance(frame, pd.DataFrame)
        name = f"rig-{options['experiment']}"
        position = frame["position_rad"].to_numpy()
        return _split(name, frame["reference_rad"], frame["torque_nm"], position, _velocity(position, RATE), "rad")
    folder = data_folder(options["data"])
    if options["rig"] == "emps":
        emps = fetch_emps(folder, download=False)
        parts = {k: _slower(emps[k], emps.sample_rate) for k in ("train", "test")}
        columns: tuple[str, str, str, str | None] = ("reference_m", "position_m", "drive_V", None)
    else:
        robot = fetch_kr300(folder, download=False)
        parts = {k: _slower(robot[k], robot.sample_rate) for k in ("A", "B", "C")}
        columns = "reference_deg", "load_position_deg", "motor_torque_Nm", "load_velocity_deg_s"
    return _of_parts(options["rig"], parts, columns)


def _of_parts(rig: str, parts: dict[str, pd.DataFrame], columns: tuple[str, str, str, str | None]) -> list[Task]:
    """Learn from the first record, judge by the others."""
    reference, position, drive, velocity = columns
    unit = position.rsplit("_", 1)[-1]
    tasks = []
    for title, source, target in (
        ("reference to position", reference, position),
        ("drive to velocity", drive, velocity),
    ):
        records = []
        for name, frame in parts.items():
            moved = frame[position].to_numpy()
            y = frame[target].to_numpy() if target else _velocity(moved, RATE)
            records.append(ComparedRecord(f"{rig}-{name}", frame[[source]].to_numpy(), y))
        label = f"position in {unit}" if target == position else f"velocity in {unit}/s"
        tasks.append(Task(title, records[0], records[1:], int(RATE / 2), label))
    return tasks


def _of_log(options: dict[str, Any]) -> list[Task]:
    """The columns that the user names; a task for each pair that is there."""
    needed = {"--time": options["time_column"], "--position": options["position"]}
    missing = [k for k, v in needed.items() if not v]
    if missing or not (options["reference"] or options["drive"]):
        raise ValueError("--log needs --time and --position, and --reference or --drive or both: the log's columns.")
    source = options["drive"] or options["reference"]
    log = read(
        options["log_file"],
        options,
        time=options["time_column"],
        drive=source,
        position=options["position"],
        reference=options["reference"],
    )
    log = longest(log)
    name, position = Path(options["log_file"]).stem, log.y
    reference = log.reference if options["reference"] else None
    drive = log.X[:, 0] if options["drive"] else None
    return _split(name, reference, drive, position, _velocity(position, log.sample_rate), log.units.get("position", ""))


def _split(name: str, reference: Any, drive: Any, position: Any, velocity: Any, unit: str) -> list[Task]:
    """Learn from the first 70 %, judge by the rest of the same run."""
    tasks = []
    for title, u, y, label in (
        ("reference to position", reference, position, f"position in {unit}"),
        ("drive to velocity", drive, velocity, f"velocity in {unit}/s"),
    ):
        if u is not None:
            X, y = np.asarray(u, dtype=float)[:, None], np.asarray(y, dtype=float)
            cut = int(0.7 * y.size)
            tasks.append(
                Task(
                    title,
                    ComparedRecord(name, X[:cut], y[:cut]),
                    [ComparedRecord(f"{name}, last 30 %", X, y)],
                    cut,
                    label,
                )
            )
    return tasks


def _velocity(position: NDArray[np.float64], rate: float) -> NDArray[np.float64]:
    """Central differences."""
    return np.gradient(np.asarray(position, dtype=float)) * rate


def _slower(frame: pd.DataFrame, rate: float) -> pd.DataFrame:
    """Means over as many samples as bring the log nearest to `RATE`."""
    k = max(1, round(rate / RATE))
    n = len(frame) // k * k
    values = frame.to_numpy(dtype=float)[:n].reshape(-1, k, frame.shape[1]).mean(axis=1)
    return pd.DataFrame(values, columns=frame.columns)
