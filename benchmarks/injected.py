"""A known effect added to real logs: is it found among what each rig lacks by itself?

    python -m benchmarks.injected --size 0.3 --seed 0 [--only tx40] [--effects cogging,stribeck] [--out rows.csv]

An axis with one more force f that moves as it was logged needs the drive u + f.  So a record of a real rig, with its
own noise, motion and friction, becomes the exact record of the same rig with the effect; a delay shifts the drive, a
change of gain scales its end.  The size is the rms of f as a share of the rms drive; places, orders and phases are
drawn.  ``found``: a name of the diagnosis, or an alias of one, is the effect's.  ``first``: it is the first of them,
which only a size above what the rig lacks by itself (`benchmarks.real_axes`) can reach.  ``by itself`` marks rigs in
whose own log the same name is found: they show nothing.  ``wrong``: the verdict is ``named`` without it.
"""

from __future__ import annotations

import csv
import tempfile
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import click
import numpy as np
import pandas as pd
from joblib import Parallel, delayed
from scipy.ndimage import gaussian_filter1d
from tqdm import tqdm

from benchmarks.blind import wilson
from benchmarks.real_axes import Rig, diagnose, rigs
from whsklearn.effects.base import rms

Array = Any
FIELDS = "record effect verdict names aliases found first wrong itself share seconds error".split()
RIGS = (
    "emps", "kr300 A", "kr300 C", "laas", "xl330 10h28m42", "xl330 10h29m29", "so101 multisine rotation",
    "pendulum pd_sysid", "double_pendulum 2", "airbot 1", "airbot 5", "airbot_loaded 6", "tx40 1", "tx40 4", "tx40 6",
)  # fmt: skip
# Of the rms speed, below which an axis rests, and the largest share of the time that it may rest for a Stribeck curve:
# at rest the sign of v is noise, and the axis would have broken away later than it did.
REST, RESTING = 0.02, 0.05
TRAVEL = 0.8  # rad, below which a pendulum's torque is a straight line of the position


class Log:
    """Columns of one rig's log: drive u, position q (rad where it turns, m where not), speed v and time t."""

    def __init__(self, rig: Rig):
        given = dict(zip(rig.arguments[1::2], rig.arguments[2::2], strict=True))
        self.frame = pd.read_csv(rig.arguments[0])
        self.column = given.get("--drive") or given["--command"]
        clock = given.get("--time") or next(c for c in self.frame if c.lower().startswith("t"))
        self.turns = not given["--position"].endswith("_m")
        q = self.frame[given["--position"]].to_numpy(float)
        self.q = np.deg2rad(q) if given["--position"].endswith("_deg") else q
        self.t = self.frame[clock].to_numpy(float)
        dt = float(np.median(np.diff(self.t)))
        self.v = gaussian_filter1d(self.q, 0.02 / dt if dt < 0.01 else 1.0, order=1) / dt
        self.rests = float(np.mean(np.abs(self.v) < REST * rms(self.v)))
        u = self.frame[self.column].to_numpy(float)
        self.u = np.where(u > 32767.0, u - 65536.0, u)  # 16 bits that a servo wraps (XL330)
        self.sign = self.u if "--drive" in given else self.u - q
        self.dt = dt


def _cogging(log: Log, rng: np.random.Generator) -> Array:
    travel = float(np.ptp(log.q))
    order = rng.uniform(5.0, 9.0) * 2.0 * np.pi / travel
    order = round(order) if log.turns else order
    return np.sin(order * log.q + rng.uniform(0.0, 2.0 * np.pi))


EFFECTS: dict[str, Callable[[Log, np.random.Generator], Array]] = {
    "gravity_imbalance": lambda log, rng: np.sin(log.q + rng.uniform(0.0, 2.0 * np.pi)),
    "cogging": _cogging,
    "cable_spring": lambda log, rng: log.q - np.mean(log.q),
    "input_offset": lambda log, rng: np.full(log.q.size, rng.choice([-1.0, 1.0])),
    "stribeck": lambda log, rng: np.sign(log.v) * np.exp(-((log.v / (0.25 * rms(log.v))) ** 2)),
    "quadratic_drag": lambda log, rng: log.v * np.abs(log.v),
    "disturbance_tone": lambda log, rng: np.sin(2.0 * np.pi * rng.uniform(1.3, 4.0) * log.t + rng.uniform(0.0, 6.0)),
}  # fmt: skip


