"""Make the simulated records of this folder: ``python datasets/make_turntable.py``."""

from __future__ import annotations

from pathlib import Path

from whsklearn.datasets.servo import EXPERIMENTS, make_turntable

if __name__ == "__main__":
    for experiment in EXPERIMENTS:
        path = Path(__file__).with_name(f"turntable_{experiment}.csv")
        make_turntable(experiment).to_csv(path, index=False)
        print(path.name)
