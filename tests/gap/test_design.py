"""A reference keeps the limits, an axis that cannot keep them is refused, and the dry run tells two rivals apart."""

from __future__ import annotations

import json

import numpy as np
import pytest

import whsklearn.gap.design as plan
from whsklearn import ServoAxis
from whsklearn.effects import Cogging
from whsklearn.gap.design import (
    BEYOND,
    HEIGHT,
    MARGIN,
    Design,
    Limits,
    against,
    closed_loop,
    design,
    reference_within,
    write_design,
)

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


# --- the page: its numbers are in the units of the log ----------------------------------------------------------------
def test_the_files_are_in_the_units_of_the_log(tmp_path):
    time = np.linspace(0.0, 1.0, 50)
    made = Design(time, 0.1 * np.sin(time), np.zeros(50), Limits(0.1, 0.2, 0.5, 1.0), {"cogging": True}, {})
    page = write_design(made, Limits(10.0, 20.0, 600.0, 1.0), tmp_path, ("mNm", "deg"))
    reached = json.loads((tmp_path / "design.json").read_text())["reached"]
    assert reached["drive"] == pytest.approx(500.0)
    assert reached["position"] == pytest.approx(np.rad2deg(0.1))
    table = np.loadtxt(tmp_path / "reference.csv", delimiter=",", skiprows=1)
    np.testing.assert_allclose(table[:, 1], np.rad2deg(made.reference), rtol=1e-8, atol=1e-8)
    assert "cogging" in page.read_text(encoding="utf-8")


def test_a_signal_at_its_limit_touches_the_edge():
    picture = against(np.linspace(0.0, 1.0, 5), np.array([0.0, 2.0, 0.0, -2.0, 0.0]), 2.0)
    heights = [float(p.split(",")[1]) for p in picture.points.split()]
    assert (min(heights), max(heights)) == (picture.top, picture.bottom) == (MARGIN, HEIGHT - MARGIN)
