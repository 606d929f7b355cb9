"""p-values of gains, separability of rivals, coloured noise."""

import numpy as np
import pytest
from scipy.signal import lfilter

from whsklearn.gap.calibration import (
    coloured,
    gain,
    n_effective,
    p_value,
    rival_leads,
    separable,
    smoothed_power,
    vuong,
)


def test_p_values_of_superfluous_columns_are_uniform_or_larger():
    rng = np.random.default_rng(0)
    n, scan = 400, 12

    def best_gain():
        y, x = rng.standard_normal(n), rng.standard_normal((n, scan))
        rss = y @ y - (x.T @ y) ** 2 / np.sum(x * x, axis=0)
        return gain(y @ y, rss.min(), n)

    p = np.array([p_value(best_gain(), np.array([best_gain() for _ in range(9)])) for _ in range(400)])
    assert np.mean(p <= 0.05) < 0.08
    assert np.mean(p <= 0.01) < 0.025
    assert np.mean(p <= 0.5) > 0.3  # and has power: it is no constant


@pytest.mark.parametrize("sizes", [[1.0], [0.05], [8.0], [1.0, 1.0, 1.0], [3.0, 0.5, 0.1]])
def test_columns_of_one_shape_are_significant_as_often_as_alpha_says_whatever_noise_they_meet(sizes):
    rng = np.random.default_rng(3)
    weights = np.array(sizes)  # of the noise that each column meets, where `n_effective` counts as if it met one

    def gains(n):
        return rng.standard_normal((n, weights.size)) ** 2 @ weights

    p = np.array([p_value(g, gains(60), degrees=float(weights.size)) for g in gains(4000)])
    assert 0.03 < np.mean(p <= 0.05) < 0.07
    assert np.mean(p <= 0.001) < 0.004


def test_so_is_a_column_whose_size_must_be_positive():
    rng = np.random.default_rng(4)

    def gains(n):
        return np.where(rng.standard_normal(n) > 0.0, rng.standard_normal(n) ** 2, 0.0)

    p = np.array([p_value(g, gains(60), degrees=0.5) for g in gains(4000)])
    assert 0.03 < np.mean(p <= 0.05) < 0.07


def test_a_gain_far_above_the_null_is_significant_whatever_its_spread():
    null = np.array([3.0, 5.0, 4.0])
    assert p_value(60.0, null, families=40) < 1e-6
    assert p_value(4.0, null, families=40) == 1.0


def test_more_families_make_a_gain_less_significant():
    null = np.array([3.0, 5.0, 4.0, 6.0])
    assert p_value(20.0, null, 10) == pytest.approx(10 * p_value(20.0, null, 1))


def test_effective_samples_of_an_autoregression():
    rng = np.random.default_rng(1)
    x = np.zeros(20000)
    e = rng.standard_normal(x.size)
    for i in range(1, x.size):
        x[i] = 0.9 * x[i - 1] + e[i]
    expected = x.size * (1 - 0.81) / (1 + 0.81)  # sum of squared autocorrelations, Bayley and Hammersley
    assert n_effective(x) == pytest.approx(expected, rel=0.1)


@pytest.mark.parametrize("samples", [0, 50, 200, 400])
def test_vuong_is_standard_normal_between_equals_and_changes_sign(samples):
    """Also if errors depend on each other for several blocks, as those of a free run do: they made it 2.0 too large."""
    rng = np.random.default_rng(2)
    memory = np.exp(-1.0 / samples) if samples else 0.0

    def error():
        return lfilter([1.0], [1.0, -memory], rng.standard_normal(4000 + 5 * samples))[5 * samples :]

    z = np.array([vuong(error(), error()) for _ in range(300)])
    assert abs(z.mean()) < 0.2
    assert 0.85 < z.std() < 1.15
    a, b = rng.standard_normal(4000), rng.standard_normal(4000)
    assert vuong(a, b) == pytest.approx(-vuong(b, a))


def test_rivals_are_apart_only_if_lead_blocks_and_own_records_all_say_so():
    none = np.zeros(0)
    assert separable(30.0, 5.0, none, 0.01)
    assert not separable(5.0, 5.0, none, 0.01)  # the lead is worth too little
    assert not separable(30.0, 1.0, none, 0.01)  # a few blocks hold it
    assert not separable(30.0, 5.0, np.array([25.0, 30.0, 35.0, 28.0]), 0.01)  # the rival's own records give it too


def test_coloured_noise_has_the_spectrum_it_was_given():
    rng = np.random.default_rng(3)
    x = np.convolve(rng.standard_normal(8000), np.ones(20) / 20, mode="same")
    power = smoothed_power(x)
    made = np.mean([smoothed_power(row) for row in coloured(power, (20, x.size), rng)], axis=0)
    seen = (power > 1e-2 * power.max()) & (np.arange(power.size) > 40)
    assert np.mean(np.log(made[seen] / power[seen])) == pytest.approx(0.0, abs=0.1)
    assert np.std(np.std(coloured(power, (20, x.size), rng), axis=1) / np.std(x)) < 0.2


@pytest.mark.parametrize("seed", range(5))
def test_records_of_the_true_rival_show_the_lead_of_a_wrong_name(seed):
    """A wrong name that is ahead by chance is no further ahead than records of the right one put it."""
    rng = np.random.default_rng(seed)
    right = rng.standard_normal(1500)
    wrong = right + 0.05 * rng.standard_normal(1500)
    before = right + rng.standard_normal(1500)

    def errors(column):
        return before - column * (column @ before) / (column @ column)

    taken, other = errors(wrong), errors(right)
    leads = rival_leads(before, taken, other, 1500.0, rng)
    lead = gain(float(other @ other), float(taken @ taken), 1500.0)
    assert p_value(lead, leads) > 0.01
    far = rng.standard_normal(1500)
    assert p_value(gain(float(errors(far) @ errors(far)), float(other @ other), 1500.0),
                   rival_leads(before, other, errors(far), 1500.0, rng)) < 1e-6  # fmt: skip
