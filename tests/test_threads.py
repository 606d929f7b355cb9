"""BLAS keeps to one thread in searches."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter
from threadpoolctl import ThreadpoolController, threadpool_limits

from whsklearn import PEMRegressor, StreamingPEMRegressor, WienerHammersteinLags
from whsklearn.identification import identify

LAGS = WienerHammersteinLags(1, 1, 2, 1, law="polynomial", delays=(0, 0))


LIBRARIES = ThreadpoolController().select(user_api="blas")


def threads():
    return {p["num_threads"] for p in LIBRARIES.info()}


def chain(n):
    rng = np.random.default_rng(0)
    u = rng.standard_normal(n)
    return u, lfilter([1, 0.3], [1, -0.8], np.tanh(lfilter([1], [1, -0.6], u))) + 0.01 * rng.standard_normal(n)


@pytest.mark.parametrize(
    "fit",
    [
        lambda u, y: PEMRegressor(LAGS, criterion="simulation").fit(u[:, None], y).theta_,
        lambda u, y: StreamingPEMRegressor(LAGS, n_start=400, block=200).fit(u[:, None], y).theta_,
        lambda u, y: identify(u[:280], y[:280]).recommended.score,
    ],
    ids=["batch", "blocks", "identify"],
)
def test_a_search_asks_for_one_and_ends_in_the_same_digits(monkeypatch, fit):
    seen = set()

    def watched(function):
        def call(*args, **kwargs):
            seen.update(threads())
            return function(*args, **kwargs)

        return call

    for name in ("qr", "lstsq", "solve"):
        monkeypatch.setattr(np.linalg, name, watched(getattr(np.linalg, name)))
    found = []
    for count in (1, 2):
        with threadpool_limits(count, user_api="blas"):
            found.append(fit(*chain(600)))
    np.testing.assert_array_equal(*found)
    assert seen == {1}
