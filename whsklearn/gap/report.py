"""The report: ``gap.json`` for programs, ``gap.html`` for a person, ``repaired.json`` with the repaired model."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

from whsklearn.gap.diagnosis import Diagnosis
from whsklearn.gap.repaired import as_data


def write_report(diagnosis: Diagnosis, folder: str | os.PathLike[str], model: Any = None) -> Path:
    """Write the files into ``folder`` (made if it is not there); returns the path of the page."""
    target = Path(folder)
    target.mkdir(parents=True, exist_ok=True)
    text = json.dumps(diagnosis.as_dict(), indent=2, allow_nan=False)
    (target / "gap.json").write_text(text + "\n", encoding="utf-8")
    data = as_data(model)
    if data:
        (target / "repaired.json").write_text(json.dumps(data, indent=2) + "\n", encoding="utf-8")
    from whsklearn.gap.page import render

    page = target / "gap.html"
    page.write_text(render(diagnosis), encoding="utf-8")
    return page
