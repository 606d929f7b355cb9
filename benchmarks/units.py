"""Every consumer of a log and of a model against one truth, in twelve combinations of units.

One axis is simulated once and written as twelve logs: angle in rad or deg, drive in Nm, mNm or A (by a torque constant
of 0.1 Nm/A that nobody is told), time in s or ms.  Whatever reads them has to say the same of the axis:

- ``gap``: inertia, friction and cogging, in the units that it states;
- ``identify``'s axis: inertia, in the same unit as gap;
- ``simulate``: the repaired model on the log of the next combination, or a refusal where one is in A;
- ``gap --test``: the errors on the next combination's log, in the first one's unit, or a refusal;
- ``load_model``: the numbers of the file in SI, and its free run in its columns;
- ``export`` to MJCF, URDF and Isaac Lab: inertia, damping, friction in Nm, or a loss that says A;
- ``export`` to C: compiled, it replays the log's drive to the log's position; C and Structured Text say both units;
- ``export`` to FMI: both units with their factors;
- a served model: the rows of the next combination's log, by the name of their column, or a refusal;
- ``stream``: started again from its checkpoint on columns in other units, a refusal that names both;
- an estimator's own state file: the same of a frame.

    python -m benchmarks.units [--only rad,Nm,s]

Prints a line a combination and the number that is wrong (0 wanted).
"""

from __future__ import annotations

import ctypes
import itertools
import re
import shutil
import subprocess
import tempfile
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import click
import numpy as np
import pandas as pd
from click.testing import CliRunner

from whsklearn import InverseDynamicsLags, RLSRegressor
from whsklearn.datasets import make_servo_log
from whsklearn.effects import Cogging
from whsklearn.export import export_model
from whsklearn.gap import GapFinder, ServoRecord
from whsklearn.gap.proof import on_second_record
from whsklearn.gap.report import as_model
from whsklearn.identification.axis_fit import fit_rigid_axis
from whsklearn.identification.view import view
from whsklearn.logs import load_log
from whsklearn.logs.units import factor_between, factor_of, own_units, respelled
from whsklearn.models import AxisModel, load_model, save_model
from whsklearn.tracking.served import Served

COMBINATIONS = tuple(itertools.product(("rad", "deg"), ("Nm", "mNm", "A"), ("s", "ms")))
CONSTANT = 0.1  # Nm/A
TRUTH = {"inertia": 0.05, "viscous": 0.12, "coulomb": 0.3, "cogging": 0.03}  # of the simulated axis, Nm and rad
NEAR = 0.02  # of a number: what ten seconds tell of it
SHORT = 3000  # samples of which ``identify`` knows the inertia to an eighth
Check = tuple[str, bool, str]


def columns_of(combination: tuple[str, str, str]) -> dict[str, str]:
    """Names of the columns by role; they say their units."""
    angle, drive, time = combination
    return {"time": f"time_{time}", "drive": f"drive_{drive.lower()}", "position": f"angle_{angle}"}


def write(frame: pd.DataFrame, combination: tuple[str, str, str], folder: Path) -> Path:
    """The log in one combination of units, as CSV with every digit."""
    angle, drive, time = combination
    columns = columns_of(combination)
    torque = frame["torque_nm"] / CONSTANT if drive == "A" else frame["torque_nm"] * factor_between("Nm", drive)
    table = pd.DataFrame({
        columns["time"]: frame["time_s"] * factor_between("s", time), columns["drive"]: torque,
        columns["position"]: frame["position_rad"] * factor_between("rad", angle),
    })  # fmt: skip
    path = folder / f"{'_'.join(combination)}.csv"
    table.to_csv(path, index=False)
    return path


def expected(name: str, unit: str, combination: tuple[str, str, str]) -> float:
    """The truth of a number in the unit that a report states; of a drive in A by the torque constant."""
    by = CONSTANT if combination[1] == "A" else 1.0
    si = {"inertia": "Nm s²/rad", "viscous": "Nm s/rad"}.get(name, "Nm")
    if unit.startswith("kg"):
        return TRUTH[name]
    spelled = {"Nm": combination[1], "rad": combination[0]}
    factor, told = respelled(si, spelled)
    return TRUTH[name] / by / factor if told == unit else np.nan


