"""What belongs to neither speed nor place."""

from __future__ import annotations

import numpy as np
import pytest

from whsklearn.effects import DisturbanceTone, ParameterChange


@pytest.mark.parametrize(
    ("parameter", "signal", "sign"),
    [("inertia", "acceleration", 1), ("viscous", "velocity", 1), ("coulomb", "velocity", 1), ("gain", "drive", -1)],
)
def test_a_change_is_its_regressor_from_its_instant_on(parameter, signal, sign):
    t = np.array([0.9, 0.999, 1.0, 2.0])
    values = ParameterChange(0.5, time=1.0, parameter=parameter).value(time=t, **{signal: np.ones(4)})
    np.testing.assert_allclose(values, [0.0, 0.0, 0.5 * sign, 0.5 * sign])  # t_0 is included


def test_an_unknown_parameter_is_refused():
    with pytest.raises(ValueError, match="expected one of inertia"):
        ParameterChange(0.1, parameter="mass")


def test_a_tone_knows_time_alone():
    tone = DisturbanceTone(0.05, frequency=4.0, phase=0.3)
    t = np.linspace(0, 1, 50)
    np.testing.assert_allclose(tone.value(time=t + 0.25), tone.value(time=t), atol=1e-12)
    np.testing.assert_array_equal(tone.value(time=t, position=t, velocity=-t), tone.value(time=t))
