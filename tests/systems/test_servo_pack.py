"""An axis as flat arrays: what does nothing is left out, and what cannot be packed is refused."""

from __future__ import annotations

import math

import numpy as np
import pytest

from whsklearn import ServoAxis
from whsklearn.effects import Cogging, Coulomb, InputDelay, Saturation, Viscous, codes
from whsklearn.systems import Drive, PIDController, Sensor, Transmission
from whsklearn.systems._servo_pack import controller_of, pack, parts_of, plant_of


def test_effects_of_neutral_size_are_left_out():
    plant = pack(ServoAxis(law=[Viscous(0.1), Coulomb(0.0)], effects=[Cogging(0.0), Saturation(math.inf)]))
    assert plant.codes.tolist() == [codes.VISCOUS]
    assert plant.p[0, 0] == 0.1


def test_rows_are_in_the_order_of_the_effects_with_their_numbers_first():
    effects = [Cogging(0.2, 7.0, 0.3), Viscous(0.1)]
    plant = plant_of(effects, np.zeros(12))
    assert plant.codes.tolist() == [e.code for e in effects]
    for row, e in zip(plant.p, effects, strict=True):
        np.testing.assert_array_equal(row[: len(e.row)], e.row)
        assert not row[len(e.row) :].any()


def test_parts_hold_what_is_no_effect():
    axis = ServoAxis(
        inertia=0.03, friction="tanh", smoothing=0.02, drive=Drive(2.0, 5.0, 0.003, 0.004),
        transmission=Transmission(0.4, 30.0, 0.1, 0.01), sensor=Sensor(1e-3, side="load"),
    )  # fmt: skip
    np.testing.assert_allclose(parts_of(axis), [0.03, 50.0, 2.0, 5.0, 0.003, 0.004, 0.4, 30.0, 0.1, 0.01, 1e-3, 1.0])
    rigid = parts_of(ServoAxis())
    assert rigid[1] == math.inf  # true stiction
    assert not rigid[6:10].any()


def test_a_controllers_switch_is_a_number():
    for source in ("error", "measurement"):
        c = PIDController(kp=3.0, ki=2.0, kd=1.0, derivative_on=source)
        row = controller_of(ServoAxis(controller=c))
        assert row[:3] == (3.0, 2.0, 1.0)
        assert row[6] == float(source == "measurement")


def test_a_drive_cannot_act_early():
    with pytest.raises(ValueError, match="cannot act early"):
        pack(ServoAxis(drive=Drive(delay=0.001), effects=[InputDelay(-0.004)]))
