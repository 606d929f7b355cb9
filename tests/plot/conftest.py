"""A record and a model for all displays."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from tests.plot.first_order import FirstOrder

plt = pytest.importorskip("matplotlib.pyplot", reason="needs the extra plot")


@pytest.fixture(autouse=True)
def close_figures():
    yield
    plt.close("all")


@pytest.fixture(scope="module")
def record():
    rng = np.random.default_rng(0)
    u = rng.normal(size=600)
    return u[:, None], lfilter([0.0, 1.0], [1.0, -0.7], u) + lfilter([1.0], [1.0, -0.7], 0.3 * rng.normal(size=600))


@pytest.fixture(scope="module")
def model(record):
    return FirstOrder().fit(*record)
