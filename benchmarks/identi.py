"""Our row on the single-input single-output tasks of IdentiBench: its splits, its metrics, `identify` as it stands.

    pip install identibench
    python -m benchmarks.identi [--only EMPS] [--root FOLDER] [--data FOLDER]

With the network the package fetches its records into its own folder (``--root``).  Without it ``--data`` (or
WHSKLEARN_DATA) is written in its layout: the published files of nonlinearbenchmark.org, the records of EMPS, the
estimation part of WH2009 (whose official test part is another, so the figure is of the part that is here).  Where the
Silverbox or the coupled drives are not there, their twins are; a task whose records are in neither is not run, and
named.

Published figures are those that the field quotes for the official test parts (records: https://www.nonlinearbenchmark.org);
they were not checked at their sources, and do not compare with a figure of another part or of a twin. EMPS: Forgione
and Piga 2021, dynoNet.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import tempfile
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from benchmarks._twins import make_coupled_drives, make_silverbox
from whsklearn.datasets import (
    fetch_cascaded_tanks,
    fetch_coupled_drives,
    fetch_silverbox,
)
from whsklearn.identification import identify
from whsklearn.identification.drive_lead import moved
from whsklearn.identification.view import derivative
from whsklearn.identification.windows import window_errors

# Task of the package, published figure in its metric, and where that is from
TASKS = {
    "WH": ("0.28 mV", "best published"),
    "Silverbox": ("0.64 mV (multisine)", "best published"),
    "CascadedTanks": ("-", "none that was checked"),
    "CED": ("0.09 to 0.14", "range of the best published"),
    "EMPS": ("2.64 mm", "dynoNet"),
}
# What the layout written here holds in the place of the published records
TWINS = {"Silverbox": " (simulated twin, 0.05 mV of noise)", "CED": " (simulated twin, 0.02 V of noise)"}
# Of the signals, which the package does not give; on a linear axis there is no gravity imbalance
UNITS = {"EMPS": {"input": "V", "output": "m"}}

Pair = tuple[np.ndarray, np.ndarray]


class Fitted:
    """The recommended model as the package calls it: the state from the first outputs, then a free run."""

    def __init__(self, u: np.ndarray, y: np.ndarray, dt: float, groups: np.ndarray, units: dict[str, str]):
        self.dt = dt
        self.found = identify(u, y, dt=dt, groups=groups, units=units)

    def __call__(self, u: np.ndarray, y_init: np.ndarray, _: dict[str, Any]) -> np.ndarray:
        """Output (n, 1) from the input and the first outputs."""
        begin, u = np.ravel(y_init).astype(float), np.ravel(u).astype(float)
        y = np.concatenate([begin, np.full(u.size - begin.size, begin[-1])])  # what follows is not looked at
        logged = self.found.train.logged
        target = derivative(y, self.dt)[0] if logged == "position" else y
        log = moved(replace(self.found.train, u=u, y=y, target=target, starts=()), self.found.own[0].lead)
        ahead = y[begin.size :] - window_errors(self.found.model, log, u.size - begin.size, begin.size)[0]
        return np.concatenate([begin, ahead])[:, None]


def build(context: Any, units: dict[str, str]) -> Fitted:
    """What the package trains: all that may be learned from, in one record of several segments."""
    parts = list(context.get_train_valid_sequences())
    u, y = (np.concatenate([np.ravel(getattr(p, k)) for p in parts]).astype(float) for k in ("u", "y"))
    groups = np.repeat(np.arange(len(parts)), [len(p.u) for p in parts])
    return Fitted(u, y, 1.0 / float(parts[0].attrs.get("fs", 1.0)), groups, units)


def write(folder: Path, records: dict[str, list[tuple[np.ndarray, np.ndarray]]], rate: float) -> None:
    """Records in the package's layout: a folder a role, a file a record, and the mark that says that they are whole."""
    import h5py

    for role, signals in records.items():
        (folder / role).mkdir(parents=True, exist_ok=True)
        for i, (u, y) in enumerate(signals):
            with h5py.File(folder / role / f"{role}_{i}.hdf5", "w") as file:
                file["u0"], file["y0"] = np.ravel(u).astype(float), np.ravel(y).astype(float)
                file.attrs["fs"] = rate
    (folder / ".prepared").write_text("1")


