"""How fast a stream goes, how much memory it takes, how long a control loop waits for it.

    python benchmarks/streaming.py                  # about two minutes
    python benchmarks/streaming.py --rows 1e5       # half a minute

The job, ``python -m pipelines.stream`` on a CSV file, is watched from outside: rows a second of CPU time and of the
clock once it is under way, and by how much its resident memory grows from a tenth of the rows on.  Then rows go to
``partial_fit`` one by one, as in a control loop, and each call is timed on the CPU clock of its thread: a machine that
is busy with other things does not show in the median, but it does in the worst call.  What is ours and what is the
machine's is separated in two ways.  The same rows are given to the same estimator several times: the least that each
row took is what its work takes, since the stream does the same work at the same row.  And a loop of arithmetic that
takes as long as the median row is timed in the same way, which has no work but that.
"""

from __future__ import annotations

import json
import re
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import click
import numba
import numpy as np

from whsklearn import RLSRegressor, RMILSRegressor, WienerHammersteinLags
from whsklearn.datasets import make_wiener_hammerstein

ROOT = Path(__file__).resolve().parents[1]
LIMIT = 100.0  # microseconds that a row may take


def watch_job(log: Path, rows: int, estimator: str) -> dict[str, Any]:
    """Rows a second and growth of the resident memory of the job on ``log``."""
    import psutil

    out = log.with_suffix(f".{estimator}.jsonl")
    options = ["--estimator", estimator, "--no-track", "--fresh", "--checkpoint-every", "0.5", "--out", str(out)]
    job = psutil.Popen(
        [sys.executable, "-m", "pipelines.stream", str(log), *options], cwd=ROOT, stderr=subprocess.PIPE, text=True
    )
    seen: list[tuple[int, float, float]] = []
    while job.poll() is None:
        time.sleep(0.05)
        try:
            spent, resident = sum(job.cpu_times()[:2]), job.memory_info().rss
        except psutil.Error:
            break
        taken = re.findall(rb'"row": (\d+)', out.read_bytes()[-2000:]) if out.exists() else []
        if taken and resident:
            seen.append((int(taken[-1]), spent, resident / 1e6))
    said = job.communicate()[1]
    if job.wait() != 0:
        raise SystemExit(said)
    early = next(s for s in seen if s[0] >= rows // 10)
    late = [s for s in seen if s[0] >= rows // 10]
    return {
        "estimator": estimator,
        "rows": rows,
        "rows_per_cpu_second": (late[-1][0] - early[0]) / max(late[-1][1] - early[1], 1e-9),
        "rows_per_second": float(re.search(r"(\d+) rows/s", said)[1]),  # type: ignore[index]
        "resident_mb": early[2],
        "growth_mb": max(s[2] for s in late) - early[2],
    }


def latencies(model: Any, X: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Microseconds of CPU of each call of partial_fit with one row."""
    rows = [(X[i : i + 1].copy(), y[i : i + 1].copy()) for i in range(len(y))]
    took = np.empty(len(y))
    for i, (row, target) in enumerate(rows):
        began = time.thread_time_ns()
        model.partial_fit(row, target)
        took[i] = (time.thread_time_ns() - began) / 1e3
    return took


@numba.njit
def arithmetic(steps: int, x: float) -> float:
    """Some nanoseconds a step, in no memory."""
    for i in range(steps):
        x = 0.999999 * x + 1e-9 * i
    return x


def loop_of(microseconds: float, n: int, repeat: int) -> np.ndarray:
    """Microseconds of CPU of ``n`` calls of a loop that takes so long, several times; shape (repeat, n)."""
    arithmetic(10, 1.0)
    began = time.thread_time_ns()
    arithmetic(1_000_000, 1.0)
    steps = int(microseconds * 1e9 / (time.thread_time_ns() - began))
    took = np.empty((repeat, n))
    for k in range(repeat):
        for i in range(n):
            began = time.thread_time_ns()
            arithmetic(steps, 1.0)
            took[k, i] = (time.thread_time_ns() - began) / 1e3
    return took


def told(model: str, when: str, took: np.ndarray) -> list[dict[str, Any]]:
    """Lines of the table of calls of shape (repeat, n): all of them, and the least that each took."""
    lines = []
    for name, t in ((when, took.ravel()), (f"{when}, least of {len(took)}", took.min(axis=0))):
        numbers = {
            "median": np.median(t), "p999": np.quantile(t, 0.999), "p9999": np.quantile(t, 0.9999), "worst": t.max(),
            "above": np.count_nonzero(t > LIMIT), "rows": t.size,
        }  # fmt: skip
        lines.append({"model": model, "when": name} | {k: float(v) for k, v in numbers.items()})
    return lines[: min(len(took), 2)]


def table_of_latencies(n: int, repeat: int, pattern: str) -> list[dict[str, Any]]:
    """Median, tail and worst call, while the memory fills and after, of the models whose name holds ``pattern``."""
    X, y = make_wiener_hammerstein(n_samples=n, snr_db=20, random_state=0)
    columns = np.column_stack([np.roll(X[:, 0], k) for k in range(1, 10)])
    lags = WienerHammersteinLags()
    cases = {
        "RLSRegressor, 9 columns": (RLSRegressor, {}, columns),
        "RMILSRegressor, default": (RMILSRegressor, {"lags": lags, "random_state": 0}, X),
        "RMILSRegressor, memory=512": (RMILSRegressor, {"lags": lags, "random_state": 0, "memory": 512}, X),
        "RMILSRegressor, memory=0": (RMILSRegressor, {"lags": lags, "random_state": 0, "memory": 0}, X),
    }
    table = []
    for name, (cls, options, inputs) in cases.items():
        if pattern not in name:
            continue
        latencies(cls(**options), inputs[:7000], y[:7000])  # loads what is compiled
        took = np.array([latencies(cls(**options), inputs, y) for _ in range(repeat)])
        memory = 0 if "lags" not in options else cls(**options).memory
        if memory:
            table += told(
                name, "memory fills", took[:, 1:memory]
            )  # the first row of all is checked and builds the state
        table += told(name, "after that" if memory else "always", took[:, max(memory, 1) :])
        if name == "RMILSRegressor, default":
            table += told("arithmetic as long as that", "always", loop_of(float(np.median(took)), n, repeat))
    return table


@click.command()
@click.option("--rows", type=float, default=1e6, help="Rows of the file.")
@click.option("--calls", type=float, default=4e4, help="Rows that are timed one by one.")
@click.option("--repeat", type=int, default=3, show_default=True, help="How often the same rows are timed.")
@click.option("--of", "pattern", default="", help="Part of the names of the models whose rows are timed.")
@click.option("--no-job", is_flag=True, help="Rows one by one alone.")
@click.option("--json", "path", type=click.Path(path_type=Path), default=Path("reports/streaming.json"))
def main(rows: float, calls: float, repeat: int, pattern: str, no_job: bool, path: Path) -> None:
    """Measure, and print two tables."""
    results: dict[str, list[dict[str, Any]]] = {"job": [], "latency": []}
    if not no_job:
        results["job"] = table_of_jobs(int(rows))
    click.echo(
        f"\n{'one row, us':28s} {'':30s} {'median':>7s} {'99.9 %':>7s} {'99.99 %':>7s} {'worst':>7s} {'above 100':>16s}"
    )
    results["latency"] = table_of_latencies(int(calls), repeat, pattern)
    for r in results["latency"]:
        click.echo(
            f"{r['model']:28s} {r['when']:30s} {r['median']:7.1f} {r['p999']:7.0f} {r['p9999']:7.0f} {r['worst']:7.0f} "
            f"{r['above']:6.0f} of {r['rows']:6.0f}"
        )
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(results, indent=1))


def table_of_jobs(n: int) -> list[dict[str, Any]]:
    """What the job does with a file of ``n`` rows, an estimator a line."""
    table = []
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder, "log.csv")
        X, y = make_wiener_hammerstein(n_samples=n, snr_db=20, random_state=0)
        with open(log, "w") as file:
            file.write("u,y\n")
            np.savetxt(file, np.column_stack([X[:, 0], y]), delimiter=",", fmt="%.9g")
        click.echo(f"{'stream of a CSV file':24s} {'rows/CPU s':>10s} {'rows/s':>8s} {'MB':>6s} {'growth, MB':>10s}")
        for estimator in ("rmils", "mils", "rls"):
            row = watch_job(log, n, estimator)
            table.append(row)
            click.echo(
                f"{estimator:24s} {row['rows_per_cpu_second']:10.0f} {row['rows_per_second']:8.0f} "
                f"{row['resident_mb']:6.0f} {row['growth_mb']:10.2f}"
            )
    return table


if __name__ == "__main__":
    main()
