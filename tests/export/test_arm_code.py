"""The C code of an arm asks for the drives that its inverse dynamics gives."""

from __future__ import annotations

import ctypes
import dataclasses
import subprocess

import numpy as np
import pytest

from tests.systems.drawn_arms import drawn_arm
from whsklearn.effects import (
    CableSpring,
    Cogging,
    Coulomb,
    DisturbanceTone,
    InputOffset,
    LoadFriction,
    Stribeck,
    Viscous,
)
from whsklearn.export import export_model


@pytest.mark.parametrize(("seed", "real"), [(0, "double"), (1, "double"), (1, "float")])
def test_the_c_code_asks_for_the_drives_of_the_arm(seed, real, compiler, tmp_path):
    arm = drawn_arm(4, seed, gravity=(0, 0, -9.81))
    first, second, third, _ = arm.joints
    steady = {first: (Viscous(0.3), Coulomb(0.2), Cogging(0.1, 12.0, 0.4)), second: (Stribeck(0.1), CableSpring(0.5))}
    steady |= {f"{first}-{second}": (Viscous(0.2), Coulomb(0.1))}
    driven = arm.with_effects({third: (LoadFriction(0.1), InputOffset(0.2), DisturbanceTone(0.1, 5.0))} | steady)
    done = export_model(driven, to="c", out=tmp_path / "law.c", real=real)
    assert [loss.name for loss in done.losses] == [f"{third}'s disturbance_tone"]
    header = (tmp_path / "law.h").read_text()
    for j, slides in zip(arm.joints, arm.slides, strict=True):
        assert f"{j}: position in {'m' if slides else 'rad'}" in header
    flags = ["-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic", "-shared", "-fPIC"]
    subprocess.run([compiler, *flags, "law.c", "-o", "law.so", "-lm"], cwd=tmp_path, check=True)
    kind = ctypes.c_double if real == "double" else ctypes.c_float
    law, pointer = ctypes.CDLL(str(tmp_path / "law.so")).law_torque, ctypes.POINTER(kind)
    q, v, a = (np.ascontiguousarray(m, dtype=kind) for m in arm.drawn_motion(20))
    torque = np.empty_like(q)
    for rows in zip(q, v, a, torque, strict=True):
        law(*(x.ctypes.data_as(pointer) for x in rows))
    asked = arm.with_effects(steady).inverse_dynamics(*(x.astype(float) for x in (q, v, a)))
    asked[:, 2] += 0.2
    asked[:, 2] += 0.1 * np.abs(asked[:, 2]) * np.sign(v[:, 2])
    np.testing.assert_allclose(torque, asked, atol=(1e-9 if real == "double" else 1e-4) * np.abs(asked).max())


@pytest.mark.parametrize("to", ["c", "mjcf"])
def test_what_a_slide_loses_is_told_in_newtons_and_its_phase_in_radians(to, tmp_path):
    arm = dataclasses.replace(drawn_arm(2, 0), slides=np.array([True, False]))
    effects = {arm.joints[0]: (DisturbanceTone(0.1, 5.0, 0.3), Cogging(0.2, 5.5, 0.4))}
    losses = {
        x.name.partition("'s ")[2]: x.size for x in export_model(arm.with_effects(effects), to=to, out=tmp_path).losses
    }
    assert losses["disturbance_tone"] == "amplitude 0.1 N, frequency 5 Hz, phase 0.3 rad"
    assert losses.get("cogging", "phase 0.4 rad").endswith("phase 0.4 rad")
