"""The bets are fair while nothing has changed."""

from __future__ import annotations

import numpy as np

from whsklearn.change.cells import LEVELS, N_BETS, tilts


def test_cells_part_the_line_and_are_finest_in_the_tails():
    widths = np.diff(np.r_[0.0, LEVELS, 1.0])
    assert np.all(widths > 0)
    np.testing.assert_allclose(widths, widths[::-1], atol=1e-12)
    assert widths[0] == widths.min()


def test_every_bet_pays_no_more_than_its_stake_under_the_nominal_law():
    widths = np.diff(np.r_[0.0, LEVELS, 1.0])
    expected = tilts() @ widths
    assert tilts().shape == (N_BETS, widths.size)
    assert np.all(expected <= 1.0 + 1e-12)  # less than one where the largest odds were cut
    np.testing.assert_allclose(expected[tilts().max(axis=1) < 10.0], 1.0, atol=1e-12)


def test_bets_on_spread_pay_in_the_tails_and_bets_on_a_shift_on_one_side():
    odds = tilts()
    assert np.all(odds[:3, [0, -1]] > 1.0)
    assert np.all(odds[:3, odds.shape[1] // 2] < 1.0)
    np.testing.assert_allclose(odds[3], odds[4][::-1], rtol=1e-9)  # a shift up and the same down are mirror images
