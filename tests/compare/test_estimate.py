"""Intervals hold what they say: under white noise, under a walking offset, and from records to their mean."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.compare.linear import TRUTH, rows
from whsklearn.compare.estimate import estimate, from_a_cold_start, pooled, repeating, walking, white


@pytest.mark.parametrize("walk", [0.0, 0.1])
def test_two_standard_errors_hold_the_truth(walk):
    z = []
    for seed in range(30):
        e = estimate(*walking([rows(seed=seed, walk=walk)]))
        away = e.values - TRUTH
        if walk:  # the offset of a record is that of the walk too
            away = np.delete(away, 3)
        z += list(np.abs(away) / np.sqrt(np.diag(e.covariance))[: away.size])
    assert np.mean(np.array(z) < 2.0) > 0.93


def test_a_walk_is_told_and_widens_the_offset_alone():
    still, walking = estimate(rows(seed=1)), estimate(rows(seed=1, walk=0.1))
    assert walking.drift[3] > 3.0 * still.drift.get(3, 0.0)
    wider = np.sqrt(np.diag(walking.covariance) / np.diag(still.covariance))
    assert wider[3] > 5.0 > wider[0]


def test_beside_a_walk_the_jump_at_a_reversal_is_known_better_than_the_level():
    """Weights of the noise's own colour (Gauss-Markov): Coulomb friction is seen where it jumps."""
    walks = [rows(seed=k, walk=0.3, noise=0.005) for k in range(6)]
    by_colour = [estimate(*walking([r])) for r in walks]
    assert np.mean([e.errors[2] for e in by_colour]) < 0.5 * np.mean([estimate(r).errors[2] for r in walks])
    assert np.mean([abs(e.values[2] - TRUTH[2]) / e.errors[2] < 2.0 for e in by_colour]) == 1.0


def test_the_walk_of_an_offset_is_found_and_none_in_white_noise():
    assert walking([rows(seed=1)])[0].walk[0] < 1e-4
    one = rows(seed=1, walk=0.1)
    steps = np.std(np.diff(0.1 * np.cumsum(np.random.default_rng(1).standard_normal(3000)) / np.sqrt(3000 / 6)))
    (found,) = walking([one])
    assert 0.2 < found.walk[0] / (steps / 0.02) ** 2 < 5.0


def test_weights_leave_an_offset_as_it_is_and_make_a_walk_white():
    (one,) = walking([rows(seed=1, walk=0.3)])
    np.testing.assert_allclose(white(one.columns[:, 3], one), 1.0)
    walk = white(np.cumsum(np.random.default_rng(2).standard_normal(3000)), replace(one, walk=(1e3,)))
    assert abs(np.corrcoef(walk[1:-1], walk[2:])[0, 1]) < 0.1


def test_what_comes_again_with_the_motion_is_told_from_noise():
    def share(rest):
        one = rows(seed=1, noise=1e-6)
        z = one.columns / one.sizes
        left = rest(one) - z @ np.linalg.lstsq(z, rest(one), rcond=None)[0]
        return repeating(one, z, left)[0]

    noise = np.random.default_rng(3).standard_normal(3000)
    assert share(lambda r: noise) < 0.05
    assert share(lambda r: np.sin(r.path)) > 0.8
    assert share(lambda r: np.sin(r.path) + np.std(np.sin(r.path)) * noise) == pytest.approx(0.5, abs=0.15)
    assert share(lambda r: noise[: r.path.size] * 0.0 + np.interp(r.time, r.time[::30], noise[::30])) == 1.0  # too few


def test_errors_of_the_model_do_not_average_out_as_noise_does():
    def error(n, wrong):
        one = rows(seed=1, n=n, noise=0.1)
        made = 0.3 * np.sin(3.0 * one.path) * np.abs(one.path)  # no column says that
        return estimate(replace(one, target=one.target + wrong * made)).errors[2]

    assert error(12000, 0.0) < 0.65 * error(3000, 0.0)
    assert error(12000, 1.0) > 0.7 * error(3000, 1.0)


def test_what_no_sample_shows_is_unknown_and_the_rest_is_not():
    one = rows(seed=1)
    ahead = one.columns.copy()
    ahead[:, 2] = 1.0  # an axis that never reverses: Coulomb friction is an offset
    e = estimate(replace(one, columns=ahead, target=ahead @ TRUTH + 0.02 * np.random.default_rng(0).normal(size=3000)))
    both = np.array([0.0, 0.0, 1.0, 1.0, 0.0])
    assert min(e.errors[2], e.errors[3]) > one.scale[0]
    assert np.sqrt(both @ e.covariance @ both) < 0.1 * one.scale[0]
    assert abs(both @ e.values - both @ TRUTH) < 3.0 * np.sqrt(both @ e.covariance @ both)


def test_the_pool_of_two_is_their_mean_and_knows_more():
    a, b = (estimate(rows(seed=s)) for s in (2, 3))
    both = pooled([a, b])
    low, high = np.minimum(a.values, b.values), np.maximum(a.values, b.values)
    assert np.all(np.diag(both.covariance) < np.minimum(np.diag(a.covariance), np.diag(b.covariance)))
    assert low[0] <= both.values[0] <= high[0]
    assert pooled([a]) is a


def test_numbers_scale_with_the_unit_of_the_drive():
    one = rows(seed=4)
    milli = rows(seed=4)
    milli = type(milli)(**{**milli.__dict__, "target": 1e3 * milli.target, "scale": 1e3 * milli.scale})
    a, b = estimate(one), estimate(milli)
    np.testing.assert_allclose(b.values, 1e3 * a.values, rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(b.covariance, 1e6 * a.covariance, rtol=1e-6, atol=1e-12)


def course(level, swing, n=3000):
    """Rows whose Coulomb friction falls along the record by ``swing`` about ``level``."""
    one = rows(seed=6, n=n)
    fall = np.linspace(0.5, -0.5, n) * swing + level - TRUTH[2]
    return estimate(replace(one, target=one.target + one.columns[:, 2] * fall))


def test_a_drift_that_begins_anew_in_the_second_record_leaves_no_doubt_between_them():
    cold, again = course(0.2, 0.15), course(0.3, 0.15)
    assert cold.drift[2] > 0.01
    a, b = from_a_cold_start(cold, again)
    assert a.errors[2] < 0.5 * cold.errors[2]
    assert b.errors[2] < 0.5 * again.errors[2]


def test_a_drift_that_goes_on_in_the_second_record_is_no_change():
    first, later = course(0.225, 0.05), course(0.175, 0.05)  # the halves of one record that warms
    a, b = from_a_cold_start(first, later)
    assert (a.errors[2], b.errors[2]) == (first.errors[2], later.errors[2])
