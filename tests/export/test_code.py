"""Compensators, chains, Structured Text."""

from __future__ import annotations

import ctypes
import subprocess

import numpy as np
import pytest

from whsklearn import ServoAxis, WienerHammersteinSystem
from whsklearn.effects import Cogging, DisturbanceTone, GravityImbalance, Stribeck
from whsklearn.export import export_model

FLAGS = ["-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic", "-shared", "-fPIC"]


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
