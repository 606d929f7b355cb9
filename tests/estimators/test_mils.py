"""Multi-innovation least squares."""

from __future__ import annotations

import numpy as np
import pytest

from whsklearn import MILSRegressor, RLSRegressor, RMILSRegressor, WienerHammersteinLags, WienerHammersteinSystem
from whsklearn.datasets import make_wiener_hammerstein
from whsklearn.effects.law import polynomial_law

HAMMERSTEIN = WienerHammersteinSystem([1.0], [], [1.0], [0.3], polynomial_law([0.0, 1.0, 0.5]))
LAGS = WienerHammersteinLags(1, 0, 1, 1, law=polynomial_law([0.0, 1.0, 0.5]))


@pytest.mark.parametrize("gradient", ["full", "pseudolinear"])
def test_one_innovation_is_recursive_least_squares(gradient):
    X, y = make_wiener_hammerstein(120, random_state=0)
    a, b = (
        kind(WienerHammersteinLags(), gradient=gradient, n_starts=2, memory=0, random_state=0).fit(X, y)
        for kind in (lambda *v, **k: MILSRegressor(*v, p=1, **k), RLSRegressor)
    )
    np.testing.assert_array_equal(a.theta_, b.theta_)


@pytest.mark.parametrize("gradient", ["full", "pseudolinear"])
def test_block_and_sub_innovations_are_one_where_rows_do_not_depend_on_theta(gradient):
    """A static x and no c: the difference of MILS and RMILS is in rebuilt rows and nowhere else."""
    X, y = make_wiener_hammerstein(150, snr_db=20, random_state=1, system=HAMMERSTEIN)
    settings = {"lags": LAGS, "p": 4, "gradient": gradient, "memory": 0, "n_starts": 1, "random_state": 0}
    block, sub = (kind(**settings).fit(X, y) for kind in (MILSRegressor, RMILSRegressor))
    np.testing.assert_allclose(block.theta_, sub.theta_, rtol=1e-9)
    np.testing.assert_allclose(block.covariance_, sub.covariance_, rtol=1e-7)


def test_where_they_do_the_two_differ():
    X, y = make_wiener_hammerstein(150, random_state=2)
    settings = {"lags": WienerHammersteinLags(), "p": 4, "gradient": "pseudolinear"}
    assert not np.allclose(MILSRegressor(**settings).fit(X, y).theta_, RMILSRegressor(**settings).fit(X, y).theta_)


def test_to_the_letter_p_is_about_p_times_too_small():
    """As published, each sample counts in p windows; the default counts it once."""
    X, y = make_wiener_hammerstein(300, snr_db=20, random_state=3, system=HAMMERSTEIN)
    letter = [MILSRegressor(LAGS, p=p, gradient="pseudolinear").fit(X, y).covariance_[0, 0] for p in (1, 5)]
    once = [MILSRegressor(LAGS, p=p, random_state=0, n_starts=2).fit(X, y).covariance_[0, 0] for p in (1, 5)]
    assert letter[0] / letter[1] == pytest.approx(5.0, rel=0.1)
    assert once[0] / once[1] == pytest.approx(1.0, rel=0.1)
