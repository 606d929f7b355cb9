"""Series of a chain's page: aligned with what L2 remembers, before and after, and tests that tell them apart."""

from __future__ import annotations

import numpy as np
import pytest

from tests.gap.plants.example_chain import PLAIN, SCALES, TRUE, setting, term
from whsklearn.effects import QuadraticDrag
from whsklearn.gap.plants.chain_model import SKIP, chain, free_run
from whsklearn.gap.plants.chain_pictures import axes, pictures, residual_tests
from whsklearn.gap.plants.chain_view import ChainView

WITH = TRUE.plus(term("quadratic_drag", 0.05))


@pytest.fixture(scope="module")
def view():
    return ChainView(setting(QuadraticDrag(0.05)), SCALES)


def test_signals_are_one_sample_late_as_l2_is():
    shown = axes(PLAIN, TRUE)
    x = chain(PLAIN, TRUE, free=True)[0]
    np.testing.assert_array_equal(shown["x"][0][1:], x[:-1])
    np.testing.assert_array_equal(shown["input"][0][1:], PLAIN.u[:-1])
    np.testing.assert_array_equal(shown["output"][0], free_run(PLAIN, TRUE))
    assert shown["time"][1] == "samples"  # the example has no clock


def test_runs_and_gaps_are_those_of_the_two_models(view):
    shown = pictures(view, TRUE, WITH)
    np.testing.assert_array_equal(shown["runs"]["before"], free_run(view.setting, TRUE))
    np.testing.assert_array_equal(shown["runs"]["after"], free_run(view.setting, WITH))
    np.testing.assert_array_equal(shown["gap_after"], view.gap(WITH))
    assert shown["usable"].sum() == view.setting.u.size - SKIP
    assert shown["floor"] == view.floor(WITH)


def test_the_spectra_hold_the_power_of_the_gaps(view):
    """Half the squared amplitudes sum to the variance, up to the window's own 1.5 bins."""
    shown = pictures(view, TRUE, WITH)
    for spectrum, gap in zip(shown["spectrum"], (shown["gap_before"], shown["gap_after"]), strict=True):
        assert np.sum(0.5 * spectrum**2) / 1.5 == pytest.approx(np.var(gap[SKIP:]), rel=0.1)
    assert shown["frequency"][-1] == pytest.approx(0.5)


def test_what_is_left_is_told_before_the_repair_and_not_after(view):
    rows = {r["test"].rpartition(", ")[2] + r["test"][:3]: r["p_value"] for r in residual_tests(view, TRUE, WITH)}
    assert rows["beforegen"] < 1e-4
    assert rows["aftergen"] > 1e-3
    assert rows["afterLju"] > 1e-3
