"""The report: ``gap.json`` for programs, ``gap.html`` for a person, ``repaired.json`` (or, of a
MuJoCo model, ``repaired.xml``) with the repaired model, ``run.json`` with date and duration.
"""

from __future__ import annotations

import json
import os
import warnings
from pathlib import Path
from typing import Any

from whsklearn.gap.diagnosis import Diagnosis
from whsklearn.gap.repaired import as_model
from whsklearn.logs.files import atomic_write
from whsklearn.models import save_model


def write_report(diagnosis: Diagnosis, folder: str | os.PathLike[str], model: Any = None) -> Path:
    """Write the files to ``folder`` (created if it does not exist) and return the path of the page.

    All is rendered before the first byte is written, every file takes its name in one step, and what an earlier report
    left of a repaired model goes: an interruption leaves no page beside the numbers of another log.  Without matplotlib
    the page has no pictures, and a warning says so.
    """
    from whsklearn.gap.html_report import NO_PICTURES, can_draw, render

    target = Path(folder)
    if diagnosis.pictures and not can_draw():
        warnings.warn(NO_PICTURES, stacklevel=3)
    target.mkdir(parents=True, exist_ok=True)
    rendered = render(diagnosis).encode()
    atomic_write(target / "gap.json", _json(diagnosis.as_dict()))
    atomic_write(target / "run.json", _json(diagnosis.run()))
    for old in ("repaired.json", "repaired.xml"):
        (target / old).unlink(missing_ok=True)
    repaired = as_model(model, diagnosis.logged)
    if repaired is not None:
        save_model(repaired, target / "repaired.json")
    elif hasattr(model, "to_xml"):
        atomic_write(target / "repaired.xml", model.to_xml().encode())
    page = target / "gap.html"
    atomic_write(page, rendered)
    return page


def _json(data: dict[str, Any]) -> bytes:
    return (json.dumps(data, indent=2, allow_nan=False) + "\n").encode()
