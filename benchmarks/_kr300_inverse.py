"""Axis 1 of a KUKA KR300: friction fitted to record A alone, an effect stays if it helps on B and C as well.

The rest of the arm moves too, so inertia and offset belong to the record (7.9, 4.8 and 5.4 Nm s2/rad at the motor);
what is left on A, 14 %, follows position and acceleration as the coupling to the other axes would, and 6 to 7 Hz, a
line that stays where it is at any speed: the arm's elasticity.
"""

from __future__ import annotations

import numpy as np

from whsklearn.effects import (
    AsymmetricViscous,
    Coulomb,
    HardeningSpring,
    LoadFriction,
    PreslidingHysteresis,
    QuadraticDrag,
    Stribeck,
    Viscous,
)
from whsklearn.lags import InverseDynamicsLags

CANDIDATES = {
    "presliding_hysteresis": [PreslidingHysteresis(1.0, d) for d in (1e-5, 3e-5, 1e-4)],
    "stribeck": [Stribeck(1.0, v, 1.0) for v in (0.01, 0.02, 0.05)],
    "load_friction": [LoadFriction(1.0)],
    "asymmetric_viscous": [AsymmetricViscous(1.0)],
    "quadratic_drag": [QuadraticDrag(1.0)],
    "hardening_spring": [HardeningSpring(1.0)],
}
OWN = ("inertia", "input_offset")  # of the record: the arm's pose and the amplifier's zero


def rows(frame, effects):
    """Motor torque on motion of the motor, in rad of the load."""
    lags = InverseDynamicsLags(
        sample_rate=250.0,
        law=[Viscous(1.0), Coulomb(1.0)],
        effects=["input_offset", *effects],
        cutoff=20.0,
        decimate=4,
        border=20,
        standstill=0.0,
    )
    drive = frame["motor_torque_Nm"].to_numpy()
    X = np.column_stack([np.deg2rad(frame["motor_position_deg"].to_numpy()), drive])
    phi, y = lags.rows(X, drive)
    return phi[:-5], y[:-5], [str(n) for n in lags.get_feature_names_out()]


def carried(kr300, effects):
    """Relative errors on A (fitted), B and C (friction of A, inertia and offset of the record), in %."""
    phi, y, names = rows(kr300.A, effects)
    theta = np.linalg.lstsq(phi, y, rcond=None)[0]
    own = np.array([n in OWN for n in names])
    errors = []
    for record in "ABC":
        phi, y, _ = rows(kr300[record], effects)
        weights = theta.copy()
        weights[own] = np.linalg.lstsq(phi[:, own], y - phi[:, ~own] @ theta[~own], rcond=None)[0]
        errors.append(100 * float(np.linalg.norm(y - phi @ weights) / np.linalg.norm(y)))
    return np.array(errors), dict(zip(names, map(float, theta), strict=True))


def best_shape(kr300, chosen, shapes):
    """The shape with the least error on A."""
    return min(shapes, key=lambda e: carried(kr300, [*chosen, e])[0][0])


def kr300_rows(kr300):
    """Table of the forward choice: an effect stays if it helps on A and on both held-out records."""
    best, _ = carried(kr300, [])
    table = [_line("rigid, viscous, coulomb, offset", best, "base")]
    chosen, left = [], dict(CANDIDATES)
    while left:
        trials = {}
        for name, shapes in left.items():
            effect = best_shape(kr300, chosen, shapes)
            trials[name] = effect, carried(kr300, [*chosen, effect])[0]
        helping = {n: t for n, t in trials.items() if (t[1] < best - 0.05).all()}
        if not helping:
            break
        name = min(helping, key=lambda n: helping[n][1][1:].sum())
        effect, best = helping[name]
        chosen.append(effect)
        del left[name]
        table.append(_line(f"+ {effect}", best, "stays"))
    for name in left:
        effect, errors = trials[name]
        table.append(_line(f"({effect})", errors, "worse on a held-out record" if errors[0] < best[0] else "no help"))
    return table


def _line(name, errors, verdict):
    """A row of the table."""
    figures = dict(zip(("A", "B held out", "C held out"), map(float, errors), strict=True))
    return {"effects": name, **figures, "verdict": verdict}
