"""The shipped records are those of the axis that their description names."""

from __future__ import annotations

import numpy as np
import pytest

from whsklearn.datasets import load_turntable


@pytest.mark.parametrize("experiment", ["sine", "multisine"])
def test_records_are_even_and_finite(experiment):
    log = load_turntable(experiment)
    assert list(log) == ["time_s", "reference_rad", "torque_nm", "position_rad"]
    assert np.isfinite(log.to_numpy()).all()
    np.testing.assert_allclose(np.diff(log["time_s"]), np.diff(log["time_s"])[0], rtol=1e-6)


def test_the_sine_is_the_papers_reference():
    log = load_turntable("sine")
    np.testing.assert_allclose(log["reference_rad"], 0.8 * np.sin(0.4 * np.pi * log["time_s"]), atol=1e-6)


def test_as_arrays_and_an_unknown_name():
    X, y = load_turntable("sine", return_X_y=True)
    assert X.shape == (4000, 1)
    assert y.shape == (4000,)
    with pytest.raises(ValueError, match="Unknown experiment"):
        load_turntable("square")
