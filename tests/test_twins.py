"""The twin of the Silverbox."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks._twins import DENOMINATOR, NUMERATOR, make_coupled_drives, make_silverbox


def test_a_small_drive_moves_it_as_its_linear_part():
    """Of the start of the arrow, where the cubic is next to nothing, in the frequency domain."""
    u, y = make_silverbox("arrow", noise=0.0, random_state=0)
    u, y = u[:1500], y[:1500]
    window = np.hanning(1500)
    f = np.fft.rfftfreq(1500, 16384 / 1e7)
    response = np.fft.rfft(window * y)[4:100] / np.fft.rfft(window * u)[4:100]
    slow = f[4:100] < 40.0
    s = 1j * f[4:100] / 68.6
    linear = 1.0 / (1.0 + 2 * 0.047 * s + s**2)
    np.testing.assert_allclose(np.abs(response)[slow].mean(), np.abs(linear)[slow].mean(), rtol=0.03)


def test_the_multisine_is_odd_and_the_arrow_grows_beyond_it():
    u, y = make_silverbox(n_realisations=1, noise=0.0, random_state=1)
    spectrum = np.abs(np.fft.rfft(u[-8192:]))
    assert spectrum[::2].max() < 1e-9 * spectrum.max()
    arrow = make_silverbox("arrow", n_realisations=2, noise=0.0, random_state=1)[1]
    assert np.abs(arrow[-2000:]).max() > 1.1 * np.abs(y).max()


def test_another_kind_is_refused():
    with pytest.raises(ValueError, match="kind is 'chirp'"):
        make_silverbox("chirp")


def test_a_constant_input_ends_at_the_static_gain():
    u, y = make_coupled_drives(1000, kind="uniform", noise=0.0, random_state=0)
    assert (u.reshape(-1, 5) == u[::5, None]).all()
    constant, speed = make_coupled_drives(5, amplitude=0.0, noise=0.0, random_state=0)
    assert not constant.any()
    assert not speed.any()
    gain = NUMERATOR[0] / DENOMINATOR[-1]
    assert 0.5 * gain * np.abs(u).mean() < y.mean() < 1.5 * gain * np.abs(u).max()


def test_the_sensor_has_no_sign_but_noise():
    _, y = make_coupled_drives(5000, noise=0.02, random_state=0)
    assert -0.1 < y.min() < 0.0
    with pytest.raises(ValueError, match="expected 'prbs' or 'uniform'"):
        make_coupled_drives(kind="sine")
