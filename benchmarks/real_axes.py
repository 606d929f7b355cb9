"""Real rigs through the public command: what is known to be missing, what was named, and how far the gap closed.

    python -m benchmarks.real_axes --out real.csv [--only xl330]

runs ``whsklearn gap`` on the records beside the checkout (``../shared/data`` or ``WHSKLEARN_DATA``; none is
shipped) and reads its ``gap.json``. ``known`` is what is physically known to be missing from the base law; a first
name that is one of it, or lists one of it as its alias, is right, and so is a verdict that names nothing where
nothing is known (those rows count in neither rate, but a sure name on them is looked at).
"""

from __future__ import annotations

import csv
import json
import os
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import click
import numpy as np

from whsklearn.cli.gap import main as gap

FIELDS = (
    "record known verdict names right closure horizon inverse_before inverse_after floor run_before run_after "
    "inertia inertia_known map seconds error"
).split()
SO101 = ("multisine", "chirp_sweep", "friction_gravity")
JOINTS = {1: "rotation", 2: "pitch", 3: "elbow", 4: "wrist pitch", 5: "wrist roll", 6: "jaw"}


class Rig(NamedTuple):
    """One run: its name, effects known to be missing, inertia if known, the command's arguments."""

    name: str
    known: tuple[str, ...]
    inertia: float | None
    arguments: list[str]


def folder() -> Path:
    """Where the records are."""
    return Path(os.environ.get("WHSKLEARN_DATA", Path(__file__).resolve().parents[2] / "shared" / "data"))


def rigs() -> Iterator[Rig]:
    """Every run of the suite."""
    data = folder()
    emps = [str(data / "emps" / "emps_train.csv"), "--drive", "force_N", "--position", "position_m"]
    yield Rig("emps, Coulomb hidden", ("coulomb",), 95.11, [*emps, "--law", "viscous"])
    yield Rig("emps", ("input_offset",), 95.11, emps)
    for part in "ABC":
        log = [str(data / "kr300" / f"kr300_axis1_{part}.csv"), "--drive", "motor_torque_Nm"]
        log += ["--position", "motor_position_deg"]
        yield Rig(f"kr300 {part}, Coulomb hidden", ("coulomb",), None, [*log, "--law", "viscous"])
        yield Rig(f"kr300 {part}", ("backlash", "flexible_coupling"), None, log)
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


def diagnose(rig: Rig) -> dict[str, Any]:
    """One row of the table."""
    row: dict[str, Any] = {"record": rig.name, "known": "|".join(rig.known), "error": "", "inertia_known": rig.inertia}
    began = time.process_time()
    with tempfile.TemporaryDirectory() as report:
        try:
            gap.main([*rig.arguments, "--no-track", "--report", report], standalone_mode=False)
        except (ValueError, ArithmeticError, click.ClickException, SystemExit) as error:
            row["error"] = str(error)[:100]
        row["seconds"] = round(time.process_time() - began, 1)
        file = Path(report, "gap.json")
        if not file.exists():
            return row | {"verdict": "error", "names": "", "right": False}
        d = json.loads(file.read_text(encoding="utf-8"))
    first = {d["effects"][0]["name"], *d["effects"][0]["aliases"]} if d["effects"] else set()
    numbers = {r["name"]: r["after"] for r in d["base"]}
    return row | {
        "verdict": d["verdict"], "names": "+".join(e["name"] for e in d["effects"]),
        "right": bool(first & set(rig.known)), "closure": d["closure"], "horizon": d["horizon"],
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


def summary(rows: list[dict[str, Any]]) -> str:
    """Rates over the records whose physics is known."""
    known = [r for r in rows if r["known"]]
    right = sum(bool(r["right"]) for r in known)
    wrong = [r["record"] for r in known if r["verdict"] == "named" and not r["right"]]
    crashed = [r["record"] for r in rows if r["verdict"] == "error"]
    off = [r["record"] for r in rows if r["inertia_known"] and r.get("inertia") and not
           abs(float(r["inertia"]) / r["inertia_known"] - 1.0) < 0.3]  # fmt: skip
    slow = max(r["seconds"] for r in rows)
    return (
        f"right name first {right}/{len(known)}; sure and wrong {wrong or 0}; no verdict {crashed or 0}; "
        f"inertia off by 30 % {off or 0}; longest {slow:.0f} s of CPU"
    )


@click.command(help=__doc__)
@click.option("--out", default="real_axes.csv", type=click.Path(dir_okay=False))
@click.option("--only", default="", help="Records whose name holds this text.")
def main(out: str, only: str) -> None:
    rows = []
    with open(out, "w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, FIELDS, restval="")
        writer.writeheader()
        for rig in rigs():
            if only in rig.name:
                rows.append(diagnose(rig))
                writer.writerow(rows[-1])
                file.flush()
                click.echo(shown(rows[-1]))
    click.echo(summary(rows))


if __name__ == "__main__":
    main()
