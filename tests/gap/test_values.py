"""Values that plant and engine hand to each other."""

from __future__ import annotations

from dataclasses import FrozenInstanceError

import pytest

from whsklearn.gap.values import CandidateFit, Look


def test_a_fit_has_the_name_of_its_look_and_is_a_value():
    fitted = CandidateFit(Look("stribeck", 0.5), model=None)
    assert fitted.name == "stribeck"
    with pytest.raises(FrozenInstanceError):
        fitted.look = Look("cogging", 0.1)
