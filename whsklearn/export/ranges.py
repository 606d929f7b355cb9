"""Ranges for domain randomisation: the spread of the numbers of a MuJoCo joint over several units of one kind."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

from whsklearn.logs.files import atomic_write

# MuJoCo's names of the numbers of an axis; none of them can be negative.
HELD = {"inertia": "inertia", "viscous": "damping", "coulomb": "frictionloss", "cable_spring": "stiffness"}
DEVIATIONS = 2.0  # in each direction: 95 % of the population of units


def ranges_of(comparison: dict[str, Any]) -> dict[str, dict[str, Any]]:
    """MuJoCo's name of a number -> its range over units, in SI.

    The range is the mean plus or minus two standard deviations; the variance is that between records beyond that within
    them, plus the uncertainty of the mean.

    ``comparison``: ``compare.json``. Raises ValueError if it does not contain numbers of several records.
    """
    rows = comparison.get("numbers") or []
    if not rows or len(rows[0]["values"]) < 2:
        raise ValueError("The comparison holds no numbers of several records; give the compare.json of `compare`.")
    out = {}
    for row in rows:
        if row["name"] in HELD:
            n, si = len(row["values"]), float(row["to_si"])
            apart = DEVIATIONS * (row["spread_between"] ** 2 + row["spread_within"] ** 2 / n) ** 0.5
            low, high = ((row["mean"] + sign * apart) * si for sign in (-1.0, 1.0))
            out[HELD[row["name"]]] = {
                "of": row["name"], "mean": row["mean"] * si, "low": max(low, 0.0), "high": high, "records": n,
            }  # fmt: skip
    return out


def write_ranges(comparison: str | os.PathLike[str], model: Path) -> Path:
    """Write the ranges of a ``compare.json`` beside a model's file; return their path."""
    data = json.loads(Path(comparison).read_text(encoding="utf-8"))
    path = model.with_suffix(".ranges.json")
    atomic_write(path, (json.dumps(ranges_of(data), indent=2) + "\n").encode())
    return path
