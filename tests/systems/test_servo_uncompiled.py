"""The compiled kernel is its own reference: run uncompiled, it gives the same numbers."""

from __future__ import annotations

import os
import subprocess
import sys

import numpy as np

SCRIPT = """
import numpy as np
from whsklearn.effects import (BoucWen, Coulomb, Cogging, EncoderEccentricity, FrictionDrift, GeneralizedMaxwellSlip,
    InputDelay, ActuatorLag, DeadZone, LoadFriction, LuGre, PositionFriction, Stribeck, TorqueRipple, Viscous, Backlash)
from whsklearn.systems import ServoAxis, Sensor
law = [Viscous(0.1), Coulomb(0.2), Stribeck(0.1, 0.1, 1.5)]
late = [InputDelay(0.0013), ActuatorLag(0.002), DeadZone(0.02), TorqueRipple(0.1, 3.0), EncoderEccentricity(1e-3)]
dry = [PositionFriction(0.05, 2.0), LoadFriction(0.05), FrictionDrift(0.1, 1.0), Cogging(0.05, 8.0, 1.0)]
path = [LuGre(0.1, 0.01), GeneralizedMaxwellSlip(0.1, 0.01, 4.0, 1.3), BoucWen(0.1, 0.01), Backlash(0.01)]
reference = 0.3 * np.sin(np.arange(60) / 8.0)
for effects in (late, dry, path):
    for friction in ("stick", "tanh"):
        axis = ServoAxis(0.05, law, effects, friction=friction, sensor=Sensor(1e-5, 1e-5), substeps=4)
        record = axis.simulate(reference, random_state=1)
        print(*(repr(float(record[k][-1])) for k in ("true_position", "drive", "load_position")))
"""


def test_uncompiled_is_the_same(capsys):
    exec(SCRIPT, {})
    compiled = np.array([float(x) for x in capsys.readouterr().out.split()])
    environment = os.environ | {"NUMBA_DISABLE_JIT": "1"}
    run = subprocess.run([sys.executable, "-c", SCRIPT], env=environment, capture_output=True, text=True, check=True)
    plain = np.array([float(x) for x in run.stdout.split()])
    assert compiled.size == 18
    np.testing.assert_allclose(compiled, plain, rtol=1e-9, atol=1e-12)
