"""The C code of an axis replays what the library simulates."""

from __future__ import annotations

import numpy as np
import pytest

from tests.own_effect import Magnet
from whsklearn import ServoAxis
from whsklearn.effects import (
    BoucWen,
    CableSpring,
    GeneralizedMaxwellSlip,
    InputDelay,
    LuGre,
    effect_names,
    get_effect,
)
from whsklearn.export import export_model

SIZES = {"saturation": 0.8, "input_delay": 3e-3, "actuator_lag": 3e-3, "asymmetric_viscous": 0.05, "dead_zone": 0.05}
# what can be on one axis, compiled together
GROUPS = {
    "drive": "dead_zone saturation input_delay actuator_lag torque_ripple input_offset load_friction",
    "friction": "viscous coulomb asymmetric_coulomb asymmetric_viscous stribeck quadratic_drag position_friction "
    "friction_drift presliding_hysteresis early_reversal",
    "position": "cogging gravity_imbalance cable_spring hardening_spring end_stop disturbance_tone parameter_change",
    "sensor": "output_offset output_drift sensor_rectification encoder_eccentricity quantization",
    "backlash": "backlash cogging",
    "flexible_coupling": "flexible_coupling gravity_imbalance",
}
REST = "learned_torque"  # cannot be made without a record


def _axis(*effects, **changes):
    return ServoAxis(effects=[CableSpring(0.5), *effects], **{"substeps": 2, **changes})


def _same(axis, drive, tmp_path, replay):
    export_model(axis, to="c", out=tmp_path)
    own = axis.simulate_drive(drive, noise=False).position
    np.testing.assert_allclose(replay(drive), own, rtol=0, atol=1e-12)


@pytest.mark.parametrize("names", GROUPS.values(), ids=GROUPS)
def test_every_effect(names, drive, tmp_path, replay):
    effects = [get_effect(n)() for n in names.split()]
    _same(_axis(*(e.resized(SIZES[e.name]) if e.name in SIZES else e for e in effects)), drive, tmp_path, replay)


def test_no_effect_is_forgotten():
    ours = {n for n in effect_names() if get_effect(n).__module__.startswith("whsklearn.")}  # other tests define more
    assert ours - {REST} <= {n for names in GROUPS.values() for n in names.split()}


def test_friction_with_memory(drive, tmp_path, replay):
    _same(_axis(LuGre(0.1, 0.01), GeneralizedMaxwellSlip(0.1, 0.01), BoucWen(0.1, 0.01)), drive, tmp_path, replay)


@pytest.mark.parametrize("changes", [{"friction": "tanh", "smoothing": 0.05}, {"sample_rate": 200.0, "substeps": 7}])
def test_other_axes(changes, drive, tmp_path, replay):
    _same(_axis(**changes), drive, tmp_path, replay)


def test_a_delay_between_two_samples(drive, tmp_path, replay):
    _same(_axis(InputDelay(0.0017), substeps=4), drive, tmp_path, replay)


def test_an_effect_of_ones_own(drive, tmp_path, replay):
    _same(_axis(Magnet(0.2, 0.3)), drive, tmp_path, replay)


def test_single_precision_is_single(drive, tmp_path, replay):
    axis = _axis()
    export_model(axis, to="c", out=tmp_path, real="float")
    assert "double" not in (tmp_path / "model.c").read_text()
    own = axis.simulate_drive(drive, noise=False).position
    assert np.sqrt(np.mean((replay(drive, "float") - own) ** 2)) < 1e-3 * np.std(own)


def test_nothing_is_allocated(tmp_path):
    export_model(_axis(InputDelay(0.003)), to="c", out=tmp_path)
    assert "alloc" not in (tmp_path / "model.c").read_text()


@pytest.mark.parametrize("order", [1.0, 12.0, 300.0])
def test_waves_are_remembered_slow_and_fast(order, drive, tmp_path, replay):
    """Within a tenth of a radian of the last place, and where a step goes further."""
    axis = _axis(get_effect("cogging")(0.1, order, 0.4), get_effect("torque_ripple")(0.1, order, 1.0))
    _same(axis, drive, tmp_path, replay)
    text = (tmp_path / "model.c").read_text()
    assert text.count("near_cos(&s->wave[0]") >= 2  # the branches of one step share a slot
    assert "s->wave[6]" not in text
