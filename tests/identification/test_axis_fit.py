"""The axis as physics: a start by inverse dynamics, and a law that bends where friction does."""

from __future__ import annotations

import numpy as np
import pytest

from tests.recursion.axis_log import TRUTH, axis_log, slow_drive
from whsklearn.identification.axis_fit import fit_free_law_axis, inverse_start
from whsklearn.identification.view import view
from whsklearn.recursion.axis_free_run import free_run

U = slow_drive(3000, 1)
VELOCITY = free_run(TRUTH, axis_log(U))


def test_the_start_by_inverse_dynamics_is_near_the_truth():
    start = inverse_start(view(U, VELOCITY, 0.005, "velocity"))
    assert start == pytest.approx(TRUTH[:4], rel=0.2, abs=0.02)


def test_a_drive_that_works_the_other_way_is_no_axis():
    with pytest.raises(ValueError, match="no rigid axis"):
        inverse_start(view(-U, VELOCITY, 0.005, "velocity"))


def test_a_free_law_bends_at_speeds_of_the_record_and_stays_straight_where_friction_is():
    model = fit_free_law_axis(view(U, VELOCITY, 0.005, "velocity"))
    assert model.inertia == pytest.approx(TRUTH[0], rel=0.02)
    hinges = [t for t in model.law.terms if t.name == "speed_hinge"]
    assert len(hinges) == 4
    assert max(t.knot for t in hinges) < np.abs(VELOCITY).max()
    assert max(abs(t.magnitude) for t in hinges) < 0.1 * TRUTH[1]