def near(value: float, truth: float, share: float = NEAR) -> bool:
    """Whether a figure is the truth's."""
    return bool(abs(value / truth - 1.0) < share)


def check(train: Path, test: Path, here: tuple[str, str, str], there: tuple[str, str, str]) -> Iterator[Check]:
    """(consumer, whether it is right, what it said) for one combination and the next."""
    log = load_log(train, **columns_of(here))
    record = ServoRecord(log.time, log.X[:, 0], log.y, units=(log.units["drive"], log.units["position"]))
    finder = GapFinder("servo").fit(record)
    d = finder.diagnosis_
    for row in d.base_parameters:
        if row["name"] in TRUTH:
            right = near(row["after"], expected(row["name"], row["unit"], here))
            yield f"gap, {row['name']}", right, f"{row['after']:.4g} {row['unit']}"
    label = f"amplitude_{here[1].lower()}"
    size = d.effects[0].parameters.get(label, np.nan) if d.effects else np.nan
    yield "gap, cogging", near(float(size), expected("cogging", here[1], here)), f"{label} {size:.4g}"
    yield from identified(log, here, next(r["unit"] for r in d.base_parameters if r["name"] == "inertia"))
    model = as_model(finder.model_, d.logged)
    assert isinstance(model, AxisModel)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        save_model(model, folder / "repaired.json")
        yield from loaded(folder / "repaired.json", log, here)
        yield from simulated(folder, test, here, there)
        yield from exported(folder / "repaired.json", folder, log, here)
        yield from served(folder / "repaired.json", test, here, there)
        yield from streamed(folder, train, test, here, there)
        yield from resumed(folder, log, here, there)
    yield from tested(finder, test, here, there)


def identified(log: Any, here: tuple[str, str, str], unit_of_gap: str) -> Iterator[Check]:
    """The axis of ``identify``: its interval holds the inertia, told in the unit that gap has."""
    by, far = (factor_of(log.units[r])[0] for r in ("drive", "position"))
    n = SHORT  # of all 12 s, with the cogging missing, the interval is wider than the inertia
    model = fit_rigid_axis(view(log.X[:n, 0] * by, log.y[:n] * far, 1.0 / log.sample_rate, "position"))
    units = {"input": log.units["drive"], "output": log.units["position"]}
    told = AxisModel(model.inertia, model.law, dt=model.dt, logged="position", units=units)
    factor, unit = respelled(told.parameter_units["inertia"], own_units(told.si, (units["input"], units["output"])))
    apart = abs(model.inertia / factor - expected("inertia", unit, here))
    right = unit == unit_of_gap and apart < 1.96 * model.standard_errors["inertia"] / factor
    yield "identify, inertia", bool(right), f"{model.inertia / factor:.4g} {unit}"


def loaded(path: Path, log: Any, here: tuple[str, str, str]) -> Iterator[Check]:
    """A file's numbers in SI, and its free run from the log's drive to the log's position."""
    model = load_model(path)
    units = model.parameter_units
    si = "A" if here[1] == "A" else "Nm"
    right = near(model.parameters["coulomb"], TRUTH["coulomb"] / (CONSTANT if si == "A" else 1.0))
    yield "load_model, numbers", right and units["coulomb"] == si and all(units.values()), units["coulomb"]
    run = model.simulate(log.X[:, 0], start=log.y[0])
    error = float(np.std(run - log.y) / np.std(log.y))
    yield "load_model, free run", error < NEAR, f"{100 * error:.2g} % of {model.units['output']}"


def simulated(folder: Path, test: Path, here: tuple[str, str, str], there: tuple[str, str, str]) -> Iterator[Check]:
    """The command ``simulate`` on the log of other units."""
    from whsklearn.cli.simulate import main

    c = columns_of(there)
    arguments = [str(folder / "repaired.json"), str(test), "--time", c["time"], "--input", c["drive"], "--output"]
    done = CliRunner().invoke(main, [*arguments, c["position"], "--out", str(folder / "out.csv"), "--no-track"])
    if ("A" in here) != ("A" in there):
        yield "simulate", done.exit_code != 0 and "cannot be converted" in done.output, "refused"
        return
    found = re.search(r"NMSE ([0-9.e+-]+), RMSE [0-9.e+-]+ (\w+)", done.output)
    right = found is not None and float(found[1]) < NEAR and found[2] == there[0]
    yield "simulate", right, done.output.strip().splitlines()[-2] if found else done.output


