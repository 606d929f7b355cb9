"""The band of a friction law covers as often as it says."""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np

from whsklearn.effects import reduced_law
from whsklearn.plot import FrictionDisplay


def test_friction_band_covers_as_often_as_it_says():
    rng, truth, covariance = np.random.default_rng(1), reduced_law(), np.diag([0.01, 0.02, 0.03]) ** 2
    inside = []
    for _ in range(400):
        law = truth.reweighted(truth.weights + rng.normal(size=3) * np.sqrt(np.diag(covariance)))
        shown = FrictionDisplay.from_law(law, [0.5, 2.0], covariance=covariance, truth=truth)
        inside.append(np.abs(shown.friction - shown.truth) < 1.96 * shown.standard_error)
        plt.close(shown.figure_)
    assert 0.92 < np.mean(inside) < 0.98
