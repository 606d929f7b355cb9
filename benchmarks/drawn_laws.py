"""Simulation-error fits of drawn systems with seven laws: is the free run at the floor that the noise leaves?

    python benchmarks/drawn_laws.py                  # 21 systems, some two minutes
    python benchmarks/drawn_laws.py --count 7        # one a law
    python benchmarks/drawn_laws.py --discontinuous --count 8

Each system is two random stable blocks of order 1 to 4 about a law that `PEMRegressor(criterion="simulation")` is not
told: it looks for orders, and takes a cubic spline or a polynomial.  Noise of 10 % of the output's size is added to
5,000 samples; the free run is judged on 5,000 fresh ones without noise.  The floor is the noise that as many parameters
must take in, sigma sqrt(n / N); "at the floor" is within three times that, or 1 % of the output where a kink is no
spline.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable

import numpy as np
from scipy.signal import lfilter

from whsklearn import PEMRegressor
from whsklearn.recursion.memory.starts import random_stable

LAWS: dict[str, Callable[[np.ndarray], np.ndarray]] = {
    "linear": lambda x: x,
    "x + x^2/2": lambda x: x + 0.5 * x**2,
    "x + x^3/5": lambda x: x + 0.2 * x**3,
    "tanh(2 x)": lambda x: np.tanh(2 * x),
    "saturation": lambda x: np.clip(x, -0.7, 0.7),
    "dead zone": lambda x: x - np.clip(x, -0.5, 0.5),
    "|x|": np.abs,
}
# no spline is these: how far from the floor does the fit end?
DISCONTINUOUS: dict[str, Callable[[np.ndarray], np.ndarray]] = {
    "relay": np.sign,
    "staircase": lambda x: np.round(2 * x) / 2,
}
N, NOISE = 5000, 0.1


def one(seed: int, name: str) -> tuple[tuple[int, int], float, float, float]:
    """Orders, (rmse, floor) as shares of the output's size, seconds of CPU."""
    rng = np.random.default_rng([seed, 21])
    orders = tuple(int(n) for n in rng.integers(1, 5, 2))
    (b1, a1), (b2, a2) = (
        (np.append(1.0, 0.5 * rng.standard_normal(n)), np.append(1.0, random_stable(n, rng))) for n in orders
    )
    u = rng.standard_normal(2 * N)
    x = lfilter(b1, a1, u)
    y = lfilter(b2, a2, (LAWS | DISCONTINUOUS)[name](x / np.std(x)))
    size = np.std(y)
    noisy = y + NOISE * size * rng.standard_normal(2 * N)
    began = time.process_time()
    model = PEMRegressor(criterion="simulation").fit(u[:N, None], noisy[:N])
    seconds = time.process_time() - began
    error = (model.predict(u[:, None]) - y)[N:]
    floor = NOISE * np.sqrt(model.theta_.size / N)
    return orders, float(np.sqrt(np.mean(error**2)) / size), float(floor), seconds


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--count", type=int, default=21)
    parser.add_argument("--first-seed", type=int, default=0)
    parser.add_argument("--discontinuous", action="store_true", help="a relay and a staircase instead of the seven")
    options = parser.parse_args()
    laws = list(DISCONTINUOUS if options.discontinuous else LAWS)
    print(f"{'law':12} {'orders':8} {'rmse %':>8} {'floor %':>8} {'CPU s':>6}")
    good = 0
    for seed in range(options.first_seed, options.first_seed + options.count):
        name = laws[seed % len(laws)]
        orders, rmse, floor, seconds = one(seed, name)
        at_floor = rmse <= max(3 * floor, 0.01)
        good += at_floor
        said = "" if at_floor else "  above the floor"
        print(f"{name:12} {orders!s:8} {100 * rmse:8.2f} {100 * floor:8.2f} {seconds:6.1f}{said}", flush=True)
    print(f"at the floor: {good} of {options.count}")


if __name__ == "__main__":
    main()
