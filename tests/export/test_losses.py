"""What a format cannot hold is told with its size."""

from __future__ import annotations

from whsklearn import ServoAxis
from whsklearn.effects import Cogging, InputOffset, TorqueRipple
from whsklearn.export.losses import left_out, lost_parts, parts_of, size_of
from whsklearn.systems import Drive, Sensor, Transmission


def test_sizes_carry_their_units():
    assert size_of(Cogging(0.05, 12.0)) == "amplitude 0.05 Nm, order 12, phase 0 rad"


def test_what_does_nothing_is_no_loss():
    axis = ServoAxis(effects=[InputOffset(0.0), TorqueRipple(0.02, 6.0)])
    assert [e.name for e in parts_of(axis)] == ["viscous", "coulomb", "torque_ripple"]


def test_only_what_is_not_held_is_lost():
    axis = ServoAxis(effects=[Cogging(0.05, 12.0), TorqueRipple(0.02, 6.0)])
    lost = left_out(axis, lambda e: e.name != "torque_ripple", "no such thing")
    assert [str(x) for x in lost] == ["torque_ripple (amplitude 0.02, order 6, phase 0 rad): no such thing"]


def test_parts_are_lost_where_the_format_lacks_them():
    axis = ServoAxis(
        drive=Drive(delay=0.002, limit=5.0), transmission=Transmission(stiffness=100.0), sensor=Sensor(noise=1e-4)
    )
    names = {x.name for x in lost_parts(axis, timing=False, transmission=False, limit=False)}
    assert names == {"drive delay", "drive limit", "transmission", "sensor noise"}
    assert {x.name for x in lost_parts(axis, timing=True, transmission=True, limit=True)} == {"sensor noise"}