def changed(log: Log, effect: str, size: float, rng: np.random.Generator) -> Array:
    """The drive column of the rig with the effect, shape (n,)."""
    if effect == "parameter_change":
        return np.where(log.t - log.t[0] > rng.uniform(0.4, 0.7) * np.ptp(log.t), (1.0 + size) * log.u, log.u)
    if effect == "input_delay":
        k = max(2, round(size * 0.05 / log.dt))
        return np.append(log.u[k:], np.full(k, log.u[-1]))
    f = EFFECTS[effect](log, rng)
    return log.u + size * rms(log.sign) / rms(f) * f


def one(rig: Rig, effect: str, size: float, seed: int) -> dict[str, Any]:
    """One row of the table; an empty effect is the log as it is."""
    log = Log(rig)
    if effect == "gravity_imbalance" and (not log.turns or np.ptp(log.q) < TRAVEL):
        return {}
    if effect == "stribeck" and log.rests > RESTING:
        return {}
    if effect:
        log.frame[log.column] = changed(log, effect, size, np.random.default_rng([seed, *effect.encode()]))
    with tempfile.TemporaryDirectory() as folder:
        path = str(Path(folder, "log.csv"))
        log.frame.to_csv(path, index=False)
        row = diagnose(Rig(rig.name, (effect,), None, [path, *rig.arguments[1:]]))
    return row | {"effect": effect, "share": round(size, 3)}


@click.command(help=__doc__)
@click.option("--size", default=0.3, help="Rms of the effect as a share of the rms drive.")
@click.option("--seed", default=0, help="Draws places, orders and phases.")
@click.option("--only", default="", help="Rigs whose name contains one of these texts, parted by semicolons.")
@click.option("--effects", default=",".join([*EFFECTS, "parameter_change", "input_delay"]), help="Effects to add.")
@click.option("--out", type=click.Path(dir_okay=False), help="Rows as CSV.")
@click.option("--jobs", default=1)
def main(size: float, seed: int, only: str, effects: str, out: str | None, jobs: int) -> None:
    """Print every run, and the share found by effect."""
    names = [n for n in only.split(";") if n]
    chosen = [r for r in rigs() if r.name in RIGS and (not names or any(n in r.name for n in names))]
    asked = [(r, e) for r in chosen for e in ("", *effects.split(","))]
    work = Parallel(n_jobs=jobs, return_as="generator")(delayed(one)(r, e, size, seed) for r, e in asked)
    rows, own = [], {}
    for row in tqdm(work, total=len(asked), ascii=True):
        if not row:
            continue
        said = [*row["names"].split("+"), *row["aliases"].split("+")]
        if not row["effect"]:
            own[row["record"]] = said
        row["found"], row["first"] = row["effect"] in said, row["right"]
        row["itself"] = row["effect"] in own[row["record"]]
        rows.append(row)
        marks = [m for m in ("first", "found", "itself", "wrong") if row["effect"] and row[m]]
        what = [row["record"], row["effect"] or "as it is", row["verdict"], " ".join(marks), row["names"], row["error"]]
        tqdm.write("{:26}{:18}{:14}{:20}{} {}".format(*what))
    told = [r for r in rows if r["effect"] and not r["itself"]]
    total, found = Counter(r["effect"] for r in told), Counter(r["effect"] for r in told if r["found"])
    for e, n in total.items():
        print(f"{e:20} {found[e]}/{n}")
    k, n = sum(found.values()), len(told)
    _, low, high = wilson(k, n)
    first, wrong = (sum(r[m] for r in told) for m in ("first", "wrong"))
    print(f"found {k}/{n} ({100 * low:.0f} to {100 * high:.0f} %), first {first}, sure and wrong {wrong}")
    if out:
        with open(out, "w", newline="", encoding="utf-8") as file:
            writer = csv.DictWriter(file, FIELDS, extrasaction="ignore")
            writer.writeheader()
            writer.writerows(rows)


if __name__ == "__main__":
    main()
