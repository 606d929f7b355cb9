"""Real rigs through the public command: what is known to be missing, what was named, and how far the gap closed.

    python -m benchmarks.real_axes --out real.csv [--only xl330] [--part first-half] [--jobs 2]

runs ``whsklearn gap`` on the records beside the checkout (``../shared/data`` or ``WHSKLEARN_DATA``; none is
shipped) and reads its ``gap.json``. ``known`` is what is physically known to be missing from the base law; a first
name that is one of it, or lists one of it as its alias, is right. Where nothing is known the row counts in no rate.
``never`` is what physics forbids, such as gravity about a vertical axis. A run is sure and wrong if its verdict is
``named`` and its first name is not a known one, or any name of it is forbidden. ``--part`` takes a part of every log,
which shows what a verdict owes to the log at hand; a part that is refused as data (shorter than 3 s, or at rest) counts
in no rate, a whole log that is refused is a miss. Seconds are of CPU, one run each; a first run on a machine compiles,
which is counted.
"""

from __future__ import annotations

import contextlib
import csv
import io
import json
import os
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import click
import numpy as np
import pandas as pd
from joblib import Parallel, delayed
from tqdm import tqdm

from whsklearn.cli.gap import main as gap

FIELDS = (
    "record known verdict names aliases right wrong closure horizon inverse_before inverse_after floor run_before "
    "run_after inertia inertia_known map seconds error"
).split()
SO101 = ("multisine", "chirp_sweep", "friction_gravity")
PARTS = {
    "whole": lambda log: log,
    "first-half": lambda log: log.iloc[: len(log) // 2],
    "second-half": lambda log: log.iloc[len(log) // 2 :],
    "every-second-row": lambda log: log.iloc[::2],
}
# Joints of the arms about which gravity is at least a fifth of the rms drive by the masses of the owners' URDF (of
# the double pendulum: by a regression on sin q and cos q). It is 1 % about joints 4 to 6 of the TX40 and 5 % about the
# AIRBOT's flange: nothing is known there. Joint 1 stands upright on both.
ARMS = {"airbot": ((2, 3, 4, 5), 6), "airbot_loaded": ((2, 3, 4, 5), 6), "tx40": ((2, 3), 6)}
TX40_COULOMB = (1, 2, 3, 4)  # published by the owners: 7.14, 8.26, 6.34 and 2.48 Nm
JOINTS = {1: "rotation", 2: "pitch", 3: "elbow", 4: "wrist pitch", 5: "wrist roll", 6: "jaw"}


class Rig(NamedTuple):
    """One run: its name, effects known to be missing, inertia if known, the command's arguments."""

    name: str
    known: tuple[str, ...]
    inertia: float | None
    arguments: list[str]
    never: tuple[str, ...] = ()


def folder() -> Path:
    """Where the records are."""
    return Path(os.environ.get("WHSKLEARN_DATA", Path(__file__).resolve().parents[2] / "shared" / "data"))


def rigs() -> Iterator[Rig]:
    """Every run of the suite."""
    data = folder()
    emps = [str(data / "emps" / "emps_train.csv"), "--drive", "force_N", "--position", "position_m"]
    yield Rig("emps, Coulomb hidden", ("coulomb",), 95.11, [*emps, "--law", "viscous"])
    yield Rig("emps", ("input_offset",), 95.11, emps)
    upright = ("gravity_imbalance",)
    for part in "ABC":
        log = [str(data / "kr300" / f"kr300_axis1_{part}.csv"), "--drive", "motor_torque_Nm"]
        log += ["--position", "motor_position_deg"]
        yield Rig(f"kr300 {part}, Coulomb hidden", ("coulomb",), None, [*log, "--law", "viscous"], upright)
        yield Rig(f"kr300 {part}", ("backlash", "flexible_coupling"), None, log, upright)
    laas = [str(data / "laas" / "compensation_off.csv"), "--drive", "current_a", "--position", "position_rad"]
    yield Rig("laas", ("cogging",), None, laas)
    for path in sorted((data / "xl330").glob("*.csv")):
        log = [str(path), "--time", "timestamp", "--drive", "load", "--position", "position"]
        yield Rig(f"xl330 {path.stem[-8:]}", ("gravity_imbalance",), None, log)
    for motion in SO101:
        for j, name in JOINTS.items():
            log = [str(data / "so101" / f"{motion}.csv.gz"), "--time", "time_s"]
            log += ["--command", f"command_{j}_rad", "--position", f"position_{j}_rad"]
            yield Rig(f"so101 {motion} {name}", ("gravity_imbalance",) if j in (2, 3, 4) else (), None, log)
    for motion in ("pd_sysid", "energy", "ddp"):
        log = [str(data / "pendulum" / f"{motion}.csv.gz"), "--drive", "torque_nm", "--position", "position_rad"]
        yield Rig(f"pendulum {motion}", ("gravity_imbalance",), None, log)
    yield from _arms(data / "arms")


def _arms(data: Path) -> Iterator[Rig]:
    """Robots, one joint at a time: the others move too, and what they do to this one is in no model here."""

    def log(arm: str, j: int) -> list[str]:
        return [str(data / f"{arm}.csv.gz"), "--drive", f"torque_{j}_nm", "--position", f"position_{j}_rad"]

    for j in (1, 2):
        yield Rig(f"double_pendulum {j}", ("gravity_imbalance",), None, log("double_pendulum", j))
    for arm, (heavy, joints) in ARMS.items():
        for j in range(1, joints + 1):
            known = ("gravity_imbalance",) if j in heavy else ()
            yield Rig(f"{arm} {j}", known, None, log(arm, j), never=("gravity_imbalance",) if j == 1 else ())
    for j in TX40_COULOMB:
        known = ("coulomb", "gravity_imbalance") if j in ARMS["tx40"][0] else ("coulomb",)  # both are missing
        never = ("gravity_imbalance",) if j == 1 else ()
        yield Rig(f"tx40 {j}, Coulomb hidden", known, None, [*log("tx40", j), "--law", "viscous"], never)


def diagnose(rig: Rig, part: str = "whole") -> dict[str, Any]:
    """One row of the table."""
    row: dict[str, Any] = {"record": rig.name, "known": "|".join(rig.known), "error": "", "inertia_known": rig.inertia}
    began = time.process_time()
    with tempfile.TemporaryDirectory() as report:
        quiet, (log, *others) = io.StringIO(), rig.arguments
        if part != "whole":
            whole, log = pd.read_csv(log), str(Path(report, "part.csv"))
            PARTS[part](whole).to_csv(log, index=False)
        try:
            with contextlib.redirect_stdout(quiet), contextlib.redirect_stderr(quiet):
                gap.main([log, *others, "--no-track", "--report", report], standalone_mode=False)
        except (Exception, SystemExit) as error:  # a benchmark counts crashes, it does not stop at one
            if isinstance(error, SystemExit) and error.code not in (0, 1, 2, 3):  # the command's own; else a signal
                raise
            row["error"] = f"{type(error).__name__}: {error}"[:100]
        row["seconds"] = round(time.process_time() - began, 1)
        file = Path(report, "gap.json")
        if not file.exists():
            return row | {"verdict": "error", "names": "", "aliases": "", "right": False, "wrong": False}
        d = json.loads(file.read_text(encoding="utf-8"))
    first = {d["effects"][0]["name"], *d["effects"][0]["aliases"]} if d["effects"] else set()
    numbers = {r["name"]: r["after"] for r in d["base"]}
    names, right = [e["name"] for e in d["effects"]], bool(first & set(rig.known))
    wrong = d["verdict"] == "named" and (bool(rig.known and not right) or not set(names).isdisjoint(rig.never))
    return row | {
        "verdict": d["verdict"], "names": "+".join(names), "right": right, "wrong": wrong,
        "aliases": "+".join(sorted({a for e in d["effects"] for a in e["aliases"]})),
        "closure": d["closure"], "horizon": d["horizon"],
        "inverse_before": d["missing"]["before"], "inverse_after": d["missing"]["after"],
        "floor": d["missing"]["floor"], "run_before": d["before"]["rmse"], "run_after": d["after"]["rmse"],
        "inertia": numbers.get("inertia", ""), "map": owners_map(d) if rig.name == "laas" else "",
    }  # fmt: skip


def owners_map(d: dict[str, Any]) -> float | str:
    """Correlation of the map over one turn with the table that the owners of LAAS measured, aligned, means removed."""
    effect = next((e for e in d["effects"] if "map" in e), None)
    if effect is None:
        return ""
    table = np.loadtxt(folder() / "laas" / "compensation_table.csv", skiprows=1)
    angle = np.arange(table.size) * 2 * np.pi / table.size
    ours = np.interp(angle, effect["map"]["angle_rad"], effect["map"]["value"], period=2 * np.pi)
    a, b = table - table.mean(), ours - ours.mean()
    shifts = np.fft.irfft(np.fft.rfft(a) * np.conj(np.fft.rfft(b)), table.size)
    return float(shifts.max() / (table.size * a.std() * b.std()))


def shown(row: dict[str, Any]) -> str:
    """A row for the terminal."""
    return "  ".join(
        f"{k} {v:.4g}" if isinstance(v, float) else f"{k} {v}" for k, v in row.items() if v not in ("", None)
    )


def summary(rows: list[dict[str, Any]], part: str) -> str:
    """Rates over the records whose physics is known, and what a run costs."""
    refused = [r["record"] for r in rows if r["verdict"] == "data_problem"]
    known = [r for r in rows if r["known"] and (part == "whole" or r["record"] not in refused)]
    right = sum(bool(r["right"]) for r in known)
    wrong = [r["record"] for r in rows if r["wrong"]]
    crashed = [r["record"] for r in rows if r["verdict"] == "error"]
    off = [r["record"] for r in rows if r["inertia_known"] and r.get("inertia") and not
           abs(float(r["inertia"]) / r["inertia_known"] - 1.0) < 0.3]  # fmt: skip
    seconds = [r["seconds"] for r in rows]
    return (
        f"right name first, with aliases: {right}/{len(known)}; sure and wrong: {', '.join(wrong) or 0}; "
        f"no verdict: {', '.join(crashed) or 0}; refused: {len(refused)}; inertia off by 30 %: {', '.join(off) or 0}\n"
        f"CPU seconds a run: median {np.median(seconds):.1f}, worst {max(seconds):.1f}"
    )


@click.command(help=__doc__)
@click.option("--out", default="real_axes.csv", type=click.Path(dir_okay=False))
@click.option("--only", default="", help="Records whose name holds this text; several joined by semicolons.")
@click.option("--part", default="whole", type=click.Choice([*PARTS]), help="What is used of every log.")
@click.option("--jobs", default=1, help="Processes.")
def main(out: str, only: str, part: str, jobs: int) -> None:
    wanted = [rig for rig in rigs() if any(text.strip() in rig.name for text in only.split(";"))]
    if not wanted:
        raise click.BadParameter(f"no record's name holds {only!r}; expected some of emps, kr300, laas, xl330, so101, "
                                 "pendulum, double_pendulum, airbot, tx40.", param_hint="--only")  # fmt: skip
    rows = []
    with open(out, "w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, FIELDS, restval="")
        writer.writeheader()
        found = Parallel(n_jobs=jobs, return_as="generator")(delayed(diagnose)(rig, part) for rig in wanted)
        for row in tqdm(found, total=len(wanted)):
            rows.append(row)
            writer.writerow(row)
            file.flush()
            tqdm.write(shown(row))
    click.echo(summary(rows, part))


if __name__ == "__main__":
    main()
