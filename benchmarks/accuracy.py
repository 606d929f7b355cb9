"""How accurate the estimators are, measured: the paper's example, long records, other systems, p, intervals.

    python benchmarks/accuracy.py                    # everything, about 25 minutes on 2 cores
    python benchmarks/accuracy.py --section example --runs 20
    python benchmarks/accuracy.py --section example --runs 100 --out reports/accuracy    # goes on from the 20, if there

Every figure is of the free run against noise-free output, each run averaged over three
fresh records of 1,000 samples.  Seeds are 0, 1, 2, ...; none is left out.  Intervals are
95 % bootstrap intervals of the median, or Wilson intervals of a share.
"""

from __future__ import annotations

import json
import pathlib
import time
import warnings
from typing import Any, NamedTuple

import click
import numpy as np
from joblib import Parallel, delayed
from scipy.signal import lfilter
from scipy.stats import bootstrap
from tqdm import tqdm

from benchmarks.blind import wilson
from whsklearn import PEMRegressor, RLSRegressor, RMILSRegressor, WienerHammersteinLags, WienerHammersteinSystem
from whsklearn.datasets import make_wiener_hammerstein
from whsklearn.effects import FrictionLaw, reduced_law
from whsklearn.estimators.base import OUTPUTS
from whsklearn.metrics import nmse
from whsklearn.recursion.memory.starts import random_stable

SNR_DB = 7.462
LENGTHS = (250, 500, 1000)
INNOVATION_LENGTHS = (1, 2, 4, 8, 16)


def free_run_nmse(model: Any, system: WienerHammersteinSystem, seed: int, **options: Any) -> float:
    """NMSE of the free run, averaged over three fresh noise-free records."""
    errors = []
    for k in range(3):
        X, y = make_wiener_hammerstein(1000, snr_db=None, random_state=[seed, 77, k], system=system)
        errors.append(nmse(y, model.predict(X, **options)))
    return float(np.mean(errors))


def random_system(seed: int) -> WienerHammersteinSystem:
    """Orders of 1 to 3, stable blocks, a law of (4)'s form."""
    rng = np.random.default_rng([seed, 5])
    n_a, n_b, n_c, n_d = rng.integers(1, 4, 4)
    a = np.concatenate([[1.0], rng.normal(0, 0.8, n_a - 1)])
    c = np.concatenate([[1.0], rng.normal(0, 0.8, n_c - 1)])
    law = reduced_law(rng.uniform(0.02, 0.5), rng.uniform(0.3, 1.0), rng.uniform(0.1, 0.5))
    return WienerHammersteinSystem(a, random_stable(n_b, rng), c, random_stable(n_d, rng), law)


def lags_of(system: WienerHammersteinSystem) -> WienerHammersteinLags:
    """Lags of the system's own orders and law."""
    law: FrictionLaw = system.law
    return WienerHammersteinLags(system.a.size, system.b.size, system.c.size, system.d.size, law=law)


def one_example(seed: int, n_samples: int, pem: bool) -> dict[str, float]:
    """RMILS by default, the pure recursion, and PEM on one record of Example 5.1."""
    system = WienerHammersteinSystem.example()
    X, y = make_wiener_hammerstein(n_samples, snr_db=SNR_DB, random_state=seed)
    models = {
        "RMILS": RMILSRegressor(WienerHammersteinLags(), random_state=seed),
        "RMILS, memory=0": RMILSRegressor(WienerHammersteinLags(), memory=0, P0=1.0, random_state=seed),
        "RMILS, published": RMILSRegressor(WienerHammersteinLags(), gradient="pseudolinear", P0=1e6),
    }
    if pem:
        models["PEM"] = PEMRegressor(WienerHammersteinLags(), random_state=seed)
    out = {}
    for name, model in models.items():
        out[name] = free_run_nmse(model.fit(X, y), system, seed)
    stream = RMILSRegressor(WienerHammersteinLags(), random_state=seed).partial_fit(X, y)
    out["RMILS, partial_fit only"] = free_run_nmse(stream, system, seed)
    return out


