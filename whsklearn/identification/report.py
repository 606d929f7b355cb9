"""The output of `identify`: identify.json for programs, model.json, and a page for people."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from whsklearn.logs.files import atomic_write
from whsklearn.logs.units import UNKNOWN, own_units, respelled
from whsklearn.models import save_model
from whsklearn.plot.page import html_of

if TYPE_CHECKING:
    import os

    from whsklearn.identification.compare import Compared, Identification

MODEL_FILE = "model.json"
DIVERGED = 1e6  # times the error of a constant: a diverged run rather than a poor model


def write(found: Identification, folder: str | os.PathLike[str]) -> Path:
    """Write ``identify.json``, ``model.json`` and ``identify.html`` into a folder, created if it does not exist.

    Returns
    -------
    Path
        Of the page.
    """
    out = Path(folder)
    out.mkdir(parents=True, exist_ok=True)
    save_model(found.model, out / MODEL_FILE)
    atomic_write(out / "identify.json", json.dumps(document(found), indent=1, allow_nan=False).encode() + b"\n")
    atomic_write(out / "identify.html", page(found).encode())
    return out / "identify.html"


def document(found: Identification) -> dict[str, Any]:
    """What identify.json holds."""
    return {
        "recommended": found.recommended.kind,
        "recommended_name": found.recommended.name,
        "reason": found.reason,
        "models": [_entry(c) for c in found.models],
        "trivial": {"name": found.trivial.name, "windows": _windows(found.trivial, found)},
        "parameters": parameters(found),
        "drive_lead_s": found.train.lead * found.train.dt,
        "residuals_white": found.white,
        "noise_floor_rmse": found.floor,
        "logged": found.train.logged,
        "rows": {"used": int(found.train.y.size), "given": found.rows, "segments": len(found.train.starts) + 1},
        "units": {"time": "s", "input": UNKNOWN, "output": UNKNOWN} | dict(found.model.units),
        "model_file": MODEL_FILE,
    }


def on_intervals(found: Identification) -> str:
    """Note on the intervals; empty if the residual is white."""
    if found.white:
        return ""
    how = "to the difference between two estimators" if found.recommended.kind == "axis" else "by sums over blocks"
    return (
        "The residual of the model is not white: something is missing. The intervals are widened "
        f"{how}; whsklearn gap looks for what is missing."
    )


def parameters(found: Identification) -> list[dict[str, Any]]:
    """Name, value, standard error and unit of every number of the recommended model, in the units of the log."""
    model = found.model
    own = own_units(model.si, (model.units.get("input", ""), model.units.get("output", "")))
    rows = []
    for name, value in model.parameters.items():
        error = model.standard_errors.get(name)
        si = model.parameter_units[name]
        by, unit = (1.0, si) if name.endswith("__phase") else respelled(si, own)
        unit = "" if unit in ("1", UNKNOWN) else unit
        rows.append(
            {
                "name": name,
                "value": value / by,
                "standard_error": None if error is None or not np.isfinite(error) else error / by,
                "unit": unit,
            }
        )
    return rows


def _entry(c: Compared) -> dict[str, Any]:
    entry: dict[str, Any] = {
        "name": c.name,
        "kind": c.kind,
        "structure": c.structure,
        "criterion": c.criterion,
        "train": c.train or {"nmse": None, "rmse": None},
        "test": c.test or {"nmse": None, "rmse": None},
        "score": c.score if np.isfinite(c.score) else None,
        "seconds": c.seconds,
    }
    return entry | ({"failure": c.failure} if c.failure else {})


def _windows(c: Compared, found: Identification) -> dict[str, float]:
    return {f"{h * found.train.dt:.4g}": e for h, e in c.windows.items() if np.isfinite(e)}


def page(found: Identification) -> str:
    """The page as HTML with embedded pictures; without matplotlib it has none."""
    try:
        from whsklearn.identification.pictures import as_png, figure

        picture = as_png(figure(found))
    except ImportError:
        picture = ""
    lengths = list(found.trivial.windows)
    return html_of(
        Path(__file__).with_name("page.html.j2"),
        found=found,
        picture=picture,
        parameters=parameters(found),
        lengths=lengths,
        unit=found.model.units.get("output", ""),
        on_intervals=on_intervals(found),
        on_drive=found.on_drive,
        seconds=[f"{h * found.train.dt:.3g} s" for h in lengths],
        number=number,
        error_of=error_of,
    )


def error_of(value: float | None, trivial: float = 1.0, digits: int = 3) -> str:
    """An error with three significant digits; a word if the run diverged.

    Examples
    --------
    >>> error_of(0.0336), error_of(None), error_of(5.6e103, trivial=0.73)
    ('0.0336', '-', 'diverges')
    """
    return "diverges" if value is not None and value > DIVERGED * trivial else number(value, digits)


def number(value: float | None, digits: int = 3) -> str:
    """A number with a few significant digits; a dash for None."""
    return f"{value:.{digits}g}" if value is not None and np.isfinite(value) else "-"
