"""Standard errors are those of linear regression, carried to amplitude and phase."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from whsklearn.effects import Cogging
from whsklearn.gap.plant import Linearised
from whsklearn.gap.standard_errors import covariance, errors_of, labelled_errors

RNG = np.random.default_rng(0)
J = RNG.normal(size=(500, 2)) * [1.0, 100.0]
R = 0.3 * RNG.normal(size=500)
FREE = np.full(2, -1e6), np.full(2, 1e6)


def fit(rebuild, x=(0.3, -0.4), jac=J):
    return Linearised(x=np.array(x), residual=R, jacobian=jac, low=FREE[0], high=FREE[1], rebuild=rebuild)


def test_the_covariance_is_that_of_least_squares():
    expected = np.linalg.inv(J.T @ J) * (R @ R) / 498
    np.testing.assert_allclose(covariance(fit(None)), expected, rtol=1e-9)


def test_a_number_that_moves_nothing_has_no_variance():
    assert covariance(fit(None, jac=J * [1.0, 0.0]))[1, 1] == 0.0


def test_errors_of_labels_follow_from_those_of_the_numbers():
    read = fit(lambda x: {"plain": x[0], "double": 2 * x[0], "text": "inertia"})
    errors = errors_of(read, lambda m: m)
    assert errors["double"] == pytest.approx(2 * errors["plain"], rel=1e-9)
    assert errors["plain"] == pytest.approx(np.sqrt(covariance(read)[0, 0]), rel=0.25)  # 64 draws
    assert "text" not in errors


def test_amplitude_and_phase_of_a_wave():
    even = RNG.normal(size=(500, 2))

    def rebuild(x):
        return SimpleNamespace(terms=[SimpleNamespace(effect=Cogging.from_coefficients(list(x), order=12.0))])

    errors = labelled_errors(fit(rebuild, jac=even), 0)
    one = np.sqrt(covariance(fit(rebuild, jac=even))[0, 0])
    assert errors["amplitude_nm"] == pytest.approx(one, rel=0.3)
    assert errors["phase_rad"] == pytest.approx(one / 0.5, rel=0.3)  # the arc over the amplitude
    assert "order" not in errors  # nothing moved it