def one_system(seed: int) -> dict[str, Any]:
    """RMILS by default and PEM on one random system at 20 dB."""
    system = random_system(seed)
    X, y = make_wiener_hammerstein(1000, snr_db=20.0, random_state=[seed, 6], system=system)
    out: dict[str, Any] = {"orders": [int(v.size) for v in (system.a, system.b, system.c, system.d)]}
    for name, model in (
        ("RMILS", RMILSRegressor(lags_of(system), random_state=seed)),
        ("RMILS, memory=0", RMILSRegressor(lags_of(system), memory=0, P0=1.0, random_state=seed)),
        ("RMILS, published", RMILSRegressor(lags_of(system), gradient="pseudolinear", P0=1e6)),
        ("PEM", PEMRegressor(lags_of(system), n_starts=32, random_state=seed)),
    ):
        out[name] = free_run_nmse(model.fit(X, y), system, seed)
        if name == "RMILS":
            for output in OUTPUTS:
                out[f"RMILS, {output}"] = free_run_nmse(model, system, seed, output=output)
    return out


def one_at_output(seed: int, snr_db: float) -> dict[str, float]:
    """RMILS with its usual memory and one that holds all 20,000 rows; white noise at the output of a drawn chain."""
    rng = np.random.default_rng([seed, 52])
    l1, l2 = [(np.poly(rng.uniform(-0.6, 0.9, 2)), np.poly(rng.uniform(-1.6, 0.9, 1))) for _ in range(2)]
    viscous, coulomb = rng.uniform(0.3, 1.0), rng.uniform(0.3, 1.0)

    def run(u: Any) -> Any:
        dx = np.diff(lfilter(np.append(0.0, l1[1]), l1[0], u), prepend=0.0)
        return lfilter(np.append(0.0, l2[1]), l2[0], viscous * dx + coulomb * np.sign(dx))

    u = rng.standard_normal(20_000)
    y = run(u)
    y = y + np.sqrt(np.var(y) / 10 ** (snr_db / 10)) * rng.standard_normal(u.size)
    fresh = [rng.standard_normal(1000) for _ in range(3)]
    out = {}
    for name, memory in (("RMILS", 4096), ("RMILS, memory of the record", u.size + 1)):
        lags = WienerHammersteinLags(2, 2, 2, 2, law="viscous,coulomb")
        with warnings.catch_warnings():  # the noise is not what the criterion assumes, and fit says so
            warnings.simplefilter("ignore")
            model = RMILSRegressor(lags, memory=memory, random_state=0).fit(u[:, None], y)
            out[name] = float(np.mean([nmse(run(v), model.predict(v[:, None])) for v in fresh]))
    return out


def one_length(seed: int, p: int, n_samples: int, memory: int) -> float:
    """RMILS with one innovation length."""
    X, y = make_wiener_hammerstein(n_samples, snr_db=SNR_DB, random_state=seed)
    P0 = None if memory else 1.0
    model = RMILSRegressor(WienerHammersteinLags(), p=p, memory=memory, P0=P0, random_state=seed)
    return free_run_nmse(model.fit(X, y), WienerHammersteinSystem.example(), seed)


def one_coverage(seed: int) -> dict[str, Any]:
    """Whether 95 % intervals hold the truth: RLS on the true regressors, PEM on Example 5.1."""
    X, y, truth = make_wiener_hammerstein(1000, snr_db=SNR_DB, random_state=seed, return_truth=True)
    rows = WienerHammersteinLags(theta=truth.theta).fit_transform(X, y)
    rls = RLSRegressor(P0=1e8).fit(rows, y)
    pem = PEMRegressor(WienerHammersteinLags(), random_state=seed).fit(X, y)
    out: dict[str, Any] = {}
    for name, model in (("RLS", rls), ("PEM", pem)):
        z = (model.theta_ - truth.theta) / model.standard_errors_
        out[name] = (np.abs(z) < 1.96).tolist()
    system = truth.system
    named, errors = pem.parameters_, pem.parameter_standard_errors_
    true = {"a": system.a[1:], "b": system.b, "c": system.c[1:], "d": system.d}
    z = [(named[k][-v.size :] - v) / errors[k][-v.size :] for k, v in true.items()]
    z += [np.array([(named[k] - w) / errors[k]]) for k, w in zip(system.law.labels, system.law.weights, strict=True)]
    out["PEM, natural"] = (np.abs(np.concatenate(z)) < 1.96).tolist()
    return out


def one_posterior(seed: int, n_samples: int, snr_db: float) -> dict[str, Any]:
    """Errors of one pass of RMILS over Example 5.1 in standard errors, and the share of 95 % intervals that hold."""
    X, y, truth = make_wiener_hammerstein(n_samples, snr_db=snr_db, random_state=seed, return_truth=True)
    model = RMILSRegressor(WienerHammersteinLags(), random_state=seed).partial_fit(X, y)
    system, named, errors = truth.system, model.parameters_, model.parameter_standard_errors_
    true = {"a": system.a[1:], "b": system.b, "c": system.c[1:], "d": system.d}
    z = [(named[k][-v.size :] - v) / errors[k][-v.size :] for k, v in true.items()]
    z += [np.array([(named[k] - w) / errors[k]]) for k, w in zip(system.law.labels, system.law.weights, strict=True)]
    out = {"z": np.concatenate(z).tolist()}
    for output in ("expected", "simulation"):
        out[output] = free_run_nmse(model, system, seed, output=output)
    return out


