"""The auxiliary model rebuilds x and v of the true system where theta is the true one."""

from __future__ import annotations

import numpy as np

from whsklearn import WienerHammersteinLags
from whsklearn.datasets import make_wiener_hammerstein
from whsklearn.recursion.rows.auxiliary_model import auxiliary_size


def test_regressors_at_the_true_parameters_predict_the_output():
    X, y, truth = make_wiener_hammerstein(300, snr_db=None, random_state=0, return_truth=True)
    phi = WienerHammersteinLags(theta=truth.theta).fit_transform(X, y)
    np.testing.assert_allclose((phi @ truth.theta)[10:], y[10:], atol=1e-9)


def test_columns_are_the_true_signals_with_their_lags():
    X, y, truth = make_wiener_hammerstein(100, snr_db=None, random_state=1, return_truth=True)
    lags = WienerHammersteinLags(theta=truth.theta)
    names = list(lags.fit(X, y).get_feature_names_out())
    phi = lags.fit_transform(X, y)
    t = np.arange(20, 100)
    np.testing.assert_allclose(phi[t, names.index("-x_hat(k-2)")], -truth.x[t - 2], atol=1e-9)
    np.testing.assert_allclose(phi[t, names.index("u(k-2)")], X[t - 2, 0])


def test_its_state_holds_the_lags_of_x_and_v():
    assert auxiliary_size(np.array([2, 2, 2, 2, 3])) == 3 + 2
    assert auxiliary_size(np.array([1, 0, 1, 0, 1])) == 2 + 1
