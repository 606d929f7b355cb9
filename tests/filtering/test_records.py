from __future__ import annotations

import numpy as np
import pytest

from whsklearn.filtering import decimate, motion, zero_phase

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