def one_minimum(seed: int, perturbation: float = 0.0) -> float:
    """Innovation variance of one pass over Example 5.1: 1.8 times the others' in a wrong minimum.

    Each number of the log is changed by about ``perturbation`` of itself: 1e-12 stands for another processor's digits.
    """
    X, y = make_wiener_hammerstein(1000, snr_db=SNR_DB, random_state=seed)
    rng = np.random.default_rng([seed, 9])
    X, y = (v * (1.0 + perturbation * rng.standard_normal(v.shape)) for v in (X, y))
    return RMILSRegressor(WienerHammersteinLags(), random_state=seed).partial_fit(X, y).innovation_variance_


def median_interval(values: Any) -> tuple[float, float, float]:
    """Median with its 95 % bootstrap interval."""
    values = np.asarray(values)
    if values.size < 3:
        return float(np.median(values)), float(values.min()), float(values.max())
    ci = bootstrap((values,), np.median, n_resamples=2000, rng=0, method="percentile").confidence_interval
    return float(np.median(values)), float(ci.low), float(ci.high)


def run_all(
    function: Any, tasks: list[tuple[Any, ...]], label: str, n_jobs: int, record: dict[str, Any], key: str
) -> list[Any]:
    """Run tasks with a progress bar, in order, but for those that ``record`` holds already; they end up there."""
    done = record.get(key, [])[: len(tasks)]
    left = tasks[len(done) :]
    results = Parallel(n_jobs=n_jobs, return_as="generator")(delayed(function)(*task) for task in left)
    record[key] = done + list(tqdm(results, total=len(left), desc=label, disable=None))
    return record[key]


def spread(rows: list[dict[str, Any]], title: str) -> list[str]:
    """A table of NMSE by estimator."""
    head = "| estimator | median | 95 % interval | 95th percentile | worst |"
    lines = [f"\n### {title}\n", head, "|---|---|---|---|---|"]
    for name in rows[0]:
        if name == "orders":
            continue
        v = np.array([r[name] for r in rows])
        m, low, high = median_interval(v)
        lines.append(f"| {name} | {m:.4f} | {low:.4f} to {high:.4f} | {np.quantile(v, 0.95):.4f} | {v.max():.4f} |")
    return lines


class Asked(NamedTuple):
    """What is asked of a section; ``runs`` is None for its own default."""

    runs: int | None
    jobs: int
    record: dict[str, Any]
    first_seed: int
    perturbation: float

    def seeds(self, default: int) -> range:
        """As many as asked, from the first."""
        return range(self.first_seed, self.first_seed + (self.runs or default))


def example(asked: Asked) -> list[str]:
    """Example 5.1, and the recursions as a share of PEM."""
    tasks = [(s, 1000, True) for s in range(asked.runs or 100)]
    rows = run_all(one_example, tasks, "Example 5.1", asked.jobs, asked.record, "example")
    lines = spread(rows, f"Example 5.1, N = 1,000, 7.462 dB, {len(rows)} seeds: free-run NMSE")
    lines += ["\n| as a share of PEM's | median | mean | 95th percentile |", "|---|---|---|---|"]
    for name in ("RMILS", "RMILS, partial_fit only"):
        ours, pem = np.array([[r[name], r["PEM"]] for r in rows]).T
        shares = [f(ours) / f(pem) for f in (np.median, np.mean, lambda v: np.quantile(v, 0.95))]
        lines.append(f"| {name} | " + " | ".join(f"{s:.2f}" for s in shares) + " |")
    return lines


def long(asked: Asked) -> list[str]:
    """Ten times as many samples."""
    tasks = [(s, 10_000, False) for s in range(asked.runs or 30)]
    rows = run_all(one_example, tasks, "N = 10,000", asked.jobs, asked.record, "long")
    return spread(rows, f"The same, N = 10,000, {len(rows)} seeds")


