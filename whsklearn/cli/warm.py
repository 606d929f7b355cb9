"""Compile in advance the code of fits, simulations, `identify` and `gap`, for a machine that must not wait later."""

from __future__ import annotations

import time
import warnings
from collections.abc import Iterator

import click

from whsklearn.cli.job import command


def fits() -> Iterator[str]:
    """The estimators on the simulated example: each is fitted, continued and used for prediction."""
    from whsklearn import estimators
    from whsklearn.datasets import make_wiener_hammerstein
    from whsklearn.lags import WienerHammersteinLags

    X, y = make_wiener_hammerstein(600, random_state=0)
    lags = WienerHammersteinLags()
    models = {
        "the default fit": estimators.RMILSRegressor(lags, random_state=0),
        "the batch fit": estimators.PEMRegressor(lags, n_starts=1, random_state=0),
        "the published method": estimators.RMILSRegressor(lags, gradient="pseudolinear"),
        "least squares on rows": estimators.RLSRegressor(),
    }
    for name, model in models.items():
        model.fit(X[:500], y[:500]).predict(X)
        if hasattr(model, "partial_fit"):
            model.partial_fit(X[500:501], y[500:501])
        yield name


def searches() -> Iterator[str]:
    """A servo axis, simulated and searched for missing effects."""
    from whsklearn.datasets import make_servo_log
    from whsklearn.gap.finder import GapFinder

    log = make_servo_log("cogging", duration=10.0, sample_rate=200.0)
    yield "simulation of an axis"
    GapFinder("servo").fit(log)
    yield "gap"


def identifications() -> Iterator[str]:
    """A servo axis, identified."""
    from whsklearn.datasets import make_servo_log
    from whsklearn.identification import identify

    log = make_servo_log("cogging", duration=10.0, sample_rate=200.0).iloc[:800]
    identify(log["torque_nm"].to_numpy(), log["position_rad"].to_numpy(), dt=0.005)
    yield "identify"


@command
def main() -> None:
    """Compile once what later runs load: about a minute on a new machine, seconds if everything is compiled.

    Compiled code is kept in ~/.cache/whsklearn, or in NUMBA_CACHE_DIR.

    Example: whsklearn warm
    """
    for work in (fits, searches, identifications):
        began = time.perf_counter()
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # warnings about short records do not matter here
            for name in work():
                click.echo(f"{name}: {time.perf_counter() - began:.1f} s")
                began = time.perf_counter()
