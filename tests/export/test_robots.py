"""URDF and Isaac Lab."""

from __future__ import annotations

import ast
import xml.etree.ElementTree as ET

from whsklearn import ServoAxis
from whsklearn.effects import Cogging, EndStop, InputDelay, Saturation
from whsklearn.export import export_model


def test_urdf_holds_dynamics_and_limits(tmp_path):
    axis = ServoAxis(effects=[Saturation(2.0), EndStop(100.0, 1.5), Cogging(0.1, 12.0)])
    done = export_model(axis, to="urdf", out=tmp_path)
    joint = ET.parse(done.paths[0]).getroot().find("joint")
    assert joint.find("dynamics").attrib == {"damping": "0.12", "friction": "0.3"}
    assert joint.find("limit").attrib == {"effort": "2", "velocity": "1e9", "lower": "-1.5", "upper": "1.5"}
    assert {x.name for x in done.losses} == {"cogging", "end_stop"}


def test_isaac_is_python_with_friction_and_delay(tmp_path):
    axis = ServoAxis(effects=[InputDelay(0.004), Saturation(2.0)])
    done = export_model(axis, to="isaac", out=tmp_path)
    call = ast.parse(done.paths[0].read_text()).body[-1].value
    values = {k.arg: ast.literal_eval(k.value) for k in call.keywords}
    assert values["armature"] == axis.inertia
    assert (values["friction"], values["viscous_friction"]) == (0.3, 0.12)
    assert (values["min_delay"], values["max_delay"], values["effort_limit"]) == (4, 4, 2.0)
    assert not done.losses
