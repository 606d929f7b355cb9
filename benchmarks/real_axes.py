"""Real rigs through the public finder: what is known to be missing, what was named, and how far the gap closed.

    python -m benchmarks.real_axes --out real.csv [--only xl330]

reads the records beside the checkout (``../shared/data`` or ``WHSKLEARN_DATA``; the project ships none of them).
"""

from __future__ import annotations

import csv
import os
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import click
import numpy as np
import pandas as pd

from whsklearn.gap import GapFinder

FIELDS = (
    "record known verdict names right closure inverse_before inverse_after run_before run_after inertia seconds error"
).split()
SILENT = ("no_gap", "unknown", "coloured_noise", "not_testable", "data_problem")


def folder() -> Path:
    """Where the records are."""
    return Path(os.environ.get("WHSKLEARN_DATA", Path(__file__).resolve().parents[2] / "shared" / "data"))


def even(time_s: np.ndarray, dt: float, *signals: np.ndarray) -> list[np.ndarray]:
    """Time and signals on an even grid."""
    grid = np.arange(time_s[0], time_s[-1], dt)
    return [grid - grid[0], *(np.interp(grid, time_s, x) for x in signals)]


def records() -> Iterator[tuple[str, tuple[str, ...], str, dict[str, Any], pd.DataFrame]]:
    """(name, effects known to be missing, law of the base model, columns, log)."""
    data = folder()
    emps = pd.read_csv(data / "emps" / "emps_train.csv")
    frame = pd.DataFrame({"time_s": emps.time_s, "force_n": emps.force_N, "position_m": emps.position_m})
    columns = {"time": "time_s", "drive": "force_n", "position": "position_m"}
    yield "emps, Coulomb hidden", ("coulomb",), "viscous", columns, frame
    yield "emps", ("input_offset",), "viscous,coulomb", columns, frame
    columns = {"time": "time_s", "drive": "drive_v", "position": "position_rad"}
    for path in sorted((data / "xl330").glob("*.csv")):
        log = pd.read_csv(path)
        load = log["load"].to_numpy(dtype=float)
        load = np.where(load > 32767, load - 65536, load)  # 16 bits, wrapped in some logs
        t, u, q = even(log.timestamp.to_numpy(), float(np.median(np.diff(log.timestamp))),
                       load * log.input_volts.to_numpy() / 885, log.position.to_numpy())  # fmt: skip
        frame = pd.DataFrame({"time_s": t, "drive_v": u, "position_rad": q})
        yield f"xl330 {path.stem[-8:]}", ("gravity_imbalance",), "viscous,coulomb", columns, frame
    log = pd.read_csv(data / "laas" / "compensation_off.csv")
    t, u, q = even(log.time_s.to_numpy(), 1e-3, log.current_a.to_numpy(), log.position_rad.to_numpy())
    frame = pd.DataFrame({"time_s": t, "current_a": u, "position_rad": q})
    columns = {"time": "time_s", "drive": "current_a", "position": "position_rad"}
    yield "laas", ("cogging",), "viscous,coulomb", columns, frame


def diagnose(name: str, known: tuple[str, ...], law: str, columns: dict[str, Any], log: pd.DataFrame) -> dict[str, Any]:
    """One row of the table."""
    began = time.process_time()
    row: dict[str, Any] = {"record": name, "known": "+".join(known), "error": ""}
    try:
        finder = GapFinder("servo", law=law).fit(log, **columns)
    except (ValueError, ArithmeticError) as error:
        return row | {"verdict": "error", "error": str(error)[:80], "right": False}
    d = finder.diagnosis_
    names = [e.name for e in d.effects]
    first = {names[0], *d.effects[0].aliases} if names else set()
    row |= {"verdict": d.verdict, "names": "+".join(names), "closure": round(d.closure, 3)}
    row |= {"right": bool(first & set(known)), "run_before": d.before["rmse"], "run_after": d.after["rmse"]}
    if d.base_parameters:
        row["inertia"] = d.base_parameters[0]["after"]
    before, after, _ = d.figures
    return row | {"inverse_before": round(before, 4), "inverse_after": round(after, 4),
                  "seconds": round(time.process_time() - began, 1)}  # fmt: skip


@click.command(help=__doc__)
@click.option("--out", default="real_axes.csv", type=click.Path(dir_okay=False))
@click.option("--only", default="", help="Records whose name holds this text.")
def main(out: str, only: str) -> None:
    rows = []
    with open(out, "w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, FIELDS, restval="")
        writer.writeheader()
        for record in records():
            if only in record[0]:
                rows.append(diagnose(*record))
                writer.writerow(rows[-1])
                file.flush()
                click.echo(
                    "  ".join(f"{k} {v:.4g}" if isinstance(v, float) else f"{k} {v}" for k, v in rows[-1].items())
                )
    right = sum(bool(r["right"]) for r in rows)
    wrong = sum(r["verdict"] == "named" and not r["right"] for r in rows)
    click.echo(f"right name first {right}/{len(rows)}, confidently wrong {wrong}")


if __name__ == "__main__":
    main()
