"""Commands that are ended in mid-run: how long they take to go, and what stands in the tracking store after them.

    python -m benchmarks.interruptions --repeats 3

(extra ``mlflow``.) Each command runs in a process of its own and records in a store of its own. Once a run is RUNNING
there it gets SIGTERM or SIGINT (Ctrl-C) after a drawn time, or twice in a second as an impatient hand does. A
run that is still RUNNING afterwards would stand in the table for ever.
"""

from __future__ import annotations

import os
import signal
import sqlite3
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

import click
import numpy as np

from whsklearn.datasets import make_servo_log

LOG = "--drive torque_nm --position position_rad".split()
ROWS = "--input torque_nm --output velocity_rad_s --time time_s".split()
COMMANDS = {
    "gap": ["gap", "axis.csv", *LOG, "--report", "report"],
    "identify": ["identify", "axis.csv", "--input", "torque_nm", "--output", "position_rad", "--out", "model"],
    "tune": ["tune", "--samples", "5000", "--p", "1,2,4,8", "--P0", "1,100,1e6"],
    "stream": ["stream", "axis.csv", *ROWS, "--follow", "--every", "50", "--out", "out.jsonl"],
    "fleet": ["fleet", "logs", *ROWS, "--in-process", "--out", "fleet.parquet"],
}
DEADLINE = 60.0


def material(folder: Path) -> None:
    """A servo log as a file, and a fleet of it."""
    frame = make_servo_log(["cogging"], duration=40.0, random_state=0)
    frame["velocity_rad_s"] = np.gradient(frame["position_rad"], frame["time_s"])
    frame.to_csv(folder / "axis.csv", index=False)
    for k in range(12):
        home = folder / "logs" / f"axis=joint{k:02d}"
        home.mkdir(parents=True)
        frame.to_parquet(home / "part.parquet", index=False)


def statuses(store: Path) -> list[str]:
    """Of all runs in a store; empty while there is none."""
    if not store.exists():
        return []
    try:
        with sqlite3.connect(f"file:{store}?mode=ro", uri=True, timeout=5.0) as db:
            return [row[0] for row in db.execute("select status from runs")]
    except sqlite3.OperationalError:  # tables not made yet
        return []


def trial(name: str, how: str, after: float, folder: Path) -> tuple[str, float, list[str], int]:
    """(what happened, seconds from the signal to the end, statuses afterwards, exit status)."""
    store = folder / f"{name}.db"
    env = os.environ | {"MLFLOW_TRACKING_URI": f"sqlite:///{store}"}
    with (folder / "said.txt").open("w") as said:
        process = subprocess.Popen(
            [sys.executable, "-m", "whsklearn", *COMMANDS[name]], cwd=folder, env=env, stdout=said, stderr=said,
            preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
        )  # fmt: skip
    began = time.monotonic()
    while "RUNNING" not in statuses(store) and process.poll() is None and time.monotonic() - began < DEADLINE:
        time.sleep(0.05)
    time.sleep(after)
    if process.poll() is not None:
        return "was over before", 0.0, statuses(store), process.returncode
    sent = time.monotonic()
    for _ in range(2 if how == "twice" else 1):
        process.send_signal(signal.SIGTERM if how == "SIGTERM" else signal.SIGINT)
        time.sleep(0.4 if how == "twice" else 0.0)
    try:
        process.wait(DEADLINE)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()
        return "did not end", DEADLINE, statuses(store), process.returncode
    return "ended", time.monotonic() - sent, statuses(store), process.returncode


@click.command(help=__doc__)
@click.option("--repeats", default=3, help="Trials of every command and signal.")
@click.option("--seed", default=0, help="Of the times after which a signal is sent.")
@click.option("--only", default="", help=f"Only these commands, joined by commas: {','.join(COMMANDS)}.")
def main(repeats: int, seed: int, only: str) -> None:
    rng = np.random.default_rng(seed)
    total: Counter[str] = Counter()
    for name in COMMANDS:
        if only and name not in only.split(","):
            continue
        for how in ("SIGTERM", "SIGINT", "twice"):
            for _ in range(repeats):
                after = float(rng.uniform(0.0, 3.0))
                with tempfile.TemporaryDirectory() as name_of_folder:
                    folder = Path(name_of_folder)
                    material(folder)
                    what, seconds, left, code = trial(name, how, after, folder)
                    said = (folder / "said.txt").read_text().strip().splitlines()
                open_runs = left.count("RUNNING")
                total.update(trials=1, **{what: 1}, open=int(open_runs > 0), traceback=int("Traceback" in str(said)))
                counts = ", ".join(f"{n} {s}" for s, n in sorted(Counter(left).items())) or "no run"
                last = said[-1][:60] if said else ""
                click.echo(
                    f"{name:<10}{how:<9}{after:5.1f} s  {what}, {seconds:5.1f} s, exit {code}: {counts}   {last}"
                )
    click.echo(
        f"{total['trials']} trials, {total['ended']} ended in mid-run, {total['was over before']} over before, "
        f"{total['did not end']} did not end; with a run left RUNNING: {total['open']}; with a traceback: "
        f"{total['traceback']}"
    )


if __name__ == "__main__":
    main()