def systems(asked: Asked) -> list[str]:
    """Random systems, and how often an estimator is near PEM."""
    tasks = [(s,) for s in asked.seeds(50)]
    rows = run_all(one_system, tasks, "random systems", asked.jobs, asked.record, f"systems from {asked.first_seed}")
    lines = spread(rows, f"{len(rows)} random stable systems, N = 1,000, 20 dB") + shares_of_pem(rows)
    for name in ("RMILS", "RMILS, memory=0", "RMILS, published"):
        good = sum(r[name] <= 2 * r["PEM"] for r in rows)
        _, low, high = wilson(good, len(rows))
        lines.append(f"\n{name} within 2 times PEM: {good} of {len(rows)} (95 % interval {low:.2f} to {high:.2f}).")
    return lines


def output(asked: Asked) -> list[str]:
    """Noise at the output, whose error a long memory would not have."""
    lines = []
    for snr_db in (20.0, 10.0):
        tasks, key = [(s, snr_db) for s in asked.seeds(12)], f"{snr_db} dB from {asked.first_seed}"
        rows = run_all(one_at_output, tasks, f"output {snr_db} dB", asked.jobs, asked.record, key)
        lines += spread(rows, f"{len(rows)} chains, N = 20,000, {snr_db:.0f} dB at the output")
        ours, remembered = np.array([list(r.values()) for r in rows]).T
        ratios = ours / remembered
        lines.append(f"\nNMSE over that of the long memory: {np.exp(np.log(ratios).mean()):.2f} in the geometric ")
        lines[-1] += f"mean, {ratios.max():.1f} at most."
    return lines


def minima(asked: Asked) -> list[str]:
    """How often a stream is in a wrong minimum."""
    tasks = [(s, asked.perturbation) for s in asked.seeds(500)]
    key = f"minima, from {asked.first_seed}, {asked.perturbation}"
    variance = np.array(run_all(one_minimum, tasks, "minima", asked.jobs, asked.record, key))
    wrong = int(np.sum(variance > 1.45 * np.median(variance)))
    _, low, high = wilson(wrong, variance.size)
    told = f"\npartial_fit of 1,000 rows in a wrong minimum: {wrong} of {variance.size} seeds "
    return [told + f"(95 % interval {100 * low:.1f} to {100 * high:.1f} %)."]


def shares_of_pem(rows: list[dict[str, Any]]) -> list[str]:
    """A table of NMSE over PEM's: what `predict` gives, both outputs, and the better of them with the truth in hand."""
    lines = ["\n| over PEM | geometric mean | 95 % interval | median | ratio of means |", "|---|---|---|---|---|"]
    better = [min(r[f"RMILS, {output}"] for output in OUTPUTS) for r in rows]
    told = {"RMILS": [r["RMILS"] for r in rows]} | {f"its {o} alone": [r[f"RMILS, {o}"] for r in rows] for o in OUTPUTS}
    pem = np.array([r["PEM"] for r in rows])
    for name, values in (told | {"the better of the two, of each system": better}).items():
        logs = np.log(np.array(values) / pem)
        draws = np.random.default_rng(0).choice(logs, (2000, logs.size)).mean(axis=1)
        low, high = np.exp(np.quantile(draws, [0.025, 0.975]))
        lines.append(
            f"| {name} | {np.exp(logs.mean()):.2f} | {low:.2f} to {high:.2f} | {np.exp(np.median(logs)):.2f} "
            f"| {np.mean(values) / pem.mean():.2f} |"
        )
    return lines


def innovation_lengths(asked: Asked) -> list[str]:
    """What p does, with and without the memory."""
    lines, runs = [], asked.runs or 100
    for memory in (4096, 0):
        what = "with the default memory" if memory else "pure recursion, memory=0"
        lines += [f"\n### Innovation length p, {what}: median NMSE and 95 % interval, {runs} seeds\n"]
        lines += ["| p | " + " | ".join(f"N = {n}" for n in LENGTHS) + " |", "|---|" + "---|" * len(LENGTHS)]
        for p in INNOVATION_LENGTHS:
            cells = []
            for n in LENGTHS:
                key = f"p={p}, N={n}, memory={memory}"
                v = run_all(
                    one_length, [(s, p, n, memory) for s in range(runs)], f"p={p} N={n}", asked.jobs, asked.record, key
                )
                m, low, high = median_interval(v)
                cells.append(f"{m:.4f} ({low:.4f} to {high:.4f})")
            lines.append(f"| {p} | " + " | ".join(cells) + " |")
    return lines


