"""The best linear model of a linear record is that record's system."""

from __future__ import annotations

import numpy as np
from scipy.signal import lfilter

from whsklearn.recursion.batch.best_linear import IOData, Ratio, best_linear, least_squares_arx

B, A = np.array([0.0, 1.0, 0.4]), np.array([1.0, -1.2, 0.5])


def record(noise, n=2000):
    rng = np.random.default_rng(0)
    u = rng.normal(size=n)
    y = lfilter(B, A, u) + noise * rng.normal(size=n)
    return IOData(u[None], y, np.array([0, n]), np.arange(n) > 50)


def test_an_exact_record_gives_its_own_ratio():
    found = least_squares_arx(record(0.0), 2, 2)
    np.testing.assert_allclose(found.b[:3], B, atol=1e-8)
    np.testing.assert_allclose(found.a, A, atol=1e-8)


def test_output_noise_biases_arx_and_not_the_free_run():
    data = record(0.5)
    arx, best = least_squares_arx(data, 2, 2), best_linear(data, 2, 2)
    error = [np.linalg.norm(r.a - A) for r in (arx, best)]
    assert error[1] < 0.3 * error[0]
    assert np.abs(np.roots(best.a)).max() < 1.0


def test_a_run_is_the_filter_and_the_head_is_a_shorter_record():
    data = record(0.0)
    np.testing.assert_allclose(Ratio(B, A).run(data), data.y, atol=1e-12)
    head = data.head(100)
    assert (head.u.shape, head.y.size, head.bounds.tolist()) == ((1, 100), 100, [0, 100])
    np.testing.assert_array_equal(data.scale, data.counts.astype(float))
