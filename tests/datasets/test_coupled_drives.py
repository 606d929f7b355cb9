"""The twin of the coupled drives has the dynamics that were published."""

from __future__ import annotations

import numpy as np
import pytest

from whsklearn.datasets import make_coupled_drives
from whsklearn.datasets.coupled_drives import DENOMINATOR, NUMERATOR


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
