"""Measured axes: how well the inverse and the forward model do, against what others published.

Run ``python -m benchmarks.real_data`` with the records in ``WHSKLEARN_DATA`` or ``../shared/data``; it prints
tables, and with ``--json FILE`` writes the same figures. Everything is fitted to the identification record;
what a row takes from the validation record besides its drive is said in the row.

Published for the EMPS: inverse model 4.08 % and 5.98 % (Janot, Gautier, Brunot 2019); free run on the
validation record 2.64 mm (dynoNet: Forgione, Piga 2021, Int. J. Adapt. Control Signal Process. 35(4)).
"""

from __future__ import annotations

import json
import os
import time
from pathlib import Path

import click
import numpy as np

from benchmarks._emps_forward import forward_rows, sensitivity
from benchmarks._emps_selection import selection_rows
from benchmarks._kr300_inverse import kr300_rows, two_sides
from whsklearn import RLSRegressor
from whsklearn.datasets import fetch_emps, fetch_kr300
from whsklearn.effects import AsymmetricViscous, Coulomb, PositionFriction, QuadraticDrag, Stribeck, Viscous
from whsklearn.lags import InverseDynamicsLags

ROOT = Path(__file__).resolve().parents[1]
PUBLISHED = {"inertia": 95.1089, "viscous": 203.5034, "coulomb": 20.3935, "input_offset": -3.1648}
CANDIDATES = {
    "asymmetric_viscous": AsymmetricViscous(1.0),
    "position_friction": PositionFriction(1.0, order=6.0),
    "stribeck": Stribeck(1.0, 0.02),
    "quadratic_drag": QuadraticDrag(1.0),
}


def emps_rows(frame, terms=(), border=49):
    """Rows of the reference method: order 4 and 100 Hz, central differences, every tenth row."""
    law = [Viscous(1.0), Coulomb(1.0), *terms]
    lags = InverseDynamicsLags(sample_rate=1000.0, law=law, cutoff=100.0, decimate=10, border=border, standstill=0.0)
    return (*lags.rows(frame[["position_m"]].to_numpy(), frame["force_N"].to_numpy()), lags)


def relative_error(phi, y, theta):
    """Norm of the residual over norm of the target, in per cent."""
    return 100 * float(np.linalg.norm(y - phi @ theta) / np.linalg.norm(y))


def emps_inverse(emps):
    """The reference method: errors and parameters."""
    phi, y, lags = emps_rows(emps.train)
    theta = np.linalg.lstsq(phi, y, rcond=None)[0]
    phi_v, y_v, _ = emps_rows(emps.test)
    return {
        "identification_%": relative_error(phi, y, theta),
        "validation_%": relative_error(phi_v, y_v, theta),
        "parameters": dict(zip(lags.get_feature_names_out(), map(float, theta), strict=True)),
        "published": PUBLISHED,
    }


