"""A folder of logs, one axis a part."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from whsklearn import RMILSRegressor, WienerHammersteinLags, WienerHammersteinSystem
from whsklearn.effects import reduced_law

MODEL = RMILSRegressor(WienerHammersteinLags(), p=1, n_starts=8, memory=256, random_state=0)


def write_axis(folder: Path, name: str, coulomb: float, seed: int, parts: int = 1) -> None:
    rng = np.random.default_rng(seed)
    u = rng.normal(size=600)
    system = WienerHammersteinSystem([1, 2.2], [1, 0.5], [1, 0.2], [0.15, 0.4], law=reduced_law(coulomb=coulomb))
    frame = pd.DataFrame({"t": 0.01 * np.arange(600), "u": u, "y": system.simulate(u[:, None])})
    frame["y"] += 0.02 * rng.normal(size=600)
    home = folder / f"axis={name}"
    home.mkdir()
    size = len(frame) // parts
    for i in range(parts):  # files not in the order of time
        frame.iloc[(parts - 1 - i) * size : (parts - i) * size].to_parquet(home / f"part-{i}.parquet", index=False)


def source(folder):
    return {"folder": str(folder), "axis": "axis", "inputs": ["u"], "output": "y", "time_column": "t"}
