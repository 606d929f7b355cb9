"""Errors over windows: the state before each is fitted, whatever came earlier."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from tests.recursion.axis_log import TRUTH, axis_log, slow_drive
from whsklearn.effects import Coulomb, FrictionLaw, InputOffset, Viscous
from whsklearn.identification.axis_numbers import position_effects
from whsklearn.identification.view import view
from whsklearn.identification.windows import horizons, lead, window_errors
from whsklearn.models import AxisModel, LinearModel
from whsklearn.recursion.batch.axis_free_run import HANGS, AxisForm, axis_motion

RNG = np.random.default_rng(0)
U = RNG.standard_normal(1000)


def test_lengths_suit_the_record():
    assert horizons(10_000, 0.01) == [10, 50, 200, 500]
    for n in (100, 400):
        assert max(horizons(n, 1.0)) <= max(n // 4, 11)
    assert lead(1000, 0.001) == 100
    assert lead(10_000, 0.01) == 30
    for n in (30, 36, 59):  # what is held out of the shortest records that are taken
        assert lead(n, 1.0) + max(horizons(n - lead(n, 1.0), 1.0)) <= n


@pytest.mark.parametrize("logged", ["output", "position"])
def test_a_true_linear_model_errs_nowhere_though_the_record_began_elsewhere(logged):
    model = LinearModel([0.0, 0.5, 0.2], [1.0, -1.2, 0.5], logged=logged)
    state = lfilter([1.0], [1.0, -1.2, 0.5], np.r_[3.0, np.zeros(999)])  # another state at the start
    y = model.simulate(U) + (np.cumsum(state) + 7.0 if logged == "position" else state)
    errors = window_errors(model, view(U, y, 1.0, logged), 40, 30)
    assert errors.shape == (24, 40)
    assert np.abs(errors).max() < 1e-6
    wrong = LinearModel([0.0, 0.4, 0.2], [1.0, -1.2, 0.5], logged=logged)
    assert np.abs(window_errors(wrong, view(U, y, 1.0, logged), 40, 30)).max() > 0.1


def test_a_true_axis_errs_nowhere():
    u = slow_drive(2000, 1)
    log = view(u, axis_motion(TRUTH, axis_log(u)), 0.005, "velocity")
    law = FrictionLaw([Viscous(TRUTH[1]), Coulomb(TRUTH[2])])
    model = AxisModel(TRUTH[0], law, (InputOffset(TRUTH[3]),), dt=0.005, logged="velocity")
    errors = window_errors(model, log, 100, 60)
    assert np.sqrt(np.mean(errors**2)) < 0.01 * np.std(log.y)


@pytest.mark.parametrize("seed", range(4))
def test_a_window_that_begins_where_the_axis_turns_is_followed_too(seed):
    """A line through ten samples across a reversal is about rest, and a state that rests says nothing of its speed."""
    dt, rng = 0.002, np.random.default_rng(seed)
    f = np.fft.rfftfreq(1500, dt)
    drive = np.fft.irfft(np.exp(2j * np.pi * rng.random(f.size)) * ((f > 0.5) & (f < 20.0)), 1500)
    drive /= drive.std()
    model = AxisModel(0.005, FrictionLaw([Viscous(0.02), Coulomb(0.2)]), (InputOffset(0.0),), dt=dt, logged="position")
    y = model.simulate(drive) + 1e-4 * rng.standard_normal(1500)
    log = view(drive, y, dt, "position")
    for before in (30, 35):  # 24 windows each
        rms = np.sqrt(np.mean(window_errors(model, log, 40, before) ** 2, axis=1))
        assert np.median(rms) < 3e-4
        assert np.mean(rms > 2e-3) <= 0.05  # 0.08 and more from the line alone
    alone = [window_errors(model, log.part(a, a + 70), 40, 30) for a in range(0, 1430, 50)]
    assert np.mean(np.sqrt(np.mean(np.square(alone), axis=(1, 2))) > 2e-3) <= 0.05


def test_a_coarse_encoder_that_stands_still_for_ten_samples_does_not_lose_its_windows():
    """From the speeds of ten samples, mostly 0, windows of this log were three and six counts off."""
    dt, rng = 0.001, np.random.default_rng(3)
    t = dt * np.arange(6000)
    drive = sum(
        np.sin(2.0 * np.pi * f * t + p) for f, p in zip(rng.uniform(0.2, 3.0, 8), 7.0 * rng.random(8), strict=True)
    )
    model = AxisModel(1.0, FrictionLaw([Viscous(2.0), Coulomb(0.5)]), (InputOffset(0.0),), dt=dt, logged="position")
    y = model.simulate(drive)
    count = np.ptp(y) / 120.0
    errors = window_errors(model, view(drive, count * np.round(y / count), dt, "position"), 500, 300) / count
    assert np.sqrt(np.mean(errors**2, axis=1)).max() < 1.0


def test_a_true_pendulum_errs_nowhere_whatever_the_log_is_taken_for():
    u, theta = 2.0 * slow_drive(2000, 1), np.array([0.05, 0.1, 0.2, 0.02, 1.5, 0.4])
    y = axis_motion(theta, axis_log(u, orders=HANGS)._replace(of_position=True))
    law = FrictionLaw([Viscous(0.1), Coulomb(0.2)])

    def gravity(*weights):
        return position_effects(np.array(weights), AxisForm(orders=HANGS))[1][0]

    model = AxisModel(0.05, law, (InputOffset(0.02), gravity(1.5, 0.4)), dt=0.005, logged="position")
    errors = [window_errors(model, view(u, y, 0.005, logged), 100, 60) for logged in ("output", "position")]
    np.testing.assert_array_equal(*errors)
    wrong = AxisModel(0.05, law, (InputOffset(0.02), gravity(1.3, 0.4)), dt=0.005, logged="position")
    assert np.std(errors[0]) < 0.05 * np.std(window_errors(wrong, view(u, y, 0.005, "output"), 100, 60))


def test_without_a_model_a_position_goes_on_and_a_white_output_has_its_mean():
    t = np.arange(1000.0)
    line = view(U, 0.3 * t, 1.0, "position")
    assert np.abs(window_errors(None, line, 50, 30)).max() < 1e-8
    white = view(RNG.standard_normal(1000), 5.0 + U, 1.0, "output")
    assert np.std(window_errors(None, white, 50, 40)) == pytest.approx(1.0, rel=0.15)