def tested(finder: GapFinder, test: Path, here: tuple[str, str, str], there: tuple[str, str, str]) -> Iterator[Check]:
    """A second record of other units, in the unit of the first."""
    log = load_log(test, **columns_of(there))
    record = ServoRecord(log.time, log.X[:, 0], log.y, units=(log.units["drive"], log.units["position"]))
    try:
        rows = on_second_record(finder, record)
    except ValueError as error:
        yield "gap --test", ("A" in here) != ("A" in there) and "converted" in str(error), "refused"
        return
    spread = float(np.std(log.y)) * factor_between(there[0], here[0])
    right = ("A" in here) == ("A" in there) and all(
        r["after"] < NEAR * spread and r["after"] < r["before"] for r in rows
    )
    yield "gap --test", right, f"{rows[-1]['after']:.3g} {here[0]}"


def exported(path: Path, folder: Path, log: Any, here: tuple[str, str, str]) -> Iterator[Check]:
    """All formats: descriptions of robots in SI or with a loss that says A, code and FMU in the columns' units."""
    angle, drive, _ = here
    by = CONSTANT if drive == "A" else 1.0
    truth = [TRUTH[k] / by for k in ("inertia", "viscous", "coulomb")]
    patterns = {
        "mjcf": (r'diaginertia="([0-9.e-]+)', r' damping="([0-9.e-]+)', r'frictionloss="([0-9.e-]+)'),
        "urdf": (r'ixx="([0-9.e-]+)', r' damping="([0-9.e-]+)', r' friction="([0-9.e-]+)'),
        "isaac": (r"armature=([0-9.e-]+)", r"viscous_friction=([0-9.e-]+)", r"dynamic_friction=([0-9.e-]+)"),
    }
    for to, parts in patterns.items():
        done = export_model(path, to=to, out=folder / to)
        text = done.paths[0].read_text(encoding="utf-8")
        values = [float(m[1]) for p in parts if (m := re.search(p, text))]
        warned = any(loss.name == "unit of the drive" and loss.size == "A" for loss in done.losses)
        right = len(values) == 3 and all(map(near, values, truth)) and warned == (drive == "A")
        yield f"export to {to}", right, " ".join(f"{v:.4g}" for v in values)
    for to, suffix in (("c", "model.c"), ("c", "model.h"), ("st", "model.st")):
        export_model(path, to=to, out=folder / to)
        text = (folder / to / suffix).read_text(encoding="utf-8")
        yield f"export to {to}, {suffix}", f"drive in {drive}; position in {angle}" in text, "header"
    if shutil.which("cc"):
        y = replayed(folder / "c", log.X[:, 0])
        model = load_model(path).simulate(log.X[:, 0])
        yield "export to c, replay", bool(np.abs(y - model).max() < 1e-6 * np.ptp(model)), "compiled"
    fmu = export_model(path, to="fmu", out=folder / "fmu").paths[0]
    text = zipfile.ZipFile(fmu).read("modelDescription.xml").decode()
    defined = dict(re.findall(r'<Unit name="(\w+)"><BaseUnit .*?factor="([0-9.e-]+)"', text))
    right = all(float(defined.get(u, np.nan)) == factor_of(u)[0] for u in (drive, angle))
    yield "export to fmu", right and f'unit="{drive}"' in text and f'unit="{angle}"' in text, str(defined)


def replayed(folder: Path, u: np.ndarray) -> np.ndarray:
    """The output of the exported C code, driven by ``u``."""
    code = (
        '#include "model.h"\nvoid replay(const double *u, double *y, long n)\n{ model_state s; long i; model_init(&s);'
    )
    (folder / "replay.c").write_text(code + " for (i = 0; i < n; ++i) y[i] = model_step(&s, u[i]); }\n")
    flags = ["-std=c99", "-O1", "-shared", "-fPIC", "model.c", "replay.c", "-o", "model.so", "-lm"]
    subprocess.run(["cc", *flags], cwd=folder, check=True)
    u, y = np.ascontiguousarray(u, dtype=float), np.empty(u.size)
    pointer = ctypes.POINTER(ctypes.c_double)
    replay = ctypes.CDLL(str(folder / "model.so")).replay
    replay(u.ctypes.data_as(pointer), y.ctypes.data_as(pointer), ctypes.c_long(u.size))
    return y


