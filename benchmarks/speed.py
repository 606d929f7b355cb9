"""Speed beside other packages: same machine, same problem, same answer, medians of several runs.

Run ``make bench`` or ``python -m benchmarks.speed``, with OMP_NUM_THREADS=1 as nothing here gains from more.
Where there is a compiler, `reference.c` is compiled (plain C, gcc -O3) and does the same arithmetic in the same run.
Peers that are not installed are left out and named; sysidentpy wants an older NumPy than the newest, so a virtual
environment of its own is the place to have them all.  Times are of the CPU; where two threads work, half of what both
take, which is the time of the clock on two cores that nobody else uses.  Ratios hold from machine to machine, absolute
times do not.
"""

from __future__ import annotations

import json
import os
import statistics
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import click
import numpy as np

from benchmarks._c_reference import c_axes, c_calls, c_rmils, c_rows
from benchmarks._peers import (
    P0,
    Answer,
    Array,
    filterpy,
    numpy_axes,
    numpy_rmils,
    numpy_rows,
    padasip,
    river,
    statsmodels,
    sysidentpy,
)
from whsklearn import RLSRegressor, RMILSRegressor, WienerHammersteinLags
from whsklearn.datasets import make_wiener_hammerstein
from whsklearn.estimators._model import paper_vector
from whsklearn.recursion.memory import multistart
from whsklearn.recursion.rows.batched import least_squares_of_many

Contender = Callable[[], Answer]


def our_rows(X: Array, y: Array) -> Answer:
    """RLSRegressor.partial_fit, a row a call."""
    model = RLSRegressor(P0=P0).partial_fit(X[:1], y[:1])
    rows = [(X[i : i + 1].copy(), y[i : i + 1].copy()) for i in range(1, len(y))]
    began = time.process_time()
    for row, target in rows:
        model.partial_fit(row, target)
    return model.theta_, time.process_time() - began


def our_array(X: Array, y: Array) -> Answer:
    """RLSRegressor.fit, validation and all."""
    began = time.process_time()
    model = RLSRegressor(P0=P0).fit(X, y)
    return model.theta_, time.process_time() - began


def our_axes(X: Array, y: Array, threads: int) -> Answer:
    """least_squares_of_many."""
    began = time.process_time()
    theta, _ = least_squares_of_many(X, y, P0=P0, n_jobs=threads)
    return theta, (time.process_time() - began) / threads


def sgd_rows(X: Array, y: Array) -> Answer:
    """SGDRegressor.partial_fit: another algorithm, the price of a row through scikit-learn's validation."""
    from sklearn.linear_model import SGDRegressor

    model = SGDRegressor().partial_fit(X[:1], y[:1])
    began = time.process_time()
    for i in range(1, len(y)):
        model.partial_fit(X[i : i + 1], y[i : i + 1])
    return np.full(X.shape[1], np.nan), time.process_time() - began


def our_rmils(X: Array, y: Array, gradient: str) -> Answer:
    """RMILSRegressor, p = 4, one start, no memory: the recursion alone."""
    options = {"n_starts": 1, "memory": 0, "random_state": 0} if gradient == "full" else {"P0": P0}
    model = RMILSRegressor(WienerHammersteinLags(), p=4, gradient=gradient, **options)
    model.partial_fit(X[:1], y[:1])
    began = time.process_time()
    model.partial_fit(X[1:], y[1:])
    spent = time.process_time() - began  # what it takes to tell theta_ is in the last table
    return model.theta_, spent


def race(contenders: dict[str, Contender], reference: Array | None, per: int, repeat: int) -> list[dict[str, Any]]:
    """Median microseconds of each, turn by turn so that all feel the same load, and how well the answers agree."""
    seconds: dict[str, list[float]] = {name: [] for name in contenders}
    notes = dict.fromkeys(contenders, "")
    for turn in range(repeat + 1):  # the first turn compiles and is not counted
        for name, contender in contenders.items():
            if notes[name].startswith("not installed"):
                continue
            try:
                theta, spent = contender()
            except ImportError as error:
                notes[name] = f"not installed: {error.name}"
                continue
            if reference is not None and np.isfinite(theta).all():
                off = float(np.max(np.abs(theta - reference)) / np.max(np.abs(reference)))
                notes[name] = f"agrees to {max(off, 1e-16):.0e}"
                if off > 1e-5:
                    raise SystemExit(f"{name} answers another problem: its theta is off by {off:.1e}.")
            elif reference is not None:
                notes[name] = "another algorithm"
            if turn:
                seconds[name].append(spent)
    medians = {name: 1e6 * statistics.median(s) / per for name, s in seconds.items() if s}
    ours = next(iter(medians.values()))
    return [
        {"name": n, "us": medians.get(n), "ratio": medians[n] / ours if n in medians else None, "note": notes[n]}
        for n in contenders
    ]


