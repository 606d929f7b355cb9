"""An axis is the same axis in the units of any log: same structure, and numbers that convert into each other."""

from __future__ import annotations

import numpy as np

from whsklearn.identification import identify
from whsklearn.logs.units import factor_of

DT = 0.005
TRUTH = {"inertia": 0.05, "viscous": 0.2, "coulomb": 0.4}


def rig(n=600):
    """An axis with smoothed friction, integrated here by fine steps of Euler's method: drive in Nm, position in rad."""
    t = DT * np.arange(n)
    drive = 1.5 * np.sin(2.1 * t) + 1.2 * np.sin(7.3 * t + 1.0)
    q = v = 0.0
    position = np.empty(n)
    for k in range(n):
        position[k] = q
        for _ in range(50):
            a = (drive[k] - TRUTH["viscous"] * v - TRUTH["coulomb"] * np.tanh(v / 1e-3)) / TRUTH["inertia"]
            v += DT / 50 * a
            q += DT / 50 * v
    return drive, position + np.random.default_rng(0).normal(0.0, 1e-5, n)


def test_structure_and_numbers_do_not_depend_on_the_units_of_the_log():
    """A drive in mNm, and a position in counts of which no turn is stated, so that the numbers are per count."""
    drive, position = rig()
    count = 2 * np.pi / 65536
    logged, units = np.round(position / count), {"input": "mNm", "output": "counts"}
    found = identify(drive / factor_of("mNm")[0], logged, dt=DT, units=units)
    assert found.recommended.name == "axis, viscous and Coulomb"
    model = found.model  # in SI
    for name, power in (("inertia", 1), ("viscous", 1), ("coulomb", 0)):
        error = model.standard_errors[name] / count**power
        value = model.parameters[name] / count**power
        assert abs(value - TRUTH[name]) < 3.0 * error + 1e-3 * TRUTH[name]
        assert error < 0.1 * TRUTH[name]
