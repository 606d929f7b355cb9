"""Compensators, chains, Structured Text."""

from __future__ import annotations

import ctypes
import re
import subprocess

import numpy as np
import pytest

from whsklearn import ServoAxis, WienerHammersteinSystem
from whsklearn.effects import Cogging, DisturbanceTone, GravityImbalance, InputDelay, Stribeck, as_law
from whsklearn.export import export_model
from whsklearn.models import AxisModel, save_model

FLAGS = ["-std=c99", "-Wall", "-Wextra", "-Wconversion", "-Werror", "-pedantic", "-shared", "-fPIC"]


def test_a_compensator_is_the_sum_of_the_steady_torques(compiler, tmp_path):
    effects = [Cogging(0.1, 12.0, 0.4), GravityImbalance(0.3, 0.2), Stribeck(0.1), DisturbanceTone(0.1, 5.0)]
    axis = ServoAxis(effects=effects)
    done = export_model(axis, to="c", out=tmp_path / "comp.c", what="compensator")
    assert [x.name for x in done.losses] == ["disturbance_tone"]
    subprocess.run([compiler, *FLAGS, "comp.c", "-o", "comp.so", "-lm"], cwd=tmp_path, check=True)
    torque = ctypes.CDLL(str(tmp_path / "comp.so")).comp_torque
    torque.argtypes, torque.restype = [ctypes.c_double] * 2, ctypes.c_double
    for q, v in ((0.3, 1.0), (-1.0, -0.05), (2.0, 4.0)):
        steady = axis.with_parameters({}).law(0.0, v) + 0.1 * np.cos(12 * q + 0.4) + 0.3 * np.cos(q + 0.2)
        steady += np.sign(v) * 0.1 * np.exp(-abs((v / effects[2].shape["velocity"]) ** effects[2].shape["exponent"]))
        assert torque(q, v) == pytest.approx(float(steady), abs=1e-8)  # level just off rest


def test_what_cannot_be_a_compensator_is_refused(tmp_path):
    with pytest.raises(ValueError, match="chain"):
        export_model(WienerHammersteinSystem.example(), to="c", out=tmp_path, what="compensator")
    with pytest.raises(ValueError, match="code"):
        export_model(ServoAxis(), to="urdf", out=tmp_path, what="compensator")
    with pytest.raises(ValueError, match="expected one of"):
        export_model(ServoAxis(), to="docx", out=tmp_path)
    with pytest.raises(ValueError, match="cannot be exported"):
        export_model(3.0, to="c", out=tmp_path)


BAD = {100: float("nan"), 101: float("inf"), 400: float("-inf"), 401: 1e35}


@pytest.mark.parametrize("real", ["double", "float"])
@pytest.mark.parametrize(
    "model",
    [ServoAxis(effects=[InputDelay(0.004), Cogging(0.1, 12.0)]), WienerHammersteinSystem.example()],
    ids=["axis", "chain"],
)
def test_a_drive_that_is_no_number_is_held_and_does_no_harm(replay, drive, tmp_path, model, real):
    export_model(model, to="c", out=tmp_path, real=real)
    broken, mended = drive[:1000].copy(), drive[:1000].copy()
    for at, value in BAD.items():
        broken[at], mended[at] = value, mended[at - 1]
    held = np.array([not abs(u) < 1e9 for u in broken])
    np.testing.assert_array_equal(replay(broken, real), replay(mended, real))
    np.testing.assert_array_equal(replay.flags(broken, real), held)


def test_a_drive_that_begins_with_no_number_begins_at_zero(replay, drive, tmp_path):
    export_model(ServoAxis(effects=[InputDelay(0.004)]), to="c", out=tmp_path)
    broken = np.r_[np.nan, drive[:200]]
    np.testing.assert_array_equal(replay(broken), replay(np.nan_to_num(broken)))


def test_the_function_block_acts_on_what_it_holds(tmp_path):
    for k, model in enumerate((ServoAxis(effects=[InputDelay(0.004)]), WienerHammersteinSystem.example())):
        text = export_model(model, to="st", out=tmp_path / str(k)).paths[0].read_text()
        body = text[text.index("END_IF;", text.index("held :=")) :]
        assert re.search(r"held : BOOL", text)
        assert not re.search(r"\bdrive\b", body), "a drive that was not checked gets in"
        assert re.search(r"\bacting\b", body)


def test_a_compensator_of_a_velocity_in_rpm_takes_a_position_in_turns(compiler, tmp_path):
    effects = [Cogging(0.1, 12.0, 0.4)]
    model = AxisModel(0.05, as_law("viscous"), effects, units={"input": "mNm", "output": "rpm"}, logged="velocity")
    save_model(model, tmp_path / "model.json")
    export_model(tmp_path / "model.json", to="c", out=tmp_path / "comp.c", what="compensator")
    assert "position in turns, velocity in rpm; torque: drive in mNm" in (tmp_path / "comp.h").read_text()
    subprocess.run([compiler, *FLAGS, "comp.c", "-o", "comp.so", "-lm"], cwd=tmp_path, check=True)
    torque = ctypes.CDLL(str(tmp_path / "comp.so")).comp_torque
    torque.argtypes, torque.restype = [ctypes.c_double] * 2, ctypes.c_double
    steady = ServoAxis(law=model.law).law(0.0, 30.0 * np.pi / 30.0) + 0.1 * np.cos(12 * 0.1 * 2.0 * np.pi + 0.4)
    assert torque(0.1, 30.0) == pytest.approx(1e3 * float(steady))