def ridge(X: Array, y: Array) -> Array:
    """What recursive least squares from P0 I must answer."""
    return np.linalg.solve(X.T @ X + np.eye(X.shape[1]) / P0, X.T @ y)


def one_row(repeat: int) -> list[dict[str, Any]]:
    X, y = _problem(2000)
    peers = {"river": river, "padasip": padasip, "filterpy": filterpy, "sysidentpy": sysidentpy, "NumPy": numpy_rows}
    runs = {"whsklearn": our_rows, "C, a call a row": c_calls, "C, arithmetic alone": c_rows}
    runs |= {**peers, "scikit-learn SGD": sgd_rows}
    return race({n: (lambda f=f: f(X, y)) for n, f in runs.items()}, ridge(X, y), len(y), repeat)


def whole_array(repeat: int) -> list[dict[str, Any]]:
    X, y = _problem(20_000)
    runs = {"whsklearn": our_array, "C": c_rows, "statsmodels": statsmodels, "padasip": padasip, "NumPy": numpy_rows}
    return race({n: (lambda f=f: f(X, y)) for n, f in runs.items()}, ridge(X, y), len(y), repeat)


def rmils(repeat: int) -> list[dict[str, Any]]:
    X, y = make_wiener_hammerstein(n_samples=2000, snr_db=20, random_state=0)
    short = slice(0, 300)  # the published reading is chaotic: rounding of 1e-16 shows after some hundreds of samples
    same = our_rmils(X[short], y[short], "pseudolinear")[0], numpy_rmils(X[short, 0], y[short], 4)[0]
    off = float(np.max(np.abs(same[0] - same[1])) / np.max(np.abs(same[1])))
    start = first_start(X, y)
    rows = race(
        {
            "whsklearn, exact gradient": lambda: our_rmils(X, y, "full"),
            "C, exact gradient": lambda: c_rmils(X[:, 0], y, start),
            "C, orders at run time": lambda: c_rmils(X[:, 0], y, start, at_run_time=True),
            "whsklearn, as published": lambda: our_rmils(X, y, "pseudolinear"),
            "NumPy, as published": lambda: numpy_rmils(X[:, 0], y, 4),
        },
        None,
        len(y),
        repeat,
    )
    rows[0]["note"] = "any orders and law, 4 UD updates are a third of it"
    for row, how, at_run_time in zip(rows[1:3], ("fixed when compiled", "as ours"), (False, True), strict=True):
        if row["us"] is not None:
            ours, theirs = our_rmils(X, y, "full")[0], c_rmils(X[:, 0], y, start, at_run_time=at_run_time)[0]
            row["note"] = f"orders {how}; agrees to {np.max(np.abs(in_paper_order(theirs) - ours)):.0e}"
    rows[3]["note"] = rows[4]["note"] = f"both agree to {off:.0e} after 300 samples"
    return rows


def exact_gradient() -> RMILSRegressor:
    """RMILS, p = 4, one start and no memory."""
    return RMILSRegressor(WienerHammersteinLags(), p=4, n_starts=1, memory=0, random_state=0)


def first_start(X: Array, y: Array) -> Array:
    """The natural parameters that `our_rmils` begins with."""
    model = exact_gradient().partial_fit(X[:1], y[:1])
    return np.array(multistart.initial_state(model._make_stream(1, model.state_["seed"]).settings)["theta"][0])


def in_paper_order(natural: Array) -> Array:
    """Natural parameters of Example 5.1's structure as theta of (6)."""
    return paper_vector(natural, exact_gradient().partial_fit(np.ones((1, 1)), np.ones(1))._structure())


