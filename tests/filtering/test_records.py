"""Derivative kernels are exact on polynomials."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import butter, filtfilt

from whsklearn.filtering import decimate, motion, zero_phase
from whsklearn.filtering.records import KEPT, encoder_noise, fine_drive, gaussian_derivatives, motion_cutoff

RATE = 1000.0


def tone(frequency, seconds=4.0, phase=0.3):
    t = np.arange(int(seconds * RATE)) / RATE
    return np.cos(2 * np.pi * frequency * t + phase)


@pytest.mark.parametrize("frequency", [1.0, 10.0, 30.0])
def test_zero_phase_shifts_no_tone(frequency):
    x = tone(frequency)
    inner = slice(500, -500)
    y = zero_phase(x, RATE, 100.0)[inner]
    quadrature = tone(frequency, phase=0.3 + np.pi / 2)[inner]
    assert abs(y @ quadrature) < 1e-6 * (y @ x[inner])


def test_zero_phase_halves_the_amplitude_at_the_cutoff():
    x = tone(50.0)
    inner = slice(1000, -1000)
    assert np.std(zero_phase(x, RATE, 50.0)[inner]) == pytest.approx(np.std(x[inner]) / 2, rel=1e-3)


@pytest.mark.parametrize("order", [2, 4])
@pytest.mark.parametrize("shape", [(400,), (400, 1), (400, 3, 2)], ids=str)
@pytest.mark.parametrize("layout", ["C", "F"])
def test_each_column_is_filtered_as_by_scipy(shape, order, layout):
    x = np.asarray(np.random.default_rng(0).standard_normal(shape), order=layout)
    expected = filtfilt(*butter(order, 0.1), x, axis=0, padlen=3 * order)
    np.testing.assert_allclose(zero_phase(x, RATE, 0.05 * RATE, order), expected, atol=1e-12)


def test_motion_converges_with_the_fourth_power_of_the_step():
    errors = []
    for rate in (500.0, 1000.0):
        t = np.arange(int(4 * rate)) / rate
        m = motion(np.sin(20 * t), rate, 100.0, order=6)
        errors.append(np.abs(m.velocity - 20 * np.cos(20 * t))[len(t) // 4 : -len(t) // 4].max())
    assert errors[0] / errors[1] == pytest.approx(16.0, rel=0.1)


def test_decimation_keeps_the_band_drops_the_rest_and_the_last_row():
    slow, fast = tone(5.0), tone(180.0)
    both = decimate(np.column_stack([slow, fast]), 10)
    inner = slice(40, -40)
    assert len(both) == 400
    assert np.allclose(both[inner, 0], slow[9::10][inner], atol=0.02)
    assert np.abs(both[inner, 1]).max() < 1e-3
    odd = decimate(slow[:1003], 10)
    assert len(odd) == 101
    assert np.allclose(odd[inner], slow[:1003][2::10][inner], atol=0.02)


def test_decimation_by_one_is_a_copy():
    x = np.arange(5.0)
    y = decimate(x, 1)
    assert np.array_equal(x, y)
    assert y is not x


@pytest.mark.parametrize("cutoff", [0.0, 500.0, -3.0])
def test_a_cutoff_that_cannot_be_is_told(cutoff):
    with pytest.raises(ValueError, match="between 0 and 500 Hz"):
        zero_phase(np.zeros(100), RATE, cutoff)


def test_short_records_and_factors_that_cannot_be_are_told():
    with pytest.raises(ValueError, match="needs 13"):
        zero_phase(np.zeros(12), RATE, 50.0)
    with pytest.raises(ValueError, match="needs 25"):
        decimate(np.zeros(20), 4)
    with pytest.raises(ValueError, match="whole number"):
        decimate(np.zeros(200), 0)


@pytest.mark.parametrize("sigma", [0.002, 0.01])
def test_kernels_are_exact_on_parabolas(sigma):
    dt = 0.001
    g, g1, g2 = gaussian_derivatives(sigma, dt)
    t = np.arange(400) * dt
    parabola = 100.0 + 3.0 * t + 2.0 * t**2
    inside = t[g.size // 2 : t.size - g.size // 2]
    np.testing.assert_allclose(np.convolve(parabola, g1, mode="valid"), 3.0 + 4.0 * inside, rtol=1e-6)
    np.testing.assert_allclose(np.convolve(parabola, g2, mode="valid"), 4.0, rtol=1e-4)


def test_a_constant_has_no_derivative():
    _, g1, g2 = gaussian_derivatives(0.004, 0.001)
    assert abs(g1.sum()) < 1e-9 * np.abs(g1).sum()
    assert abs(g2.sum()) < 1e-9 * np.abs(g2).sum()  # else a position offset would be a phantom torque


@pytest.mark.parametrize("dt", [1e-4, 1e-3, 5e-3, 0.02])
@pytest.mark.parametrize("width", [0.7, 1.0, 4.4, 20.0])
def test_derivative_kernels_are_exact_on_polynomials_at_every_rate_and_width(dt, width):
    t = np.arange(400) * dt
    for kernel, order in zip(gaussian_derivatives(width * dt, dt), range(3), strict=True):
        assert np.convolve(np.full(400, 100.0), kernel, mode="valid") * dt**order == pytest.approx(
            100.0 if order == 0 else 0.0, abs=1e-8
        )
        for power in range(1, 3):
            seen = np.convolve(t**power, kernel, mode="valid")
            half = kernel.size // 2
            inner = t[half : t.size - half]
            wanted = {(1, 1): 1.0, (1, 2): 0.0, (2, 1): 2 * inner, (2, 2): 2.0}.get((power, order))
            if wanted is not None:
                assert seen == pytest.approx(wanted, abs=1e-6 * t[-1] / dt**order)


def test_a_held_drive_stays_until_the_next_sample():
    assert fine_drive(np.array([1.0, 3.0]), 3).tolist() == [[1.0] * 3, [3.0] * 3]


def test_a_smooth_drive_is_that_of_a_band_limited_signal():
    """A sine of nine samples a period, away from the ends."""
    at = np.arange(90)[:, None] + (np.arange(4) + 0.5) / 4
    fine = fine_drive(np.sin(2 * np.pi * np.arange(90) / 9), 4, "cubic")
    np.testing.assert_allclose(fine[20:70], np.sin(2 * np.pi * at / 9)[20:70], atol=1e-3)


@pytest.mark.parametrize("cut", [30, 45])
def test_segments_know_nothing_of_each_other(cut):
    u = np.random.default_rng(0).standard_normal(90)
    both = fine_drive(u, 2, "cubic", np.array([0, cut, 90]))
    np.testing.assert_allclose(both[:cut], fine_drive(u[:cut], 2, "cubic"), atol=1e-12)
    np.testing.assert_allclose(both[cut:], fine_drive(u[cut:], 2, "cubic"), atol=1e-12)


ENCODER_RATE = 2000.0


def position(frequencies=(0.5, 1.3, 3.7), seconds=20.0):
    t = np.arange(int(seconds * ENCODER_RATE)) / ENCODER_RATE
    return sum(np.sin(2 * np.pi * f * t + f) / (1 + f) for f in frequencies)


def on_counts(q, counts):
    step = 2 * np.pi / counts
    return step * np.round(q / step)


@pytest.mark.parametrize("counts", [1000, 4096, 20_000])
def test_the_noise_of_an_encoder_is_that_of_rounding(counts):
    step = 2 * np.pi / counts
    assert encoder_noise(on_counts(position(), counts), ENCODER_RATE) == pytest.approx(step / np.sqrt(12), rel=0.3)


def test_a_finer_encoder_allows_a_higher_cutoff():
    cutoffs = [motion_cutoff(on_counts(position(), counts), ENCODER_RATE) for counts in (1000, 4096, 20_000, 200_000)]
    assert cutoffs == sorted(cutoffs)
    assert cutoffs[0] < cutoffs[-1] < motion_cutoff(position(), ENCODER_RATE)


@pytest.mark.parametrize("counts", [1000, 4096, 20_000])
def test_the_motion_passes(counts):
    q = on_counts(position(), counts)
    inner = slice(4000, -4000)
    kept = np.var(motion(q, ENCODER_RATE, motion_cutoff(q, ENCODER_RATE)).acceleration[inner])
    assert kept > 0.9 * KEPT * np.var(motion(position(), ENCODER_RATE, 100.0).acceleration[inner])


def test_the_unit_makes_no_difference():
    q = on_counts(position(), 4096)
    assert motion_cutoff(1e3 * q, ENCODER_RATE) == motion_cutoff(q, ENCODER_RATE)
    assert encoder_noise(1e3 * q, ENCODER_RATE) == pytest.approx(1e3 * encoder_noise(q, ENCODER_RATE))
