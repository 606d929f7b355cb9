"""A base model of a higher order, or with a free law, holds the smaller one."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from tests.gap.plants.example_chain import PLAIN, TRUE
from whsklearn.gap.plants.chain_model import raw_errors
from whsklearn.gap.plants.chain_structure import Structure, freed, raised, sentence, too_small


@pytest.mark.parametrize("more", [1, 2])
def test_more_poles_and_zeros_of_size_zero_change_nothing(more):
    s, m = raised(PLAIN, TRUE, more)
    assert m.theta.size == TRUE.theta.size + 4 * more
    np.testing.assert_allclose(raw_errors(s, m), raw_errors(PLAIN, TRUE), atol=1e-12)


def test_a_free_law_of_weight_zero_changes_nothing_and_any_weight_does():
    m = freed(PLAIN, TRUE)
    np.testing.assert_allclose(raw_errors(PLAIN, m), raw_errors(PLAIN, TRUE), atol=1e-12)
    for i in (0, len(m.terms) - 1):
        bent = dataclasses.replace(m.terms[i], q=(0.5, *m.terms[i].q[1:]))
        moved = m.with_terms((*m.terms[:i], bent, *m.terms[i + 1 :]))
        assert np.abs(raw_errors(PLAIN, moved) - raw_errors(PLAIN, TRUE)).max() > 0.01


@pytest.mark.parametrize(
    ("by_orders", "by_law", "said"),
    [(0.6, 0.1, "try 4,4,4,4"), (0.1, 0.6, "give another law"), (0.1, 0.1, "orders and law together")],
)
def test_the_sentence_says_what_took_the_error_away(by_orders, by_law, said):
    larger = Structure(PLAIN, TRUE, 1.0, (4, 4, 4, 4), by_orders, by_law)
    assert said in sentence(larger, PLAIN.dims)
    assert too_small(2.1, larger)
    assert not too_small(1.9, larger)
