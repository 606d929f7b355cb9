"""Numbers that stay sound: what becomes of P and of the estimate after 1e7 samples of what real axes do.

Run ``python benchmarks/endurance.py`` (some minutes) or with ``--samples 1e5`` (seconds).  Each row streams through the
public ``partial_fit``, block by block, and is asked at every block: is P symmetric and positive definite, is everything
finite, how large is its largest variance; and at the end: how far is the estimate off?
The plain recursion P - outer(g, g) / s of textbooks and of other packages stands beside it.

``max var`` is the largest variance in units of the noise variance, from 1e5 samples on: forgetting multiplies what
is not excited by 1 / lambda a sample, and the estimator stops it at a ceiling.
"""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from pathlib import Path

import click
import numpy as np
from numba import njit
from numpy.typing import NDArray

from whsklearn import RLSRegressor, RMILSRegressor, WienerHammersteinLags
from whsklearn.datasets import make_wiener_hammerstein
from whsklearn.metrics import parameter_error
from whsklearn.recursion.rows.covariance import covariance

Array = NDArray[np.float64]
Blocks = Iterator[tuple[Array, Array]]
THETA = np.array([1.0, -2.0, 0.5, 3.0, -0.3, 1.5, 0.1, -1.0, 2.0])
BLOCK = 10_000


@dataclass
class Row:
    """What became of one stream."""

    case: str
    method: str
    samples: int
    sound: bool
    largest_variance: float
    digits: float
    seconds: float


@njit(cache=True, error_model="numpy")
def plain(theta, P, forgetting, X, y):
    """The textbook recursion with P - outer(g, g) / s."""
    n = theta.size
    g = np.empty(n)
    for t in range(y.size):
        s, e = forgetting, y[t]
        for i in range(n):
            g[i] = 0.0
            for j in range(n):
                g[i] += P[i, j] * X[t, j]
            e -= X[t, i] * theta[i]
        for i in range(n):
            s += g[i] * X[t, i]
        for i in range(n):
            theta[i] += g[i] * e / s
            for j in range(n):
                P[i, j] = (P[i, j] - g[i] * g[j] / s) / forgetting


class Plain:
    """The textbook recursion behind the same interface."""

    def __init__(self, forgetting: float, p0: float):
        self.forgetting, self.theta_, self.covariance_ = forgetting, np.zeros(9), p0 * np.eye(9)

    def partial_fit(self, X: Array, y: Array) -> None:
        """One update a row."""
        plain(self.theta_, self.covariance_, self.forgetting, X, y)