def served(path: Path, test: Path, here: tuple[str, str, str], there: tuple[str, str, str]) -> Iterator[Check]:
    """What MLflow serves, asked with a frame of other units."""
    rows = pd.read_csv(test)[[columns_of(there)["drive"]]]
    try:
        y = Served(str(path)).predict(rows)
    except ValueError as error:
        yield "served model", ("A" in here) != ("A" in there) and "converted" in str(error), str(error)
        return
    log = load_log(test, **columns_of(there))
    truth = log.y * factor_between(there[0], here[0])
    error = float(np.std(y - truth) / np.std(truth))  # the log begins at rest
    yield "served model", ("A" in here) == ("A" in there) and error < NEAR, f"{100 * error:.2g} % of {here[0]}"


def streamed(
    folder: Path, train: Path, test: Path, here: tuple[str, str, str], there: tuple[str, str, str]
) -> Iterator[Check]:
    """A stream, and a second one that is given its checkpoint and a log of other units."""
    from whsklearn.cli.stream import main

    done = []
    for path, units in ((train, here), (test, there)):
        c = columns_of(units)
        columns = ["--time", c["time"], "--input", c["drive"], "--output", c["position"]]
        kept = ["--checkpoint", str(folder / "stream.whs"), "--out", str(folder / f"{path.stem}.jsonl"), "--no-track"]
        done.append(CliRunner().invoke(main, [str(path), *columns, *kept, "--estimator", "rls", "--orders", "1,1,1,1"]))
    first, second = done
    yield "stream", first.exit_code == 0, first.output.strip()[-200:]
    told = all(f"{columns_of(u)['position']} in {u[0]}" in second.output for u in (here, there))
    yield "stream, resumed", second.exit_code != 0 and told, second.output.strip()[-300:]


def resumed(folder: Path, log: Any, here: tuple[str, str, str], there: tuple[str, str, str]) -> Iterator[Check]:
    """A saved estimator that goes on with a frame whose column has another name, or the same."""
    rows, y = pd.DataFrame({columns_of(here)["position"]: log.y}), log.X[:, 0]
    RLSRegressor(InverseDynamicsLags(causal=True)).fit(rows, y).save(folder / "axis.whs")
    try:
        RLSRegressor.load(folder / "axis.whs").partial_fit(rows.set_axis([columns_of(there)["position"]], axis=1), y)
    except ValueError as error:
        yield "state file", here[0] != there[0] and "feature names" in str(error), "refused"
        return
    yield "state file", here[0] == there[0], "goes on"


def logs(folder: Path) -> tuple[dict[Any, Path], dict[Any, Path]]:
    """Two records of the axis, each in all combinations."""
    out: list[dict[Any, Path]] = []
    for seed, amplitude in ((0, 1.0), (1, 0.7)):
        frame = make_servo_log([Cogging(TRUTH["cogging"], 12.0)], duration=12.0, amplitude=amplitude, random_state=seed)
        place = folder / str(seed)
        place.mkdir()
        out.append({c: write(frame, c, place) for c in COMBINATIONS})
    return out[0], out[1]


@click.command()
@click.option("--only", help="One combination, such as deg,mNm,ms.")
def main(only: str | None) -> None:
    """Check every consumer in every combination of units, and print what is wrong."""
    wrong = total = 0
    with tempfile.TemporaryDirectory() as name:
        train, test = logs(Path(name))
        for k, here in enumerate(COMBINATIONS):
            if only and tuple(only.split(",")) != here:
                continue
            there = COMBINATIONS[(k + 5) % len(COMBINATIONS)]  # 5 has no factor with 12: every pair of drives comes up
            checks = list(check(train[here], test[there], here, there))
            bad = [c for c in checks if not c[1]]
            wrong, total = wrong + len(bad), total + len(checks)
            click.echo(f"{', '.join(here):12s} {len(checks) - len(bad)} of {len(checks)} right")
            for consumer, _, said in bad:
                click.echo(f"    wrong: {consumer}: {said}")
    click.echo(f"{wrong} wrong of {total} (0 wanted)")
    raise SystemExit(bool(wrong))


if __name__ == "__main__":
    main()
