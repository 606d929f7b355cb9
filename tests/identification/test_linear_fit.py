"""Linear candidates: exact without noise, and each best by its own criterion."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from whsklearn.identification.linear_fit import fit_arx, fit_output_error
from whsklearn.identification.view import view

B, F = [0.0, 0.5, 0.2], [1.0, -1.2, 0.5]


def record(noise=0.0, of_equation=False, seed=0, n=600):
    rng = np.random.default_rng(seed)
    u, e = rng.standard_normal((2, n))
    y = lfilter(B, F, u) + 3.0 + noise * (lfilter([1.0], F, e) if of_equation else e)
    return view(u, y, 1.0, "output")


@pytest.mark.parametrize("fit", [fit_arx, fit_output_error])
def test_without_noise_it_is_the_system(fit):
    model = fit(record(), 2)
    np.testing.assert_allclose(model.numerator, B, atol=5e-3)  # the mean that is taken out is not quite the offset
    np.testing.assert_allclose(model.denominator, F, atol=5e-3)
    assert model.offset == pytest.approx(3.0, abs=0.05)


@pytest.mark.parametrize(("fit", "of_equation"), [(fit_arx, True), (fit_output_error, False)])
def test_intervals_cover_the_truth_where_the_noise_is_of_the_fits_own_kind(fit, of_equation):
    hits = []
    for seed in range(40):
        model = fit(record(0.3, of_equation, seed), 2)
        e = model.standard_errors
        hits += [abs(model.numerator[1] - 0.5) < 1.96 * e["b1"], abs(model.denominator[1] + 1.2) < 1.96 * e["f1"]]
    assert 0.85 <= np.mean(hits) <= 1.0


def test_noise_of_the_readings_bends_the_one_and_not_the_other():
    arx, oe = (fit(record(0.5), 2).denominator[1] for fit in (fit_arx, fit_output_error))
    assert abs(oe + 1.2) < 0.05 < abs(arx + 1.2)
