"""Records of input and output that cannot be used, the grid of readings, and what the page draws."""

from __future__ import annotations

import numpy as np
import pytest

from tests.gap.plants.example_chain import PLAIN, TRUE, record, term
from whsklearn.effects import QuadraticDrag
from whsklearn.gap.plants import chain_record as readings
from whsklearn.gap.plants.chain_fit import coloured
from whsklearn.gap.plants.chain_model import SKIP, clipped, free_run, left, simulate

RNG = np.random.default_rng(0)
U, Y = RNG.normal(size=(2, 2000))


def codes(u, y):
    return [p.code for p in readings.check_chain(np.asarray(u), np.asarray(y))]


def with_spikes(y):
    out = y.copy()
    out[[5, 700]] = 1e4
    return out


@pytest.mark.parametrize(
    ("u", "y", "code"),
    [
        (U, np.where(np.arange(2000) == 7, np.nan, Y), "data-not-finite"),
        (U[: readings.FEWEST - 1], Y[: readings.FEWEST - 1], "data-too-short"),
        (np.ones(2000), Y, "data-no-drive"),
        (np.repeat(U[:20], 100), Y, "data-no-drive"),
        (U, np.zeros(2000), "data-not-moving"),
        (U, np.clip(np.cumsum(0.1 * U), -1.0, 1.0), "data-clipped-position"),
        (U, with_spikes(Y), "data-spikes"),
    ],
)
def test_what_cannot_be_used_is_told_and_is_fatal(u, y, code):
    problems = readings.check_chain(u, y)
    assert [p.code for p in problems] == [code]
    assert all(p.fatal for p in problems)


def test_sound_and_coarse_readings_pass():
    assert codes(U, Y) == []
    assert codes(U, np.sign(Y)) == []  # few levels: each is an extreme by rounding
    assert codes(U[: readings.FEWEST], Y[: readings.FEWEST]) == []


def test_a_grid_is_told_where_it_is_coarse_and_not_where_noise_is_larger():
    coarse = PLAIN.with_output(0.1 * np.round(PLAIN.y / 0.1))
    assert readings.coarse_grid(coarse, coloured(coarse, TRUE)) == pytest.approx(0.1)
    fine = PLAIN.with_output(0.001 * np.round(PLAIN.y / 0.001))
    assert readings.coarse_grid(fine, coloured(fine, TRUE)) == 0.0
    assert readings.coarse_grid(PLAIN, coloured(PLAIN, TRUE)) == 0.0


def test_signals_are_one_sample_late_as_l2_is():
    shown = readings.axes(PLAIN, TRUE, ("A", "mm"))
    x = simulate(PLAIN, TRUE)[0]
    np.testing.assert_array_equal(shown["x"][0][1:], x[:-1])
    np.testing.assert_array_equal(shown["input"][0][1:], PLAIN.u[:-1])
    np.testing.assert_array_equal(shown["output"][0], free_run(PLAIN, TRUE))
    assert [shown[k][1] for k in ("time", "input", "output")] == ["samples", "A", "mm"]  # the example has no clock


def test_gaps_and_their_spectra_are_those_of_the_two_models():
    """Half the squared amplitudes sum to the variance, up to the window's own 1.5 bins."""
    s = record(QuadraticDrag(0.05))
    base, model = coloured(s, TRUE), coloured(s, TRUE.plus(term("quadratic_drag", 0.05)))
    shown = readings.pictures(s, base, model, 2.0)
    np.testing.assert_array_equal(shown["gap_after"], 2.0 * clipped(left(s, model)))
    assert shown["usable"].sum() == s.u.size - SKIP
    for spectrum, gap in zip(shown["spectrum"], (shown["gap_before"], shown["gap_after"]), strict=True):
        assert np.sum(0.5 * spectrum**2) / 1.5 == pytest.approx(np.var(gap[SKIP:]), rel=0.1)
    before, after = readings.residual_tests(s, TRUE, model)
    assert before["p_value"] < 1e-4 < after["p_value"]
