"""The Wiener-Hammerstein benchmark (Schoukens, Suykens, Ljung 2009): time and free-run rmse, ours and others.

    python benchmarks/wiener_hammerstein_benchmark.py [--data FOLDER] [--passes 20]

Needs ``wh2009/estimation.npz`` and ``wh2009/development_test.npz`` (u, y in V) in the folder, in WHSKLEARN_DATA or
in ../shared/data beside the checkout.  The published figures are of the official test part, which is another.
"""

from __future__ import annotations

import argparse
import os
import time
from pathlib import Path

import numpy as np

from whsklearn import PEMRegressor, StreamingPEMRegressor
from whsklearn.recursion.batch.best_linear import best_linear
from whsklearn.recursion.batch.simulation_search import record

SKIP = 300
PUBLISHED = {
    "best published (official test part)": 0.28,
    "dynoNet (Forgione, Piga 2021)": 1.2,
    "GRU": 3.97,
    "linear": 56.0,
}


def folder_of(given: str | None) -> Path:
    beside = Path(__file__).resolve().parents[2] / "shared" / "data"
    return Path(given or os.environ.get("WHSKLEARN_DATA") or beside) / "wh2009"


def load(path: Path) -> tuple[np.ndarray, np.ndarray]:
    with np.load(path) as file:
        return file["u"].reshape(-1, 1).astype(float), file["y"].reshape(-1).astype(float)


def rmse_mv(y: np.ndarray, y_hat: np.ndarray) -> float:
    return 1e3 * float(np.sqrt(np.mean((y - y_hat)[SKIP:] ** 2)))


def linear(u: np.ndarray, y: np.ndarray, U: np.ndarray) -> np.ndarray:
    data = record(u, y - y.mean(), np.arange(y.size) == 0)
    ratio = best_linear(data, 6, 6)
    return ratio.run(record(U, U[:, 0], np.arange(len(U)) == 0)) + y.mean()


def sysidentpy(u: np.ndarray, y: np.ndarray, U: np.ndarray, Y: np.ndarray) -> np.ndarray:
    from sysidentpy.basis_function import Polynomial
    from sysidentpy.model_structure_selection import FROLS

    model = FROLS(order_selection=True, n_info_values=30, xlag=8, ylag=8, basis_function=Polynomial(degree=3))
    model.fit(X=u[:10_000], y=y[:10_000, None])
    return np.asarray(model.predict(X=U, y=Y[: model.max_lag, None])).ravel()


def timed(name: str, function, *arguments) -> tuple[str, float, np.ndarray]:
    begin = time.process_time()
    result = function(*arguments)
    return name, time.process_time() - begin, result


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--data")
    parser.add_argument("--passes", type=int, default=20, help="Runs in one pass, from as many places of the record.")
    options = parser.parse_args()
    folder = folder_of(options.data)
    u, y = load(folder / "estimation.npz")
    U, Y = load(folder / "development_test.npz")
    PEMRegressor(criterion="simulation").fit(u[:500], y[:500])  # compile
    rows = [
        timed("linear, output error of order 6", linear, u, y, U),
        timed("PEM, simulation error", lambda: PEMRegressor(criterion="simulation").fit(u, y).predict(U)),
        timed("one pass, blocks of 1,000", lambda: StreamingPEMRegressor().fit(u, y).predict(U)),
    ]
    try:
        rows.append(timed("SysIdentPy, FROLS, 10,000 samples", sysidentpy, u, y, U, Y))
    except ImportError:
        print("SysIdentPy is not installed: pip install sysidentpy")
    print(f"{'':38}{'CPU s':>8}{'rmse mV':>10}")
    for name, seconds, predicted in rows:
        print(f"{name:38}{seconds:8.1f}{rmse_mv(Y, predicted):10.3f}")
    for name, value in PUBLISHED.items():
        print(f"{name:38}{'-':>8}{value:10.3f}")
    repeated = np.tile(u, (3, 1))[:100_000], np.tile(y, 3)[:100_000]
    groups = np.arange(100_000) // len(u)
    name, seconds, predicted = timed(
        "PEM, 100,000 samples",
        lambda: PEMRegressor(criterion="simulation").fit(*repeated, groups=groups).predict(U),
    )
    print(f"{name:38}{seconds:8.1f}{rmse_mv(Y, predicted):10.3f}")
    errors = []
    for begin in np.linspace(0, len(y) - 25_000, options.passes).astype(int):
        model = StreamingPEMRegressor().fit(u[begin : begin + 25_000], y[begin : begin + 25_000])
        errors.append(rmse_mv(Y, model.predict(U)))
    if errors:
        print(f"one pass over 25,000 samples from {len(errors)} places: {min(errors):.3f} to {max(errors):.3f} mV")


if __name__ == "__main__":
    main()