def many_axes(repeat: int) -> list[dict[str, Any]]:
    rng = np.random.default_rng(0)
    X = rng.normal(size=(1000, 1000, 9))
    y = X @ np.arange(1.0, 10.0) + 0.1 * rng.normal(size=(1000, 1000))
    reference = np.array([ridge(a, b) for a, b in zip(X, y, strict=True)])
    runs = {
        "whsklearn, 2 threads": lambda: our_axes(X, y, 2),
        "whsklearn, 1 thread": lambda: our_axes(X, y, 1),
        "C, 8 abreast, 2 threads": lambda: c_axes(X, y, 2, abreast=True),
        "C, one by one, 2 threads": lambda: c_axes(X, y, 2, abreast=False),
        "NumPy batched": lambda: numpy_axes(X, y),
    }
    return race(runs, reference, X.shape[0] * X.shape[1], repeat)


def import_time(repeat: int) -> list[dict[str, Any]]:
    """What ``import whsklearn`` adds to scikit-learn's own, each in a fresh process; in us as all rows."""
    code = "import time, sklearn.base, sklearn.utils.validation as v; t = time.perf_counter(); import whsklearn; "
    run = [sys.executable, "-c", code + "print(time.perf_counter() - t)"]
    env = {k: v for k, v in os.environ.items() if k != "PYTHONDONTWRITEBYTECODE"}  # installed code is compiled once
    took = [
        float(subprocess.run(run, check=True, capture_output=True, text=True, env=env).stdout)
        for _ in range(repeat + 1)
    ]
    seconds = statistics.median(took[1:])
    return [
        {"name": "import whsklearn", "us": 1e6 * seconds, "ratio": 1.0, "note": f"{seconds:.2f} s after scikit-learn"}
    ]


def answers(repeat: int) -> list[dict[str, Any]]:
    """What it takes to tell `theta_` after a stream of Example 5.1, a seed a run; ratios to the first line."""
    rows: list[dict[str, Any]] = []
    for n in (300, 1000, 4000, 20_000):
        for snr_db in (7.462, 20.0, 40.0):
            spent = []
            for seed in range(repeat + 1):
                X, y = make_wiener_hammerstein(n, snr_db=snr_db, random_state=seed)
                model = RMILSRegressor(WienerHammersteinLags(), random_state=seed).partial_fit(X, y)
                began = time.process_time()
                model.theta_  # noqa: B018
                spent.append(1e6 * (time.process_time() - began))
            us = statistics.median(spent[1:])  # the first may compile
            note = f"at most {max(spent[1:]) / 1e3:.0f} ms"
            rows.append(
                {
                    "name": f"{n} rows at {snr_db:.1f} dB",
                    "us": us,
                    "ratio": us / (rows[0]["us"] if rows else us),
                    "note": note,
                }
            )
    return rows


def _problem(n: int) -> tuple[Array, Array]:
    """n rows of nine regressors."""
    rng = np.random.default_rng(0)
    X = rng.normal(size=(n, 9))
    return X, X @ np.arange(1.0, 10.0) + 0.1 * rng.normal(size=n)


TABLES: dict[str, tuple[str, Callable[[int], list[dict[str, Any]]]]] = {
    "row": ("one row through partial_fit, n = 9; reach 1 us", one_row),
    "array": ("a whole array, n = 9, per sample; reach 0.12 us", whole_array),
    "rmils": ("RMILS, p = 4, per sample and start; reach 0.6 us", rmils),
    "axes": ("1,000 axes x 1,000 samples, per update; reach 0.025 us on 2 threads", many_axes),
    "import": ("import, reach 0.7 s", import_time),
    "answer": ("what a stream answers: theta_, worked out once for a state", answers),
}


@click.command()
@click.option("--repeat", type=click.IntRange(1), default=5, help="Runs of which the median counts.")
@click.option("--only", type=click.Choice(sorted(TABLES)), multiple=True, help="Some of the tables.")
@click.option("--json", "path", type=click.Path(path_type=Path), default=Path("reports/speed.json"))
def main(repeat: int, only: tuple[str, ...], path: Path) -> None:
    """Race, and print tables with ratios to whsklearn."""
    results = {}
    for key, (title, table) in TABLES.items():
        if only and key not in only:
            continue
        results[key] = table(repeat)
        click.echo(f"\n{title}\n{'':28s} {'us':>10s} {'ratio':>8s}")
        for r in results[key]:
            numbers = f"{r['us']:10.3f} {r['ratio']:8.1f}" if r["us"] is not None else f"{'-':>10s} {'-':>8s}"
            click.echo(f"{r['name']:28s} {numbers}  {r['note']}")
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(results, indent=1))


if __name__ == "__main__":
    main()