def white(rng: np.random.Generator, n: int) -> Blocks:
    for _ in range(n // BLOCK):
        X = rng.normal(size=(BLOCK, 9))
        yield X, X @ THETA + 0.01 * rng.normal(size=BLOCK)


def idle(rng: np.random.Generator, n: int) -> Blocks:
    """Work, a long rest, and work again."""
    yield from white(rng, 2 * BLOCK)
    for _ in range(n // BLOCK):
        yield np.zeros((BLOCK, 9)), np.zeros(BLOCK)
    yield from white(rng, 2 * BLOCK)


def noisy_rest(rng: np.random.Generator, n: int) -> Blocks:
    """The same, with noise on the output of the axis that rests."""
    for X, y in idle(rng, n):
        yield X, y if X.any() else 0.01 * rng.normal(size=BLOCK)


def scaled(rng: np.random.Generator, n: int) -> Blocks:
    """Regressors from 1e-3 to 1e3, without noise."""
    scale = np.logspace(-3, 3, 9)
    for X, _ in white(rng, n):
        yield X * scale, X * scale @ THETA


def ill_conditioned(rng: np.random.Generator, n: int) -> Blocks:
    """X'X of condition 1e12, without noise."""
    q, _ = np.linalg.qr(rng.normal(size=(9, 9)))
    turn = q * np.logspace(0, -6, 9) @ q.T
    for X, _ in white(rng, n):
        yield X @ turn, X @ turn @ THETA


def one_direction(rng: np.random.Generator, n: int) -> Blocks:
    """Only one direction excited for long, then all."""
    for _ in range(n // BLOCK):
        X = rng.normal(size=(BLOCK, 1)) * np.ones(9)
        yield X, X @ THETA
    yield from white(rng, 2 * BLOCK)


CASES: dict[str, tuple[Callable[[np.random.Generator, int], Blocks], float]] = {
    "white input": (white, 1.0),
    "white input, forgetting 0.99": (white, 0.99),
    "rest, forgetting 0.99": (idle, 0.99),
    "rest with noise, forgetting 0.99": (noisy_rest, 0.99),
    "regressors 1e-3 to 1e3, forgetting 0.999": (scaled, 0.999),
    "condition 1e12": (ill_conditioned, 1.0),
    "one direction, forgetting 0.99": (one_direction, 0.99),
}


def relative_covariance(model: object) -> Array:
    """P in units of the noise variance."""
    return covariance(model.state_["ud"]) if isinstance(model, RLSRegressor) else model.covariance_  # type: ignore


def watch(case: str, method: str, model: object, blocks: Blocks) -> Row:
    """Stream the blocks and ask after each."""
    sound, largest, samples, began = True, 0.0, 0, time.perf_counter()
    for X, y in blocks:
        model.partial_fit(X, y)  # type: ignore[attr-defined]
        samples += len(y)
        if samples % (10 * BLOCK):
            continue
        P = relative_covariance(model)
        if np.isfinite(P).all() and np.isfinite(model.theta_).all():  # type: ignore[attr-defined]
            unit = np.sqrt(np.abs(np.diag(P))) + 1e-300
            lowest = np.linalg.eigvalsh(P / np.outer(unit, unit)).min()
            sound &= bool(np.abs(P - P.T).max() <= 1e-12 * np.abs(P).max() and lowest > -1e-9)
            largest = max(largest, float(np.diag(P).max()))
        else:
            sound = False
    theta = model.theta_  # type: ignore[attr-defined]
    off = parameter_error(theta, THETA) if theta.size == 9 and np.isfinite(theta).all() else np.nan
    return Row(case, method, samples, sound, largest, float(-np.log10(max(off, 1e-17))), time.perf_counter() - began)


def axis_at_rest(n: int, noise: float = 0.0) -> Row:
    """The Wiener-Hammerstein estimator through a long rest: does it recover?"""
    rng = np.random.default_rng(0)
    X, y, truth = make_wiener_hammerstein(n_samples=4000, snr_db=40, random_state=0, return_truth=True)
    model = RMILSRegressor(WienerHammersteinLags(), p=4, forgetting=0.999, random_state=0)
    began, sound = time.perf_counter(), True
    for part in (X, np.broadcast_to(0.0, (n, 1)), X):
        for at in range(0, len(part), BLOCK):
            rows = np.array(part[at : at + BLOCK])
            model.partial_fit(rows, y[: len(rows)] if part is X else noise * rng.normal(size=len(rows)))
        sound &= bool(np.isfinite(model.theta_).all() and np.isfinite(model.covariance_).all())
        sound &= bool(np.linalg.eigvalsh(model.covariance_).min() >= -1e-9 * np.abs(model.covariance_).max())
    off = parameter_error(model.theta_, truth.theta)
    largest = float(np.diag(model.covariance_).max())
    seconds = time.perf_counter() - began
    case = f"axis at rest{' with noise' if noise else ''}, forgetting 0.999"
    return Row(case, "RMILSRegressor", n + 8000, sound, largest, -np.log10(off), seconds)


@click.command()
@click.option("--samples", type=float, default=1e7, help="Samples of each stream.")
@click.option("--json", "path", type=click.Path(path_type=Path), default=Path("reports/endurance.json"))
def main(samples: float, path: Path) -> None:
    """Stream through every case and print a table."""
    np.seterr(all="ignore")
    n, rows = int(samples), []
    click.echo(f"{'case':42s} {'method':16s} {'samples':>9s} {'sound':>5s} {'max var':>9s} {'digits':>6s} {'s':>6s}")
    for case, (make, forgetting) in CASES.items():
        p0 = 1e15 if "condition" in case else 1e6
        ours = RLSRegressor(P0=p0, forgetting=forgetting)
        for method, model in (("RLSRegressor", ours), ("plain", Plain(forgetting, p0))):
            rows.append(watch(case, method, model, make(np.random.default_rng(0), n)))
            _say(rows[-1])
    for noise in (0.0, 0.01):
        rows.append(axis_at_rest(n, noise))
        _say(rows[-1])
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps([asdict(row) for row in rows], indent=1))


def _say(r: Row) -> None:
    """One line of the table."""
    click.echo(
        f"{r.case:42s} {r.method:16s} {r.samples:9d} {'yes' if r.sound else 'NO':>5s} {r.largest_variance:9.2g} "
        f"{r.digits:6.1f} {r.seconds:6.1f}"
    )


if __name__ == "__main__":
    main()
