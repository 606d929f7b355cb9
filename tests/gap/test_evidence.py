"""What speaks for a candidate."""

from __future__ import annotations

import numpy as np
import pytest

from whsklearn.gap import evidence as rules
from whsklearn.gap.evidence import blocks_not_worse, delta_bic
from whsklearn.gap.values import ModelErrors

LIMITS = rules.Limits(per_sample=0.1, least=25.0, most=100.0, over_chance=2.0, price=1.0)


def test_noise_earns_nothing_on_average_and_a_real_term_does():
    """A needless column gains ln chi2, about 1, and pays ln n."""
    rng, scores = np.random.default_rng(0), []
    for _ in range(200):
        e, column = rng.standard_normal((2, 500))
        scores.append(delta_bic(e, e - column * (column @ e) / (column @ column), 1, 1))
    assert np.mean(np.array(scores) > 0.0) < 0.03
    assert np.mean(scores) == pytest.approx(1.0 - np.log(500), abs=0.5)


def test_scanned_places_and_numbers_cost_evidence():
    before, after = np.full(300, 1.1), np.ones(300)
    plain = delta_bic(before, after, 1, 1)
    assert delta_bic(before, after, 1, 50) == pytest.approx(plain - 2 * np.log(50))
    assert delta_bic(before, after, 3, 1) == pytest.approx(plain - 2 * np.log(300))
    assert delta_bic(before, after, 3, 1, n=100.0, price=0.5) == pytest.approx(100 * np.log(1.21) - 1.5 * np.log(100))


def errors_of(held):
    held = np.asarray(held, dtype=float)
    return ModelErrors(held, held, np.repeat(np.arange(5), held.size // 5), float(held.size))


def test_a_block_at_rest_does_not_count_as_worse_and_a_lost_one_does():
    before = np.repeat([2.0, 2.0, 2.0, 2.0, 0.1], 20)
    rest = np.repeat([1.0, 1.0, 1.0, 1.0, 0.11], 20)  # nothing moves in the last one
    assert blocks_not_worse(errors_of(before), errors_of(rest)) == 1.0
    assert blocks_not_worse(errors_of(before), errors_of(np.repeat([1.0, 1.0, 1.0, 2.5, 0.1], 20))) == 0.8


@pytest.mark.parametrize(
    ("n", "chance", "need"), [(100, 0.0, 25.0), (500, 0.0, 50.0), (5000, 0.0, 100.0), (100, 90.0, 180.0)]
)
def test_what_a_name_needs_grows_with_samples_to_a_limit_and_with_what_surrogates_show(n, chance, need):
    assert LIMITS.need(n, chance) == need
