"""What a view and a term do unless their plant knows better."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from whsklearn.gap import evidence as rules
from whsklearn.gap.plant import PlantDefaults, ViewDefaults


@dataclass
class View(ViewDefaults):
    """A view whose models are the sizes of their gaps."""

    limits: rules.Limits = rules.WHITENED

    def gap(self, model):
        return np.full(50, float(model))

    def rms(self, gap):
        return float(np.sqrt(np.mean(gap**2)))

    def floor(self, model):
        return 1.0


@pytest.mark.parametrize(("gap", "least", "quiet"), [(1.09, 0.0, True), (1.2, 0.0, False), (1.2, 0.6, True)])
def test_a_gap_is_quiet_up_to_noise_and_what_is_worth_no_name_together(gap, least, quiet):
    assert View().quiet(gap, least) is quiet


def test_what_was_explained_is_the_power_that_is_gone():
    assert View().explained(5.0, 3.0) == pytest.approx(4.0)
    assert View().explained(3.0, 5.0) == 0.0


def test_no_two_effects_are_the_same_and_no_family_or_curve_is_asked_for():
    view = View()
    assert not view.same_signature(1.0, 1.0)
    assert list(view.family(1.0)) == []
    assert view.trimmed(1.0) is view
    assert PlantDefaults().falls_short(1.0, 1.0) == ""
    assert PlantDefaults().learn(1.0) is None
