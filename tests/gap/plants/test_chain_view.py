"""The view of a chain: floors, quiet models, errors that a sign's side cannot tip."""

from __future__ import annotations

import numpy as np
import pytest

from tests.gap.plants.example_chain import PLAIN, SCALES, THETA, TRUE, setting, term
from whsklearn.effects import DeadZone
from whsklearn.gap.plants.chain_model import ChainModel
from whsklearn.gap.plants.chain_view import ChainView, surrogate_setting

VIEW = ChainView(PLAIN, SCALES)


@pytest.fixture(scope="module")
def dead():
    """A record with a dead zone, and the models without and with it."""
    return ChainView(setting(DeadZone(0.3)), SCALES), TRUE, TRUE.plus(term("dead_zone", 0.3))


def test_the_true_model_is_quiet_and_one_that_lacks_an_effect_is_not(dead):
    view, without, with_it = dead
    assert VIEW.quiet(TRUE, 0.0)
    assert not view.quiet(without, 0.0)
    assert view.quiet(with_it, 0.0)
    assert view.quiet(without, 1e9)  # a miss below the tolerance is quiet whatever a test sees


def test_the_floor_lies_below_what_a_wrong_model_leaves_and_is_all_that_the_right_one_does(dead):
    view, without, with_it = dead
    noise = view.rms(view.gap(with_it))
    assert noise == pytest.approx(0.02, rel=0.1)
    assert noise < view.floor(without) < 0.9 * view.rms(view.gap(without))
    assert view.floor(with_it) == pytest.approx(noise, rel=0.05)


def test_held_out_errors_are_held_and_squares_are_those_of_the_capped_sum():
    spoilt = PLAIN.y.copy()
    spoilt[np.flatnonzero(PLAIN.held >= 0)[5]] += 50.0
    view = ChainView(setting(), SCALES)
    object.__setattr__(view.setting, "y", spoilt)
    (one,) = view.compare([TRUE], 0)
    assert np.abs(one.held).max() == pytest.approx(4.0)
    assert one.errors @ one.errors == pytest.approx(one.n_effective * view.rms(view.gap(TRUE)) ** 2)
    assert set(one.block) == {0, 1, 2, 3, 4}


def test_a_surrogate_holds_nothing_but_the_model_and_its_noise():
    made = VIEW.surrogate(TRUE, np.random.default_rng(0))
    assert made.quick
    errors = made.gap(TRUE)[PLAIN.fit]
    assert np.std(errors) == pytest.approx(0.02, rel=0.15)
    assert not np.array_equal(made.setting.y, PLAIN.y)
    loud = surrogate_setting(PLAIN, TRUE, np.random.default_rng(0), most=1e-4)
    clean = surrogate_setting(PLAIN, TRUE, np.random.default_rng(0), most=1e-12)
    held = PLAIN.held >= 0
    assert np.sqrt(np.mean((loud.y - clean.y)[held] ** 2)) == pytest.approx(1e-4, rel=1e-3)


def test_a_model_is_fitted_once():
    start = ChainModel(0.98 * THETA)
    fitted = VIEW.fit(start)
    assert fitted.on is PLAIN
    assert VIEW.fit(fitted) is fitted
    assert VIEW.rms(VIEW.gap(fitted)) < VIEW.rms(VIEW.gap(start))
