"""Arms on the command line: what gap, identify and simulate do with their logs."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
import numpy as np

from whsklearn.cli.arm_log import note_friction, note_locked, read_arm, robot_of
from whsklearn.cli.job import say_where, table, tracker_for, wrapped, writable_file, writable_folder
from whsklearn.cli.options import given
from whsklearn.cli.records import long_segments, note, rows_of, warnings_as_notes
from whsklearn.logs.errors import ColumnError, LogError

if TYPE_CHECKING:
    from sklearn.utils import Bunch

    from whsklearn.identification import ArmFit
    from whsklearn.systems import Arm

WINDOW = 0.5  # s of a free run in `simulate`: an arm replayed from its drives alone diverges within seconds


def base_of(options: Mapping[str, Any]) -> Any:
    """The base model of `gap`: an identified model, whose numbers are kept, or the robot of a file."""
    from whsklearn.models import load_model

    if options.get("known") is not None:
        return options["known"]
    if Path(options["robot"]).suffix == ".json":
        return load_model(options["robot"])
    return robot_of(options)


def gap_log(options: dict[str, Any]) -> Bunch:
    """The log of an arm in the form that `gap` takes.

    With a known load, the drive gains that it determines replace ``--gains``. With an unknown load, the log is the
    loaded one, and the estimate from the unloaded log is passed on in the options.
    """
    arm = robot_of(options)
    note_locked(options, arm)
    note_friction(options, arm)
    if options["load"] and not options["loaded"]:
        raise ColumnError("--load is the mass of a known load; give the log with it as --loaded.")
    if options["load"]:
        options["gains"] = gains_by_load(options, arm)
        note(f"Gains by the known load: {options['gains']}")
    log = read_arm(options["log_file"], options, arm)
    if options["loaded"] and not options["load"]:
        options["known"] = identified(long_segments(log), arm).model
        log = read_arm(options["loaded"], options, arm)
    whole, log = log, long_segments(log)
    errors = [e / g for g, e in log.gains.values() if g]
    log.update(units={"drive": "Nm", "position": "rad"}, rows=rows_of(log, whole))
    log.drive_error = max(errors, default=0.0)
    return log


def keep_gains(folder: Path, log: Bunch) -> None:
    """Write the gains that a log was read with into the repaired model, for the logs that it will be used with."""
    from whsklearn.models import load_model, save_model

    if log.gains and (path := folder / "repaired.json").exists():
        save_model(replace(load_model(path), gains=log.gains), path)


def gains_by_load(options: dict[str, Any], arm: Arm) -> str:
    """``--gains`` from the log without and the log with a load of known mass at the last joint."""
    from whsklearn import RigidBodyLags
    from whsklearn.identification import gains_from_load
    from whsklearn.systems.arm_files import body_numbers

    mass, _, place = options["load"].partition(":")
    try:
        numbers = body_numbers(float(mass), [float(x) for x in (place or "0,0,0").split(",")], np.zeros((3, 3)))
    except ValueError:
        numbers = np.zeros(1)
    if not (numbers[0] > 0.0 and np.isfinite(numbers).all()):
        raise ColumnError(f"--load is {options['load']!r}; expected KG or KG:X,Y,Z, such as 2.8 or 2.8:0,0,0.1.")
    raw = options | {"gains": ";".join(f"{j}:1" for j in arm.joints)}
    pair = [long_segments(read_arm(options[name], raw, arm)) for name in ("log_file", "loaded")]
    lags = RigidBodyLags(arm, pair[0].sample_rate)
    empty, loaded = ((log.y, log.X, log.groups) for log in pair)
    with warnings_as_notes():
        found = gains_from_load(lags, empty, loaded, joint=arm.joints[-1], numbers=numbers)
    if untold := [j for j, (g, _) in found.items() if g != g]:
        note(f"The load does not change the drive of {', '.join(untold)}; each keeps its own unit.")
    return ";".join(f"{j}:{g:.6g}+-{e:.3g}" if g == g else f"{j}:1" for j, (g, e) in found.items())


def identified(log: Bunch, arm: Arm, **settings: Any) -> ArmFit:
    """The result of `identify_arm` on a log; its warnings become notes."""
    from whsklearn.identification import identify_arm

    with warnings_as_notes():
        try:
            found = identify_arm(log.y, log.X, dt=1.0 / log.sample_rate, robot=arm, groups=log.groups, **settings)
        except ValueError as error:
            raise LogError(str(error)) from error
    if worse := [j for j, share in found.missing.items() if share > 1.0]:
        note(
            f"What one part of the log says of {', '.join(worse)} does not hold in another: the error there exceeds "
            "the drive. Record larger motions of each joint that is named, and let joints move together."
        )
    return found


def identify(options: dict[str, Any]) -> None:
    """``identify LOG --robot FILE``: base numbers beside the file's, and held-out errors."""
    from whsklearn.logs.files import atomic_write
    from whsklearn.models import save_model

    arm = robot_of(options)
    note_locked(options, arm)
    log = long_segments(read_arm(options["train"], options, arm))
    folder = writable_folder(options["out"])
    tracker = tracker_for("identify", options["track"], data=Path(options["train"]).stem)
    found = identified(log, arm, **({"law": options["law"]} if options["law"] else {}))
    save_model(replace(found.model, gains=log.gains), folder / "model.json")
    told = document(found, log.stated)
    atomic_write(folder / "identify.json", json.dumps(told, indent=1, allow_nan=False).encode() + b"\n")
    tables = f"{joints_table(found)}\n\n{numbers_table(told)}"
    click.echo(f"\n{tables}\n")
    click.echo(wrapped(f"Written: {folder / 'identify.json'}, {folder / 'model.json'} (with physical inertias)."))
    with tracker.run(f"identify {Path(options['train']).stem}") as run:
        run.log_params(given(options))
        run.log_tags({"recommended": "arm"})
        run.log_metrics({f"missing_{j}": v for j, v in found.missing.items() if not math.isnan(v)})
        run.log_text(tables, "table.txt")
        for name in ("identify.json", "model.json"):
            run.log_artifact(folder / name)
    say_where(tracker)