def silverbox(data: Path) -> tuple[dict[str, list[Pair]], bool]:
    """Records by role in the order in which the package tests them, and whether they are a twin's."""
    try:
        found = fetch_silverbox(data, download=False)
    except FileNotFoundError:
        u, y = make_silverbox(random_state=0)
        cut = 65_062
        arrow = make_silverbox("arrow", random_state=1)
        tests = [(u[cut:], y[cut:]), arrow, (arrow[0][:32_000], arrow[1][:32_000])]
        return {"train_valid": [(u[:cut], y[:cut])], "test": tests}, True
    tests = [found.test_multisine, found.test_arrow, found.test_arrow_inside]
    return {"train_valid": [found.train], "test": tests}, False


def coupled_drives(data: Path) -> tuple[dict[str, list[Pair]], bool]:
    """The same of the drives, at a small and at a large input."""
    try:
        found = fetch_coupled_drives(data, download=False)
    except FileNotFoundError:
        both = [make_coupled_drives(kind="uniform", amplitude=a, random_state=i) for i, a in enumerate((0.5, 1.5))]
        parts = {
            k: [(u[s], y[s]) for u, y in both] for k, s in (("train_valid", slice(400)), ("test", slice(400, 500)))
        }
        return parts, True
    return {"train_valid": list(found.train), "test": list(found.test)}, False


def local_layout(root: Path, data: Path) -> set[str]:
    """What is here, as the package would have prepared it; the tasks whose records are twins'."""
    twins = set()
    for task, folder, records, rate in (
        ("Silverbox", "silverbox", silverbox(data), 1e7 / 2**14),
        ("CED", "ced", coupled_drives(data), 50.0),
    ):
        parts, twin = records
        write(root / folder, parts, rate)
        twins |= {task} if twin else set()
    with contextlib.suppress(FileNotFoundError):
        tanks = fetch_cascaded_tanks(data, download=False)
        write(root / "cascaded_tanks", {"train_valid": [tanks.train], "test": [tanks.test]}, 0.25)
    if (data / "emps").is_dir():
        frames = {k: pd.read_csv(data / "emps" / f"emps_{k}.csv") for k in ("train", "test")}
        emps = {k: [(f["drive_V"].to_numpy(), f["position_m"].to_numpy())] for k, f in frames.items()}
        write(root / "emps", {"train_valid": emps["train"], "test": emps["test"]}, 1000.0)
    if (data / "wh2009").is_dir():
        wh = {}
        for role, name in (("train_valid", "estimation"), ("test", "development_test")):
            with np.load(data / "wh2009" / f"{name}.npz") as file:
                wh[role] = [(file["u"], file["y"])]
        write(root / "wh", wh, 51_200.0)
    return twins


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--only", choices=list(TASKS))
    parser.add_argument("--root", type=Path, help="the package's folder with its records; else they are made here")
    parser.add_argument("--data", default=os.environ.get("WHSKLEARN_DATA"))
    options = parser.parse_args()
    try:
        import identibench
    except ImportError as error:
        raise SystemExit(f"{error}; pip install identibench.") from None
    with tempfile.TemporaryDirectory() as made:
        twins: set[str] = set()
        if options.root is None:
            twins = local_layout(
                Path(made), Path(options.data or Path(__file__).resolve().parents[2] / "shared" / "data")
            )
        with identibench.data_root(options.root or made) as root:
            for task, (published, source) in TASKS.items():
                if options.only in (None, task):
                    stands_for = TWINS[task] if task in twins else ""
                    if task == "WH" and options.root is None:
                        stands_for = " (another test part)"
                    spec = getattr(identibench, f"Benchmark{task}_Simulation")
                    told(spec, task + stands_for, root, f"{published}, {source}")


def told(spec: Any, task: str, root: Path, published: str) -> None:
    """A line for each test set of a task."""
    if not all((root / d.dataset_id / ".prepared").is_file() for d in spec.datasets):
        print(f"{task}: its records are not here and are not fetched; published {published}", flush=True)
        return
    began, built = time.process_time(), []

    def keep(context: Any) -> Fitted:
        built.append(build(context, UNITS.get(task.split()[0], {})))
        return built[0]

    import identibench

    result = identibench.run_benchmark(spec, keep, seed=0)
    for name, scores in result["test_sets"].items():
        ours = ", ".join(f"{k} {v:.4g}" for k, v in scores.items())
        print(
            f"{task} {name}: {ours} by {built[0].found.recommended.name} "
            f"({time.process_time() - began:.0f} s of CPU); published {published}",
            flush=True,
        )


if __name__ == "__main__":
    main()
