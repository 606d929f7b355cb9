from __future__ import annotations

import numpy as np
import pytest

from whsklearn.filtering import causal_delay, causal_kernels, causal_motion, causal_window

RATE = 1000.0


def tone(frequency, seconds=4.0, phase=0.3):
    t = np.arange(int(seconds * RATE)) / RATE
    return np.cos(2 * np.pi * frequency * t + phase)


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


def test_windows_and_cutoffs_that_cannot_be_are_told():
    with pytest.raises(ValueError, match="between 0 and 500 Hz"):
        causal_window(RATE, 500.0)
    with pytest.raises(ValueError, match="odd window"):
        causal_kernels(RATE, 10)
