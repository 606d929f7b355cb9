"""Free runs: where they start, how long one shows a model, and that a better model runs better."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.gap.plants.example_servo import INERTIA, RATE, SECONDS, TIME, opened, record_of
from whsklearn.effects import Backlash, Coulomb, GravityImbalance, Stribeck, Viscous
from whsklearn.gap.plants.servo_candidates import candidate
from whsklearn.gap.plants.servo_model import ServoTerm
from whsklearn.gap.plants.servo_own import needed, own_record
from whsklearn.gap.plants.servo_run import (
    LONGEST_RUN,
    OFF_PATH,
    WINDOWS,
    evolved,
    held_out,
    horizon_of,
    predictable,
    restarted_run,
    smoothed,
    smoothing_width,
    train_error,
)

LIGHT = 0.03 * INERTIA


@pytest.fixture(scope="module")
def plain():
    return opened(record_of())


def test_local_polynomials_are_exact_on_polynomials():
    t = np.arange(400) * 2e-3
    q, v = smoothed(1.0 + 2.0 * t - 3.0 * t**3, 2e-3, 21)
    np.testing.assert_allclose(q, 1.0 + 2.0 * t - 3.0 * t**3, atol=1e-12)
    np.testing.assert_allclose(v, 2.0 - 9.0 * t**2, atol=1e-9)


def test_noise_asks_for_a_wide_window_and_fast_motion_for_a_narrow_one():
    dt, rng = 1e-3, np.random.default_rng(0)
    t = np.arange(6000) * dt
    slow, fast = np.sin(2.0 * t), np.sin(2.0 * t) + 0.01 * np.sin(2 * np.pi * 70.0 * t)
    widths = [smoothing_width([x + 1e-5 * rng.standard_normal(t.size)], dt, 1e-5) for x in (slow, fast)]
    assert widths[0] == 2 * round(WINDOWS[0] / 2 / dt) + 1
    assert widths[1] < 0.5 * widths[0]
    parts = [slow[:2500], 3.0 + slow[4000:]]  # a hole over which the axis moves far is no fast motion
    assert smoothing_width([x + 1e-5 * rng.standard_normal(x.size) for x in parts], dt, 1e-5) == widths[0]
    assert smoothing_width([slow, slow[:100]], dt, 1e-5) < 50, "no window is wider than half of a segment"


def test_a_horizon_is_as_long_as_a_torque_that_is_worth_no_name_leaves_it(plain):
    *_, base = plain
    heavy, light = (horizon_of(replace(base, inertia=j, terms=()), base.scene, 0.004) for j in (10 * INERTIA, LIGHT))
    assert heavy == LONGEST_RUN
    pushed_off = 0.004 * base.scene.torque * light**2 / (2.0 * LIGHT)
    assert pushed_off == pytest.approx(OFF_PATH * base.scene.speed * light, rel=0.3)  # rounded to one digit


def test_a_model_predicts_its_own_record_over_the_longest_horizon(plain):
    inverse, observer, base = plain
    model = observer.fit(base)
    own = replace(
        observer,
        record=own_record(inverse, model, np.random.default_rng(0), observer.record.drive, 0.0, needed(inverse, model)),
    )
    assert predictable(own, model, LONGEST_RUN) == LONGEST_RUN


def test_a_run_restarts_on_the_path_and_the_model_with_the_missing_effect_runs_better():
    _, observer, base = opened(record_of([GravityImbalance(0.3, 0.4)]))
    gravity = ServoTerm(candidate("gravity_imbalance"), (0.3 * np.cos(0.4), -0.3 * np.sin(0.4)))
    repaired = base.with_term(gravity)
    error = [train_error(observer, m, 0.5) for m in (base, repaired)]
    assert error[1] < 0.2 * error[0]
    run = restarted_run(observer, base, 0.1)
    starts = np.arange(0, TIME.size, round(0.1 * RATE))[3:-3]
    assert np.abs(run - observer.record.position)[starts].max() < 1e-3


def test_runs_of_one_model_over_several_horizons_share_its_restarts_and_other_records_have_their_own(plain):
    _, observer, base = plain
    other = replace(observer, record=replace(observer.record, position=observer.record.position + 0.1))
    runs = [[restarted_run(view, base, horizon) for horizon in (0.1, 0.3)] for view in (observer, other)]
    assert observer.starts(base) is observer.starts(replace(base))
    assert np.abs(runs[1][0] - runs[0][0]).mean() == pytest.approx(0.1, rel=0.1)


def test_a_run_that_leaves_the_path_counts_as_no_model(plain):
    _, observer, base = plain
    pushed = [base.with_term(ServoTerm(candidate("input_offset"), (size,))) for size in (10.0, 30.0)]
    error = [train_error(observer, m, 2.0) for m in (base, *pushed)]
    assert error[0] < 0.5 * error[1]
    assert error[1] == error[2]


@pytest.mark.parametrize(("fitted", "share"), [(False, 0.4), (True, 0.6)])
def test_held_out_and_fitted_samples_leave_the_edges_out(plain, fitted, share):
    """The memory of a drive's lag is unknown at the start: a transient there once weighed more than all the rest."""
    mask = held_out(plain[1], fitted=fitted)
    assert mask.size == int(RATE * SECONDS)
    assert not mask[: int(0.5 * RATE)].any()
    assert share - 0.1 < mask.mean() < share
    assert not (mask & held_out(plain[1], fitted=not fitted)).any()


def test_a_fit_along_the_run_ends_at_the_minimum_from_far_away():
    true = Stribeck(0.25, 0.15)
    inverse, observer, base = opened(record_of((true,), law=[Viscous(0.12), Coulomb(0.2)]), ("viscous", "coulomb"))
    kind = candidate("stribeck")
    for wide in [s for s in kind.starts(base.scene) if s[0] > 4.0 * true.velocity]:
        started = inverse.fit(base.with_term(ServoTerm(kind, (0.1, *wide))))
        observer.weigh(observer.rms(observer.gap(started)))
        fitted, _ = observer.fitted(started)
        assert fitted.terms[-1].q == pytest.approx((true.torque, true.velocity, true.exponent), rel=0.01)


def test_a_search_leaves_the_ripple_in_which_a_fit_of_a_play_ends():
    true = Backlash(0.03, load_share=0.4, frequency=60.0, damping_ratio=0.2)
    _, observer, base = opened(record_of((true,), law=[Viscous(0.12), Coulomb(0.2)]), ("viscous", "coulomb"))
    start = ServoTerm(candidate("backlash"), (0.05, 0.4, 40.0, 0.15, 0.0))
    stuck = observer.fit(observer.fit(base).with_term(start))
    users = np.random.get_state()[1].copy()  # noqa: NPY002 -- NumPy's global generator, which is the user's
    found = evolved(observer, stuck)
    assert (np.random.get_state()[1] == users).all()  # noqa: NPY002
    left, fitted = (observer.rms(observer.gap(m)) for m in (found, stuck))
    assert left < 0.1 * fitted
    assert found.terms[-1].q[:4] == pytest.approx((0.03, 0.4, 60.0, 0.2), rel=0.02)
