"""Every Python block of the README and of the pages runs, in its page's order, in a folder that holds ``axis.csv``."""

from __future__ import annotations

import re
from pathlib import Path

import matplotlib
import numpy as np
import pandas as pd
import pytest

from whsklearn.datasets import make_servo_log
from whsklearn.effects import Cogging
from whsklearn.effects import base as catalogue

ROOT = Path(__file__).resolve().parents[2]
BLOCK = re.compile(r"^```python\n(.*?)^```", re.DOTALL | re.MULTILINE)
PAGES = sorted([ROOT / "README.md", *(ROOT / "docs").glob("*.md")])


def blocks(page: Path) -> list[str]:
    return BLOCK.findall(page.read_text(encoding="utf-8"))


@pytest.fixture
def desk(mlflow_root, tmp_path, monkeypatch):
    """A folder with a log of an axis that cogs, as a reader of the pages would have one."""
    log = make_servo_log([Cogging(0.2, 12.0)], duration=6.0, random_state=0)
    table = pd.DataFrame(log)
    table["velocity_rad_s"] = np.gradient(table["position_rad"], table["time_s"])
    table.to_csv(tmp_path / "axis.csv", index=False)
    monkeypatch.setattr(catalogue, "_REGISTRY", dict(catalogue._REGISTRY))  # a page defines an effect of its own
    monkeypatch.chdir(tmp_path)
    matplotlib.use("Agg")


@pytest.mark.parametrize("page", [p for p in PAGES if blocks(p)], ids=lambda p: p.stem)
def test_python_blocks_run(page: Path, desk) -> None:
    names: dict[str, object] = {}
    for i, code in enumerate(blocks(page)):
        exec(compile(code, f"{page.name}, block {i + 1}", "exec", dont_inherit=True), names)
