"""False alarms of `ChangeAlarm` where nothing changes, and how soon it notices a change.

    python -m benchmarks.alarm                       # noises of several laws and streams of the article's example
    python -m benchmarks.alarm --streams 40          # fewer streams of 50,000 rows each, half a second of CPU each

The bound is on the mean number of samples between alarms: a column of false alarms may not exceed samples / interval
by more than chance.
"""

from __future__ import annotations

import argparse

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter
from tqdm import tqdm

from whsklearn import RMILSRegressor, WienerHammersteinLags
from whsklearn.change import ChangeAlarm
from whsklearn.datasets import make_wiener_hammerstein
from whsklearn.streaming.monitor import BLOCK, Innovations

ROWS = 50_000  # of a stream
SNR_DB = (7.462, 20.0, 40.0)  # of the article's example; rare wrong signs stand out most where there is little noise
NOISES = {
    "normal": lambda rng, n: rng.normal(size=n),
    "Laplace": lambda rng, n: rng.laplace(size=n),
    "Student, 3 degrees": lambda rng, n: rng.standard_t(3, size=n),
    "coloured": lambda rng, n: lfilter([1.0], [1.0, -0.7], rng.normal(size=n)),
}
CHANGES = {"spread doubled": (2.0, 0.0), "spread raised by half": (1.5, 0.0), "shifted by one deviation": (1.0, 1.0)}


def of_a_stream(seed: int, snr_db: float) -> NDArray[np.float64]:
    """Innovations of the default estimator on the article's example, block by block as `whsklearn stream` has them."""
    X, y = make_wiener_hammerstein(n_samples=ROWS, snr_db=snr_db, random_state=seed)
    model = RMILSRegressor(WienerHammersteinLags(), p=4, random_state=0)
    innovations, found = Innovations(model), []
    for i in range(0, ROWS, BLOCK):
        rows = slice(i, i + BLOCK)
        model.partial_fit(X[rows], y[rows])
        innovations.learnt(np.c_[X[rows], y[rows]], np.zeros(BLOCK, dtype=np.int64))
        found.append(innovations.of_block()[1][:, 0])
    e = np.concatenate(found)
    return e[np.isfinite(e)]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--streams", type=int, default=399, help="streams of the article's example")
    parser.add_argument("--first-seed", type=int, default=0)
    options = parser.parse_args()
    records = {
        name: [draw(np.random.default_rng(options.first_seed + k), 1_000_000) for k in range(5)]
        for name, draw in NOISES.items()
    }
    for k in tqdm(range(options.streams), desc="streams", disable=None):
        snr_db = SNR_DB[k % len(SNR_DB)]
        records.setdefault(f"stream at {snr_db:g} dB", []).append(of_a_stream(options.first_seed + k, snr_db))
    print("false alarms (at most samples / interval on average)")
    for name, all_of_it in records.items():
        samples = sum(e.size for e in all_of_it)
        raised = {a: sum(ChangeAlarm(interval=a).update(e).size for e in all_of_it) for a in (1e4, 1e5, 1e6)}
        rates = [f"{n:>5} at {a:.0e} ({samples / a:.0f})" for a, n in raised.items()]
        print(f"{name:20} {samples:>10,} samples", *rates)
    print("samples until a change of normal noise is noticed, interval 1e6, median of 60")
    for name, (spread, shift) in CHANGES.items():
        delays = []
        for k in range(60):
            e = np.random.default_rng(options.first_seed + k).normal(size=20_000)
            e[12_000:] = spread * e[12_000:] + shift
            raised_at = ChangeAlarm(interval=1e6).update(e)
            delays.append(float(next((t - 12_000 for t in raised_at.tolist() if t >= 12_000), np.inf)))
        print(f"{name:26} {np.median(delays):.0f}")


if __name__ == "__main__":
    main()
