"""A stream whose MLflow server hangs or dies in mid-run: how long SIGTERM takes, how old a checkpoint gets.

    python -m benchmarks.dead_server

(extra ``mlflow``.)  A log grows by 200 rows a second while a stream follows it and records in a real server; after half
of the time the server is stopped (SIGSTOP: it takes connections and answers none) or killed.  At the end the stream
gets SIGTERM.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tempfile
import time
import urllib.request
from pathlib import Path

import click
import numpy as np

from whsklearn.cli.ui import free_port, serve, stop, wait_for

ARGUMENTS = "--follow --time t --input u --output y --estimator rls --every 20 --checkpoint-every 1".split()


def answers(port: int) -> bool:
    """Whether the server is there."""
    try:
        urllib.request.urlopen(f"http://127.0.0.1:{port}/health", timeout=2).close()
    except OSError:
        return False
    return True


def trial(how: str, seconds: float, folder: Path) -> str:
    """One run; what was measured as a line."""
    port = free_port(5077)
    server = serve(f"sqlite:///{folder}/mlflow.db", port)
    wait_for(server, port)
    while not answers(port):
        time.sleep(0.3)
    log = folder / "log.csv"
    log.write_text("t,u,y\n")
    command = [sys.executable, "-m", "whsklearn", "stream", str(log), *ARGUMENTS, "--out", str(folder / "out.jsonl")]
    env = {**os.environ, "MLFLOW_TRACKING_URI": f"http://127.0.0.1:{port}"}
    with (folder / "err").open("w") as said:
        job = subprocess.Popen(command, env=env, stderr=said, stdout=subprocess.DEVNULL)
    rng, row, ages, hit = np.random.default_rng(0), 0, [0.0], False
    kept = Path(f"{log}.whs")
    while not kept.exists() and job.poll() is None:  # the first checkpoint: the stream has begun
        time.sleep(0.2)
    began = time.monotonic()
    while (spent := time.monotonic() - began) < seconds:
        with log.open("a") as file:
            for _ in range(20):
                u = rng.normal()
                file.write(f"{0.01 * row:.2f},{u:.5f},{2 * u + 0.1 * rng.normal():.5f}\n")
                row += 1
        time.sleep(0.1)
        if not hit and spent > seconds / 2 and how != "lives":
            os.killpg(server.pid, signal.SIGSTOP if how == "hangs" else signal.SIGKILL)
            hit = True
        if kept.exists():
            ages.append(time.time() - kept.stat().st_mtime)
    asked = time.monotonic()
    job.send_signal(signal.SIGTERM)
    try:
        job.wait(60)
    except subprocess.TimeoutExpired:
        job.kill()
        job.wait()
    took = time.monotonic() - asked
    if how == "hangs":
        os.killpg(server.pid, signal.SIGCONT)
    stop(server)
    last = (folder / "err").read_text().strip().splitlines()[-1]
    return (
        f"server {how}: SIGTERM took {took:.2f} s, oldest checkpoint {max(ages):.1f} s, status {job.returncode}; {last}"
    )


@click.command(help=__doc__)
@click.option("--seconds", default=24.0, help="Length of each run.")
def main(seconds: float) -> None:
    for how in ("lives", "hangs", "dies"):
        with tempfile.TemporaryDirectory() as folder:
            click.echo(trial(how, seconds, Path(folder)))


if __name__ == "__main__":
    main()
