from __future__ import annotations

import numpy as np
import pytest

from whsklearn.filtering import (
    causal_delay,
    causal_kernels,
    causal_motion,
    causal_window,
    decimate,
    motion,
    zero_phase,
)

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


def test_motion_converges_with_the_square_of_the_step():
    errors = []
    for rate in (500.0, 1000.0):
        t = np.arange(int(4 * rate)) / rate
        m = motion(np.sin(20 * t), rate, 100.0, order=6)
        errors.append(np.abs(m.velocity - 20 * np.cos(20 * t))[len(t) // 4 : -len(t) // 4].max())
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.1)


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


@pytest.mark.parametrize("degree", [2, 3, 4])
def test_causal_kernels_are_exact_for_their_polynomial(degree):
    window = 11
    w = causal_kernels(200.0, window, degree)
    t = np.arange(window) / 200.0
    coefficients = np.arange(1.0, degree + 2.0)
    p = np.polynomial.Polynomial(coefficients)
    middle = t[window // 2]
    expected = [p(middle), p.deriv()(middle), p.deriv(2)(middle)]
    assert w @ p(t) == pytest.approx(expected, rel=1e-9)


def test_causal_motion_is_late_by_half_a_window_at_every_frequency():
    kernels = causal_kernels(RATE, 21)
    for frequency in (0.5, 5.0, 20.0):
        x = tone(frequency)
        smooth = causal_motion(x, np.empty(0), kernels)[0].position[100:]
        late = tone(frequency)[90:-10]
        quadrature = tone(frequency, phase=0.3 + np.pi / 2)[90:-10]
        whole = int(RATE / frequency) * max(int(len(late) * frequency / RATE), 1)
        assert abs(smooth[:whole] @ quadrature[:whole]) < 1e-3 * (smooth[:whole] @ late[:whole])


def test_causal_motion_does_not_depend_on_the_cut():
    rng = np.random.default_rng(0)
    x = rng.normal(size=500).cumsum()
    kernels = causal_kernels(RATE, 15, 4)
    whole = np.array(causal_motion(x, np.empty(0), kernels)[0])
    for cut in (1, 3, 14, 15, 499):
        memory, pieces = np.empty(0), []
        for i in range(0, 500, cut):
            m, memory = causal_motion(x[i : i + cut], memory, kernels)
            pieces.append(np.array(m))
        assert np.array_equal(np.concatenate(pieces, axis=1), whole)


def test_a_delay_does_not_depend_on_the_cut():
    x = np.arange(1.0, 31.0)
    for cut in (1, 4, 30):
        memory, pieces = np.empty(0), []
        for i in range(0, 30, cut):
            late, memory = causal_delay(x[i : i + cut], memory, 7)
            pieces.append(late)
        assert np.array_equal(np.concatenate(pieces), np.r_[np.zeros(7), x[:23]])


@pytest.mark.parametrize("degree", [2, 3, 4])
def test_causal_window_has_its_3_db_point_near_the_cutoff(degree):
    window = causal_window(RATE, 40.0, degree)
    weights = causal_kernels(RATE, window, degree)[0]
    response = np.abs(weights @ np.exp(-2j * np.pi * 40.0 / RATE * np.arange(window)))
    assert response == pytest.approx(np.sqrt(0.5), abs=0.05)


@pytest.mark.parametrize("cutoff", [0.0, 500.0, -3.0])
def test_a_cutoff_that_cannot_be_is_told(cutoff):
    with pytest.raises(ValueError, match="between 0 and 500 Hz"):
        zero_phase(np.zeros(100), RATE, cutoff)
    with pytest.raises(ValueError, match="between 0 and 500 Hz"):
        causal_window(RATE, cutoff)


def test_short_records_and_odd_numbers_are_told():
    with pytest.raises(ValueError, match="needs 13"):
        zero_phase(np.zeros(12), RATE, 50.0)
    with pytest.raises(ValueError, match="needs 25"):
        decimate(np.zeros(20), 4)
    with pytest.raises(ValueError, match="whole number"):
        decimate(np.zeros(200), 0)
    with pytest.raises(ValueError, match="odd window"):
        causal_kernels(RATE, 10)
