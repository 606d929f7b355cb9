"""The maker of Example 5.1."""

from __future__ import annotations

import numpy as np
import pytest

from whsklearn import WienerHammersteinSystem
from whsklearn.datasets import make_wiener_hammerstein


@pytest.mark.parametrize("snr_db", [0.0, 7.462, 30.0])
def test_the_ratio_is_of_the_noise_free_output_to_the_equation_noise(snr_db):
    _, _, truth = make_wiener_hammerstein(20_000, snr_db=snr_db, random_state=0, return_truth=True)
    assert 10 * np.log10(np.var(truth.y) / np.var(truth.d)) == pytest.approx(snr_db, abs=0.15)


def test_the_noise_enters_the_equation():
    """y - y_clean is the noise through 1 / D, the noise being d(t) of (2)."""
    X, y, truth = make_wiener_hammerstein(500, random_state=1, return_truth=True)
    np.testing.assert_allclose(truth.system.simulate(X[:, 0], truth.d), y)
    gap = y - truth.y
    white = gap.copy()
    white[1:] += 0.15 * gap[:-1]
    white[2:] += 0.4 * gap[:-2]
    np.testing.assert_allclose(white, truth.d, atol=1e-12)


def test_no_noise_on_request():
    X, y, truth = make_wiener_hammerstein(100, snr_db=None, random_state=2, return_truth=True)
    assert not truth.d.any()
    np.testing.assert_array_equal(y, truth.y)
    np.testing.assert_array_equal(X[:, 0], truth.u)


def test_the_input_is_white_with_variance_one():
    X, _ = make_wiener_hammerstein(20_000, random_state=3)
    assert X.shape == (20_000, 1)
    assert X.var() == pytest.approx(1.0, abs=0.05)
    assert abs(np.mean(X[1:] * X[:-1])) < 0.03


def test_the_same_seed_gives_the_same_record():
    for a, b in zip(
        make_wiener_hammerstein(50, random_state=4), make_wiener_hammerstein(50, random_state=4), strict=True
    ):
        np.testing.assert_array_equal(a, b)
    assert not np.array_equal(
        make_wiener_hammerstein(50, random_state=4)[0], make_wiener_hammerstein(50, random_state=5)[0]
    )
    assert len(make_wiener_hammerstein(50, random_state=np.random.default_rng(0))[0]) == 50


def test_any_system_under_the_same_experiment():
    system = WienerHammersteinSystem([1.0], [], [1.0], [0.5])
    X, y, truth = make_wiener_hammerstein(60, snr_db=None, random_state=6, system=system, return_truth=True)
    np.testing.assert_array_equal(y, system.simulate(X[:, 0]))
    assert truth.theta.size == 4


def test_a_law_without_linear_term_has_no_theta_and_still_a_record():
    from whsklearn.effects import Coulomb

    system = WienerHammersteinSystem([1.0], [], [1.0], [0.5], [Coulomb(1.0)])
    _, y = make_wiener_hammerstein(30, random_state=7, system=system)
    assert np.isfinite(y).all()


def test_a_record_has_at_least_one_sample():
    with pytest.raises(ValueError, match="n_samples is 0"):
        make_wiener_hammerstein(0)
