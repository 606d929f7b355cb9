"""A diagnosis of five million rows: seconds, of them of CPU, memory, and whether the hidden effect is still named.

    python -m benchmarks.long_log                 # two minutes; a log of 130 MB in a temporary folder

The log is drawn by us from inverse dynamics on two sines at 1 kHz with cogging of 0.3 Nm and order 12 hidden; it goes
through ``whsklearn gap`` in a process of its own.
"""

from __future__ import annotations

import json
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import click
import numpy as np

RATE, BLOCK = 1000.0, 100_000


def write(path: Path, rows: int) -> None:
    """The log, block by block."""
    rng = np.random.default_rng(0)
    with path.open("w") as file:
        file.write("time_s,torque_nm,position_rad\n")
        for begin in range(0, rows, BLOCK):
            t = np.arange(begin, min(begin + BLOCK, rows)) / RATE
            q = 1.5 * np.sin(0.9 * t) + 0.6 * np.sin(2.3 * t + 1.0)
            v = 1.35 * np.cos(0.9 * t) + 1.38 * np.cos(2.3 * t + 1.0)
            a = -1.215 * np.sin(0.9 * t) - 3.174 * np.sin(2.3 * t + 1.0)
            torque = 0.5 * a + 0.3 * v + 0.4 * np.sign(v) + 0.3 * np.sin(12.0 * q) + 0.01 * rng.standard_normal(t.size)
            np.savetxt(file, np.column_stack([t, torque, q + 2e-5 * rng.standard_normal(t.size)]), fmt="%.3f,%.5f,%.6f")


@click.command(help=__doc__.split("\n\n")[0])
@click.option("--rows", type=float, default=5e6, show_default=True)
def main(rows: float) -> None:
    """Draw, diagnose, print."""
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder) / "long.csv"
        write(log, int(rows))
        command = [sys.executable, "-m", "whsklearn", "gap", str(log), "--no-track", "--report", f"{folder}/gap"]
        began = time.monotonic()
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        took = time.monotonic() - began
        used = resource.getrusage(resource.RUSAGE_CHILDREN)
        cpu, peak = used.ru_utime + used.ru_stime, used.ru_maxrss / 1e6
        size = log.stat().st_size / 1e6
        print(
            f"{rows:.0f} rows, {size:.0f} MB: status {done.returncode}, {took:.0f} s ({cpu:.0f} s CPU), {peak:.2f} GB"
        )
        if done.returncode == 0:
            found = json.loads((Path(folder) / "gap" / "gap.json").read_text())
            print(found["verdict"], [(e["name"], e["parameters"]) for e in found["effects"]])
        else:
            print(done.stderr[-500:])


if __name__ == "__main__":
    main()
