"""Values that plant and engine hand to each other."""

from __future__ import annotations

from dataclasses import FrozenInstanceError
from types import SimpleNamespace

import pytest

from whsklearn.gap.values import CandidateFit, FittedTerm, Look


def test_a_term_hands_its_numbers_to_its_candidate():
    kind = SimpleNamespace(name="cogging", effect=lambda q: q.tolist())
    term = FittedTerm(kind, (0.1, 12.0))
    assert (term.name, term.effect) == ("cogging", [0.1, 12.0])
    assert term == FittedTerm(kind, (0.1, 12.0))


def test_a_fit_has_the_name_of_its_look_and_is_a_value():
    fitted = CandidateFit(Look("stribeck", 0.5), model=None)
    assert fitted.name == "stribeck"
    with pytest.raises(FrozenInstanceError):
        fitted.look = Look("cogging", 0.1)