def emps_drift(emps, forgetting=0.998):
    """Friction under forgetting (5 s), along the two records one after the other: means of their last halves."""
    model = RLSRegressor(forgetting=forgetting)
    means = []
    for frame in (emps.train, emps.test):
        phi, y, _ = emps_rows(frame)
        path = []
        for i in range(0, len(y), 10):
            theta = model.partial_fit(phi[i : i + 10], y[i : i + 10]).theta_
            path.append([theta[1], theta[2], 0.125 * theta[1] + theta[2]])
        means.append(np.mean(path[len(path) // 2 :], axis=0))
    names = ("viscous", "coulomb", "friction at 0.125 m/s")
    return [
        {"quantity": n, "identification": float(a), "validation": float(b), "drift_%": 100 * float(b / a - 1)}
        for n, a, b in zip(names, *means, strict=True)
    ]


def emps_effects(emps):
    """Forward choice of effects by blocks of the identification record: two cycles fit, the other two judge."""
    cycle = len(emps.train) // 4
    chosen, table = [], []
    best = _blocks(emps.train, [], cycle)
    table.append({"effects": "rigid, viscous, coulomb, offset", "held_out_%": best})
    left = dict(CANDIDATES)
    while left:
        scores = {n: _blocks(emps.train, [*(CANDIDATES[c] for c in chosen), e], cycle) for n, e in left.items()}
        name = min(scores, key=scores.get)
        if scores[name] > best - 0.02:
            break
        best = scores[name]
        chosen.append(name)
        del left[name]
        table.append({"effects": "+ " + name, "held_out_%": best})
    return {"table": table, "rejected": sorted(left)}


def _blocks(frame, terms, cycle):
    """Held-out inverse error over cycles 1 and 3 against 2 and 4, both ways."""
    parts = [emps_rows(frame.iloc[i * cycle : (i + 1) * cycle], terms)[:2] for i in range(4)]
    scores = []
    for fit, rest in (((0, 2), (1, 3)), ((1, 3), (0, 2))):
        phi, y = (np.concatenate([parts[i][k] for i in fit]) for k in (0, 1))
        theta = np.linalg.lstsq(phi, y, rcond=None)[0]
        phi, y = (np.concatenate([parts[i][k] for i in rest]) for k in (0, 1))
        scores.append(relative_error(phi, y, theta))
    return float(np.sqrt(np.mean(np.square(scores))))


def show(title, rows):
    """A list of equal dicts as a table."""
    click.echo(f"\n{title}\n{'-' * len(title)}")
    if not rows:
        return
    keys = list(rows[0])
    text = [list(keys)] + [[f"{r[k]:.4g}" if isinstance(r[k], float) else str(r[k]) for k in keys] for r in rows]
    widths = [max(len(line[i]) for line in text) for i in range(len(keys))]
    for line in text:
        click.echo("  ".join(cell.ljust(w) for cell, w in zip(line, widths, strict=True)).rstrip())


@click.command()
@click.option("--data", type=click.Path(path_type=Path), default=None, help="Folder that holds emps/ and kr300/.")
@click.option("--json", "json_file", type=click.Path(path_type=Path), default=None, help="Write the figures here too.")
@click.option("--skip-forward", is_flag=True, help="Leave out the free runs, which take most of the time.")
@click.option("--select", is_flag=True, help="Study which effects to carry from record to record too (6 minutes).")
def main(data, json_file, skip_forward, select):
    """Print how the models do on measured axes."""
    folder = data or os.environ.get("WHSKLEARN_DATA") or ROOT.parent / "shared" / "data"
    began = time.perf_counter()
    try:
        emps, kr300 = fetch_emps(folder, download=False), fetch_kr300(folder, download=False)
    except FileNotFoundError as error:
        click.echo(f"Skipped. {error}")
        return
    out = {"emps_inverse": emps_inverse(emps), "emps_drift": emps_drift(emps), "emps_effects": emps_effects(emps)}
    inverse = out["emps_inverse"]
    errors = {"identification %": inverse["identification_%"], "validation %": inverse["validation_%"]}
    show(
        "EMPS, inverse model: relative force error",
        [{"method": "published", **dict(zip(errors, (4.08, 5.98), strict=True))}, {"method": "this library", **errors}],
    )
    show(
        "EMPS, inverse model: parameters",
        [{"parameter": k, "published": PUBLISHED[k], "estimate": v} for k, v in inverse["parameters"].items()],
    )
    show("EMPS, with forgetting: friction drifts from record to record", out["emps_drift"])
    show("EMPS, effects by held-out cycles of the identification record", out["emps_effects"]["table"])
    if not skip_forward:
        out["emps_forward"], axis = forward_rows(emps)
        show("EMPS, free run, drive to position, rmse in mm", out["emps_forward"])
        out["emps_sensitivity"] = sensitivity(emps, axis)
        show("What a small error of a record's own level costs, rmse in mm", out["emps_sensitivity"])
    if select:
        out["emps_selection"] = selection_rows(emps)[0]
        show(
            "EMPS, free run, effects chosen by held-out halves of the identification record, mm", out["emps_selection"]
        )
    out["kr300"] = kr300_rows(kr300)
    show("KR300 axis 1, inverse model, relative torque error in % (friction from A alone)", out["kr300"])
    out["kr300_sides"] = two_sides(kr300)
    show("KR300 axis 1, motor against load side, and a load behind a spring in the torque", out["kr300_sides"])
    out["seconds"] = time.perf_counter() - began
    click.echo(f"\n{out['seconds']:.0f} s")
    if json_file:
        json_file.write_text(json.dumps(out, indent=1))


if __name__ == "__main__":
    main()