def coverage(asked: Asked) -> list[str]:
    """Coverage of 95 % intervals, a row an estimator."""
    runs = asked.runs or 200
    rows = run_all(one_coverage, [(s,) for s in range(runs)], "coverage", asked.jobs, asked.record, "coverage")
    lines = [f"\n### Coverage of 95 % intervals in %, {runs} seeds\n"]
    for name, entries in (
        ("RLS", "g a1, g a2, g b1 + g, g b2, beta1, beta2, c2, d1, d2"),
        ("PEM", "g a1, g a2, g b1 + g, g b2, beta1, beta2, c2, d1, d2"),
        ("PEM, natural", "a2, b1, b2, c2, d1, d2, viscous, coulomb, stribeck"),
    ):
        hits = np.array([r[name] for r in rows])
        shares = ", ".join(f"{100 * s:.1f}" for s in hits.mean(axis=0))
        lines.append(f"- {name}: {100 * hits.mean():.1f} in all; {entries}: {shares}")
    return lines


def posterior_coverage(asked: Asked) -> list[str]:
    """Coverage of the one-pass estimator's 95 % intervals, a row a length and noise level."""
    lines = ["\n### Coverage of the 95 % intervals of RMILS in %, one pass over Example 5.1\n"]
    lines += [
        "| N | dB | runs | a2, b1, b2, c2, d1, d2, viscous, coulomb, stribeck | a, b | all nine (95 % interval) |"
    ]
    lines[-1] += " NMSE expected, simulation: median |\n|---|---|---|---|---|---|---|"
    for n_samples, default in ((1000, 200), (20_000, 60)):
        for snr_db in (SNR_DB, 20.0, 40.0):
            count = asked.runs or default
            tasks = [(s, n_samples, snr_db) for s in range(count)]
            key = f"posterior, N={n_samples}, {snr_db} dB"
            rows = run_all(one_posterior, tasks, f"N={n_samples}, {snr_db} dB", asked.jobs, asked.record, key)
            hits = np.abs([r["z"] for r in rows]) < 1.96
            # parameters of one run err together: the interval is over runs, not over their nine
            share = hits.mean(axis=1)
            half = 1.96 * share.std(ddof=1) / np.sqrt(count)
            each = ", ".join(f"{100 * h:.0f}" for h in hits.mean(axis=0))
            expected, simulated = (np.median([r[k] for r in rows]) for k in ("expected", "simulation"))
            lines.append(
                f"| {n_samples} | {snr_db:.1f} | {count} | {each} | {100 * hits[:, :3].mean():.1f} "
                f"| {100 * share.mean():.1f} ({100 * (share.mean() - half):.1f} to {100 * (share.mean() + half):.1f}) "
                f"| {expected:.2g}, {simulated:.2g} |"
            )
    return lines


SECTIONS = {
    "example": example, "long": long, "systems": systems, "output": output, "p": innovation_lengths,
    "coverage": coverage, "posterior": posterior_coverage, "minima": minima,
}  # fmt: skip


@click.command(help=__doc__.split("\n\n")[0])
@click.option(
    "--section",
    type=click.Choice(["all", *SECTIONS]),
    default="all",
)
@click.option(
    "--runs",
    type=int,
    default=None,
    help="Runs in each section; 100, 30, 50, 100 and 200 by default (posterior: 200 at N = 1,000, 60 at 20,000).",
)
@click.option("--jobs", type=int, default=2, show_default=True, help="Processes.")
@click.option(
    "--out",
    type=click.Path(path_type=pathlib.Path),
    default=None,
    help="Folder for accuracy.md and .json; goes on from there.",
)
@click.option("--first-seed", type=int, default=0, show_default=True, help="Of minima, systems, output.")
@click.option("--perturbation", type=float, default=0.0, show_default=True, help="Of the logs of minima, relative.")
def main(
    section: str, runs: int | None, jobs: int, out: pathlib.Path | None, first_seed: int, perturbation: float
) -> None:
    """Measure and print."""
    begun = time.time()
    lines, record = ["# Accuracy"], {}
    if out is not None and (out / "accuracy.json").exists():
        record = json.loads((out / "accuracy.json").read_text())
    asked = Asked(runs, jobs, record, first_seed, perturbation)
    for name in SECTIONS if section == "all" else (section,):
        lines += SECTIONS[name](asked)
    lines.append(f"\n{time.time() - begun:.0f} s.")
    print("\n".join(lines))
    if out is not None:
        out.mkdir(parents=True, exist_ok=True)
        (out / "accuracy.md").write_text("\n".join(lines) + "\n")
        (out / "accuracy.json").write_text(json.dumps(record))


if __name__ == "__main__":
    main()
