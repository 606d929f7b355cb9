"""A record of a model that is linear in its parameters."""

from __future__ import annotations

import numpy as np
import pytest

from tests.recursion.windows import LINEAR
from whsklearn import WienerHammersteinSystem
from whsklearn.datasets import make_wiener_hammerstein
from whsklearn.recursion.rows.predictor import record_errors


@pytest.fixture
def linear():
    system = WienerHammersteinSystem([1.0], [], [1.0], [0.3], LINEAR)
    X, y = make_wiener_hammerstein(150, snr_db=20, random_state=0, system=system)
    dims = np.array([1, 0, 1, 1, 2], dtype=np.int64)
    rows = np.empty((150, 3))
    record_errors(np.zeros(3), dims, LINEAR.codes, LINEAR.shapes, 1.0, X, y, np.arange(150) == 0, np.empty(150), rows)
    return dims, X, y, rows