def known(share: float) -> float | None:
    """A share; None in place of NaN."""
    return None if math.isnan(share) else share


def document(found: ArmFit, stated: bool) -> dict[str, Any]:
    """The content of identify.json for an arm; only if the drives' units are ``stated``, numbers have them, too."""
    model, units, file = found.model, *((found.model.parameter_units, found.nominal) if stated else ({}, {}))
    parameters = [
        {"name": k, "value": v, "standard_error": model.standard_errors[k], "unit": units.get(k, ""),
         "nominal": file.get(k), "merged": found.lags.base_.merged.get(k, {})}
        for k, v in model.parameters.items()
    ]  # fmt: skip
    joints = [
        {"name": j, "missing": known(v), "one_axis_at_a_time": known(found.alone[j])} for j, v in found.missing.items()
    ]
    return {
        "recommended": "arm", "models": [], "parameters": parameters, "joints": joints, "model_file": "model.json",
        "cutoff_hz": found.lags.cutoff_, "unseen": [*found.lags.base_.unseen, *found.untold],
    }  # fmt: skip


def joints_table(found: ArmFit) -> str:
    """Held-out errors, coupled and one axis at a time."""
    rows = [
        [j, *(None if math.isnan(x) else f"{100 * x:.1f}" for x in (v, found.alone[j]))]
        for j, v in found.missing.items()
    ]
    return table(
        ["joint", "coupled", "one axis at a time"], rows,
        title="Error on held-out blocks, % of the joint's rms drive, slow samples left out",
    )  # fmt: skip


def numbers_table(told: dict[str, Any]) -> str:
    """Base numbers with intervals, the file's values, and the number of parameters merged into each.

    Numbers that the log says nothing of have neither value nor interval.
    """
    rows = []
    for p in told["parameters"]:
        value, half, file = p["value"], 1.96 * p["standard_error"], p["nominal"]
        seen = p["name"] not in told["unseen"]
        rows.append([p["name"], f"{value:.4g}" if seen else None,
                     f"{value - half:.4g} to {value + half:.4g}" if seen else None,
                     None if file is None else f"{file:.4g}", p["unit"], len(p["merged"]) or ""])  # fmt: skip
    return table(["number", "value", "95 % interval", "file", "unit", "merged"], rows)


def simulate(options: dict[str, Any], model: Any) -> None:
    """``simulate MODEL LOG`` for an arm: free runs of half a second, each started from the measured motion."""
    import pandas as pd

    from whsklearn.filtering import motion
    from whsklearn.lags.axis_rows import experiments
    from whsklearn.logs.files import atomic_write

    out, arm = writable_file(options["out"], options["model"], options["log_file"]), model.arm
    log = long_segments(read_arm(options["log_file"], options, arm))
    rate, ours = log.sample_rate, 1.0 / model.dt
    if abs(rate / ours - 1.0) > 0.01:
        note(f"The model was fitted at {ours:.6g} Hz, the log has {rate:.6g} Hz; the log's rate is taken.")
    path, judged = np.empty_like(log.y), np.ones(len(log.y), dtype=bool)
    for s in experiments(log.groups, len(log.y)):
        smooth = [motion(x, rate, 0.1 * rate) for x in log.y[s].T]
        begin = {k: np.column_stack([getattr(m, k) for m in smooth]) for k in ("position", "velocity")}
        path[s] = arm.simulate_drive(log.X[s], sample_rate=rate, resync=WINDOW, **begin).position
        judged[s][: round(WINDOW * rate)] = False  # the first run begins before the velocity filter has settled
    columns: dict[str, Any] = {"time": log.time}
    rows = []
    for j, (name, slides) in enumerate(zip(arm.joints, arm.slides, strict=True)):
        error = (log.y[:, j] - path[:, j])[judged]
        columns |= {f"{name}_drive": log.X[:, j], f"{name}_simulated": path[:, j]}
        columns |= {f"{name}_measured": log.y[:, j]}
        rows.append([name, float(np.sqrt(np.mean(error**2))), float(np.std(log.y[:, j])), "m" if slides else "rad"])
    atomic_write(out, pd.DataFrame(columns).to_csv(index=False).encode())
    click.echo(table(["joint", "rms error", "rms motion", "unit"], rows, title=f"Free runs of {WINDOW} s"))
    click.echo(f"\nWritten: {out}")
