"""The compiled step is a martingale of bets: checked against the formula written out."""

from __future__ import annotations

import numpy as np

from whsklearn.change.cells import LEVELS, N_BETS, tilts
from whsklearn.change.kernel import watch


def state():
    return np.zeros(2), np.full(LEVELS.size + 1, 50.0), np.zeros(N_BETS)


def test_evidence_is_that_of_the_recursion_written_out():
    edges = np.linspace(-2, 2, LEVELS.size)
    e, ar = np.random.default_rng(0).normal(size=40), np.array([0.5, -0.2])
    past, counts, evidence = state()
    assert watch(e, 0, past, ar, edges, tilts(), counts, evidence, 1e12, 1e9) == -1
    by_hand, seen = np.zeros(N_BETS), np.full(LEVELS.size + 1, 50.0)
    for t in range(e.size):
        w = e[t] - sum(ar[i] * e[t - 1 - i] for i in range(2) if t - 1 - i >= 0)
        cell = np.searchsorted(edges, w)
        by_hand = (1.0 + by_hand) * tilts()[:, cell] / (tilts() @ (seen / seen.sum()))
        seen[cell] += 1
    np.testing.assert_allclose(evidence, by_hand, rtol=1e-10)
    np.testing.assert_array_equal(counts, seen)


def test_it_stops_at_the_sample_that_raised_the_alarm_and_goes_on_behind_it():
    edges = np.linspace(-2, 2, LEVELS.size)
    e = np.r_[np.zeros(5), np.full(60, 9.0)]
    past, counts, evidence = state()
    at = watch(e, 0, past, np.empty(0), edges, tilts(), counts, evidence, 50.0, 1e9)
    assert 5 <= at < e.size
    assert counts.sum() == 50.0 * (LEVELS.size + 1) + at + 1


def test_old_counts_fade_when_there_are_many():
    past, counts, evidence = state()
    watch(np.zeros(10), 0, past, np.empty(0), np.linspace(-2, 2, LEVELS.size), tilts(), counts, evidence, 1e12, 905.0)
    assert counts.sum() < 905.0
