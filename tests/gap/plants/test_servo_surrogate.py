"""A surrogate is the same experiment with nothing missing in it."""

from __future__ import annotations

import numpy as np
import pytest

from tests.gap.plants.example_servo import opened, record_of
from whsklearn.effects import GravityImbalance
from whsklearn.gap.plants.servo_surrogate import surrogate_record


@pytest.fixture(scope="module")
def views():
    return opened(record_of([GravityImbalance(0.3, 0.4)]))


def test_its_path_is_the_records_and_its_gap_is_gone(views):
    inverse, _, base = views
    made = inverse.surrogate(base, np.random.default_rng(0))
    assert np.std(made.record.position - inverse.record.position) < 0.1 * np.std(inverse.record.position)
    assert made.rms(made.gap(base)) < 0.1 * inverse.rms(inverse.gap(base))


def test_its_encoder_has_the_records_noise(views):
    _, observer, base = views
    one, other = (surrogate_record(observer, base, np.random.default_rng(seed)).position for seed in (0, 1))
    noise = np.std(np.diff(one - other, 2)) / np.sqrt(12.0)  # of two records, each with its own
    assert noise == pytest.approx(observer.noise, rel=0.3)


def test_the_same_seed_gives_the_same_record(views):
    _, observer, base = views
    one, other = (surrogate_record(observer, base, np.random.default_rng(3)) for _ in range(2))
    np.testing.assert_array_equal(one.drive, other.drive)
    np.testing.assert_array_equal(one.position, other.position)
