"""The best score that chance reaches: on records that the model made itself."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from whsklearn.gap.evidence import Limits
from whsklearn.gap.surrogate import best_score
from whsklearn.gap.values import Look

N = 500.0


class View:
    """A view whose surrogates show these looks, one list a surrogate."""

    limits = Limits(per_sample=0.0, least=30.0, most=30.0, over_chance=2.0, price=1.0, blocks=0.5)

    def __init__(self, *shown):
        self.shown = list(shown)

    def surrogate(self, model, rng):
        looks = self.shown.pop(0)
        one = SimpleNamespace(n_effective=N)
        return SimpleNamespace(fit=lambda m: m, look=lambda m: looks, compare=lambda models, best: [one])


def scored(gain, numbers=1, places=1):
    return -N * np.log(1 - gain) - numbers * np.log(N) - 2 * np.log(places)


def test_it_is_the_best_delta_bic_of_any_look_on_any_surrogate():
    first, second = [Look("a", 0.02), Look("b", 0.05)], [Look("a", 0.04, n_numbers=3, n_looks=20)]
    assert best_score(View(first, second), None, 2, np.random.default_rng(0)) == pytest.approx(scored(0.05))
    assert best_score(View(second), None, 1, np.random.default_rng(0)) == max(scored(0.04, 3, 20), 0.0)


def test_what_is_worth_nothing_or_costs_a_refit_does_not_count():
    looks = [Look("a", 1e-4), Look("b", 0.5, costly=True)]
    assert best_score(View(looks), None, 1, np.random.default_rng(0)) == 0.0
    assert best_score(View(), None, 0, np.random.default_rng(0)) == 0.0
