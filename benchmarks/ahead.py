"""How long a control loop waits for a prediction: percentiles of `predict_ahead` after every row of a stream.

    python -m benchmarks.ahead [--rows 2000]

Each row is learnt by ``partial_fit``, then the next 4 samples and the last 300 are predicted from the running estimate
(``settle=False``), on the CPU clock of the thread; then, a hundredth as often, from the settled one.

On a busy machine the kernel gives the core to another process now and then, and what runs next finds cold caches: its
time depends on the other process as much as on ours. So rows during which that happened, from learning on, are counted
apart: the percentiles are those of rows that ran through, the last columns tell how many did not, and the 99 % of all.
"""

from __future__ import annotations

import os
import resource
import time
import warnings
from collections.abc import Callable
from functools import partial
from typing import Any

import click
import numpy as np

from whsklearn import (
    InverseDynamicsLags,
    MILSRegressor,
    MultiInnovationGradientRegressor,
    RLSRegressor,
    RMILSRegressor,
    StreamingPEMRegressor,
    WienerHammersteinLags,
)
from whsklearn.datasets import make_servo_log, make_wiener_hammerstein

LEARNT = 1000  # rows before the first question
LIMIT = 200.0  # us that an answer may take
LAGS = WienerHammersteinLags()
AXIS = InverseDynamicsLags(cutoff=60, causal=True)
MODELS: dict[str, Any] = {
    "RLS": RLSRegressor(LAGS, random_state=0),
    "MILS": MILSRegressor(LAGS, random_state=0),
    "RMILS": RMILSRegressor(LAGS, random_state=0),
    "RMILS, memory=0": RMILSRegressor(LAGS, memory=0, random_state=0),
    "RMILS, published": RMILSRegressor(LAGS, gradient="pseudolinear"),
    "gradient": MultiInnovationGradientRegressor(LAGS),
    "StreamingPEM": StreamingPEMRegressor(n_start=LEARNT, block=500),
    "RLS of an axis": RLSRegressor(AXIS, forgetting=0.9995),
}


def switches() -> int:
    """How often another process has been given the core of this thread."""
    return resource.getrusage(resource.RUSAGE_THREAD).ru_nivcsw


def microseconds(call: Callable[[], Any], before: int) -> tuple[float, bool]:
    """CPU time of one call, and whether another process had the core since there were ``before`` `switches`."""
    began = time.thread_time_ns()
    call()
    spent = 1e-3 * (time.thread_time_ns() - began)
    return spent, switches() > before


def asked(model: Any, X: np.ndarray, y: np.ndarray, rows: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times and interruptions of the answers for 4 samples, for 300 and settled, (n, 2) each; the first may compile."""
    X, y = np.ascontiguousarray(X), np.ascontiguousarray(y)
    model.partial_fit(X[:LEARNT], y[:LEARNT])
    short, long, settled = [], [], []
    for t in range(LEARNT, LEARNT + rows):
        before = switches()
        model.partial_fit(X[t : t + 1], y[t : t + 1])
        for n, spent in ((4, short), (300, long)):
            u, known = X[t + 1 - n : t + 1], y[t + 1 - n : t + 1]
            spent.append(microseconds(partial(model.predict_ahead, u, known, settle=False), before))
        if t % 100 == 0:
            settled.append(microseconds(partial(model.predict_ahead, u, known), before))
    return np.array(short[1:]), np.array(long[1:]), np.array(settled[1:])


def through(times: np.ndarray) -> np.ndarray:
    """Times (n,) of the calls that ran through."""
    return times[times[:, 1] == 0.0, 0]


@click.command(help=__doc__)
@click.option("--rows", default=2000, help="Rows after each of which a prediction is asked for.")
def main(rows: int) -> None:
    warnings.simplefilter("ignore")
    chain = make_wiener_hammerstein(LEARNT + rows, snr_db=20, random_state=0)
    log = make_servo_log([], duration=(LEARNT + rows) / 1000, random_state=0)
    axis = log[["position_rad"]].to_numpy(), log["torque_nm"].to_numpy()
    click.echo(
        f"{'us of CPU':<18}{'4 samples: 50 %':>16}{'99 %':>7}{'99.9 %':>8}{'300: 50 %':>11}{'99 %':>7}{'settled':>9}"
        f"{'interrupted':>13}{'all, 99 %':>11}"
    )
    late = 0
    for name, model in MODELS.items():
        short, long, settled = asked(model, *(axis if name.endswith("axis") else chain), rows)
        a, b, c = np.percentile(through(short), [50, 99, 99.9])
        d, e = np.percentile(through(long), [50, 99])
        late += b > LIMIT
        click.echo(
            f"{name:<18}{a:16.0f}{b:7.0f}{c:8.0f}{d:11.0f}{e:7.0f}{np.median(settled[:, 0]):9.0f}"
            f"{100 * short[:, 1].mean():11.1f} %{np.percentile(short[:, 0], 99):11.0f}"
        )
    click.echo(f"{late} of {len(MODELS)} take more than {LIMIT:g} us at 99 % (0 wanted); load {os.getloadavg()[0]:.1f}")


if __name__ == "__main__":
    main()
