"""False alarms of an axis's stream where nothing changes, and what it says of a friction that does.

    python -m benchmarks.axis_alarm                  # 12 kinds of axis, two streams of each, two minutes at 1 kHz
    python -m benchmarks.axis_alarm --first-seed 100 # fresh axes

The settings are those of `whsklearn stream`. After the first minute a second log of the same axis follows behind a
pause, with the same friction or with Coulomb friction raised by two thirds.
"""

from __future__ import annotations

import argparse
import dataclasses
from typing import Any

import numpy as np
from tqdm import tqdm

from whsklearn import InverseDynamicsLags, RLSRegressor
from whsklearn.cli.stream import EFFECTS
from whsklearn.datasets import default_axis, make_servo_log
from whsklearn.effects import Coulomb
from whsklearn.streaming import Options, StreamMonitor
from whsklearn.streaming.monitor import alarm_of_averages

RATE, SECONDS = 1000.0, 60.0
AXES: dict[str, dict[str, Any]] = {
    "as it is": {},
    "multisine": {"reference": "multisine"},
    "sweep": {"reference": "sweep"},
    "no noise": {"noise": 0.0},
    "noise of 1e-4 rad": {"noise": 1e-4},
    "encoder of 16 bits": {"noise": 0.0, "resolution": 2 * np.pi / 2**16},
    "encoder of 12 bits": {"noise": 0.0, "resolution": 2 * np.pi / 2**12},
    "cogging": {"effects": ["cogging"]},
    "cogging of a fifth": {"effects": ["cogging"], "sizes": 0.2},
    "Stribeck friction": {"effects": ["stribeck"]},
    "gravity": {"effects": ["gravity_imbalance"]},
    "torque ripple": {"effects": ["torque_ripple"]},
}


def streamed(kind: dict[str, Any], seed: int, raised: float) -> list[dict[str, Any]]:
    """Records of the stream of two logs of one axis, of which the second has its Coulomb friction raised so far."""
    axis, rows = default_axis(), []
    axis = dataclasses.replace(axis, sample_rate=RATE)
    first, truth = make_servo_log(axis=axis, duration=SECONDS, random_state=seed, return_truth=True, **kind)
    more = [Coulomb((raised - 1.0) * truth.parameters["coulomb"])] if raised > 1.0 else []
    kept = {k: v for k, v in kind.items() if k not in ("effects", "sizes")}
    second = make_servo_log([*truth.effects, *more], axis=axis, duration=SECONDS, random_state=seed + 1, **kept)
    for k, log in enumerate((first, second)):
        time = log["time_s"] + k * (SECONDS + 1.0)
        rows.append(np.column_stack([time, log["position_rad"], log["torque_nm"]]))
    told: list[dict[str, Any]] = []
    monitor = StreamMonitor(
        RLSRegressor(InverseDynamicsLags(RATE, effects=EFFECTS, causal=True)), alarm_of_averages(),
        Options(timed=True, max_step=2.5 / RATE, restart_after_hole=True, positions=(1,)), told.append,
    )  # fmt: skip
    monitor.take(np.concatenate(rows).tolist())
    return told


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--streams", type=int, default=2, help="streams of each kind of axis")
    parser.add_argument("--first-seed", type=int, default=0)
    options = parser.parse_args()
    begins = int(RATE * SECONDS)
    print(f"{'axis':22} false alarms in rows    rows until a change by two thirds is noticed, and its name")
    for name, kind in tqdm(AXES.items(), disable=None):
        false, found = 0, []
        for k in range(options.streams):
            seed = options.first_seed + 2 * k
            false += sum(r["kind"] == "alarm" and r["cause"] == "change" for r in streamed(kind, seed, 1.0))
            told = streamed(kind, seed, 5 / 3)
            rows = [r["row"] for r in told if r["kind"] == "alarm" and r["cause"] == "change"]
            late = next((row - begins for row in rows if row > begins), None)
            named = [c.split()[0] for r in told if r["kind"] == "change" and r["row"] > begins for c in r["changes"]]
            found.append(f"{late} {'+'.join(dict.fromkeys(named))}" + (f" ({len(rows) - 1} more)" if rows[1:] else ""))
        print(f"{name:22} {false} in {2 * begins * options.streams:,}          {'; '.join(found)}", flush=True)


if __name__ == "__main__":
    main()
