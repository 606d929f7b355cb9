"""A reference keeps the limits, an axis that cannot keep them is refused, and the dry run tells two rivals apart."""

from __future__ import annotations

import numpy as np
import pytest

import whsklearn.gap.design as plan
from whsklearn import ServoAxis
from whsklearn.effects import Cogging
from whsklearn.gap.design import BEYOND, Design, Limits, closed_loop, design, reference_within

AXIS = ServoAxis(inertia=0.05, law="viscous,coulomb", sample_rate=250.0)


@pytest.mark.parametrize(
    "limits", [Limits(0.5, 9.0, 9.0, 6.0), Limits(5.0, 2.0, 9.0, 6.0), Limits(5.0, 50.0, 2.0, 6.0)]
)
def test_the_reference_keeps_every_limit_and_reaches_one(limits):
    path, drive, reached = reference_within(closed_loop(AXIS, 1e-5), limits)
    shares = np.array(reached[:3]) / np.array(limits[:3])
    assert path.size == 1500
    assert path[0] == 0.0
    assert np.abs(drive).max() == reached.drive
    assert np.all(shares <= 1.0 + 1e-9)
    assert shares.max() > 0.75


def test_an_axis_that_its_friction_holds_is_refused():
    with pytest.raises(ValueError, match="allow more drive"):
        reference_within(closed_loop(AXIS, 1e-5), Limits(1.0, 5.0, 1e-3, 6.0))


def test_a_strong_effect_would_be_named_and_one_too_weak_would_not():
    limits = Limits(2.0, 5.0, 2.0, 10.0)
    made = design(AXIS, [Cogging(0.1, 12.0)], "viscous,coulomb", limits, share=0.1, noise=1e-5)
    assert made.named == {"cogging": True}
    assert made.factors == {}


def test_a_promise_is_made_only_if_the_dry_runs_agree(monkeypatch):
    answers = {0: [True, True, True], 10: [False, False, False], 20: [True, False, True]}
    monkeypatch.setattr(plan, "is_named", lambda *_, alpha, seed: answers[seed // 10 * 10][seed % 10])
    told = [plan.surely_named(AXIS, Cogging(0.1, 12.0), np.zeros(9), "viscous", alpha=0.01, seed=s) for s in answers]
    assert told == [True, False, None]
    made = Design(*np.zeros((3, 1)), Limits(1.0, 1.0, 2.0, 6.0), {"cogging": None}, {"cogging": 1.5})
    assert made.advice("Nm") == (
        "Within these limits cogging may or may not be named, depending on the noise; to see cogging allow 3 Nm."
    )


def test_what_stays_unseen_is_said():
    made = Design(*np.zeros((3, 1)), Limits(1.0, 1.0, 2.0, 6.0), {"cogging": False}, {"cogging": None})
    text = made.advice("mNm", 1e-3)
    assert "cogging would not" in text
    assert f"{BEYOND[-1]:g} times" in text
