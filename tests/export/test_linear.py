"""Linear parts answer as the models do where the models are linear."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import dlsim

from whsklearn import ServoAxis, WienerHammersteinSystem
from whsklearn.effects import CableSpring, FrictionLaw, Viscous, as_law
from whsklearn.export import to_control, to_dlti
from whsklearn.models import AxisModel, LinearModel


def test_a_linear_axis(drive):
    axis = ServoAxis(law=FrictionLaw([Viscous(0.3)]), effects=[CableSpring(0.5)])
    system, losses = to_dlti(axis)
    assert not losses
    own = axis.simulate_drive(drive).position
    np.testing.assert_allclose(dlsim(system, drive)[1][:, 0], own, atol=1e-5 * np.std(own))


IN_MM = {"input": "N", "output": "mm"}


def test_what_a_linear_system_of_a_slide_omits_is_told_in_newtons_and_metres():
    slide = AxisModel(2.0, as_law("viscous,coulomb"), [CableSpring(0.5, 0.1)], units=IN_MM, logged="position")
    sizes = [x.size for x in to_dlti(slide)[1]]
    assert [size.rpartition(" ")[2] for size in sizes] == ["N", "m"]


@pytest.mark.parametrize(
    "model", [WienerHammersteinSystem([1.0, 2.0], [0.5], [1.0], [0.2], law="viscous"), LinearModel([0, 0.5], [1, -0.5])]
)
def test_a_linear_chain(model, drive):
    system, losses = to_dlti(model)
    assert not losses
    np.testing.assert_allclose(dlsim(system, drive)[1][:, 0], model.simulate(drive), atol=1e-9)


def test_python_control_agrees():
    pytest.importorskip("control", reason="python-control is not installed (extra control)")
    system, losses = to_control(ServoAxis())
    assert [x.name for x in losses] == ["coulomb"]
    np.testing.assert_allclose(np.sort(np.abs(system.poles())), np.sort(np.abs(to_dlti(ServoAxis())[0].poles)))


def test_a_law_without_a_linear_term_has_no_linear_part():
    with pytest.raises(ValueError, match="no linear"):
        to_dlti(WienerHammersteinSystem([1.0], [], [1.0], [], law="coulomb"))
