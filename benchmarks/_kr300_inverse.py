"""Axis 1 of a KUKA KR300: friction fitted to record A alone, an effect stays if it helps on B and C as well.

The rest of the arm moves too, so inertia and offset belong to the record (7.9, 4.8 and 5.4 Nm s2/rad at the motor);
what is left on A, 14 %, follows position and acceleration as the coupling to the other axes would, and 6 to 7 Hz, a
line that stays where it is at any speed: the arm's elasticity.
"""

from __future__ import annotations

import numpy as np
from scipy.ndimage import gaussian_filter1d
from scipy.signal import cont2discrete, lfilter

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


DT, BLUR, SLOW = 4e-3, 3, 0.005  # s, samples, rad/s: below it the sign of friction is uncertain
RESONANCES, DAMPINGS = np.geomspace(3.0, 40.0, 40), (0.02, 0.05, 0.1, 0.3)


def two_sides(kr300):
    """What motor minus load is made of, and what a load behind a spring explains of the torque.

    A twist follows the torque, a play the direction, and a load encoder that is read later the speed.  A load behind a
    spring adds to the rigid torque balance a second acceleration, that of a mass on a resonance; of all resonances and
    damping ratios the best is shown whose two masses are both above zero.
    """
    table = []
    for record in "ABC":
        frame = kr300[record]
        u = frame["motor_torque_Nm"].to_numpy()
        q, load = (np.deg2rad(frame[f"{side}_position_deg"].to_numpy()) for side in ("motor", "load"))
        v, a = (gaussian_filter1d(q, BLUR, order=k) / DT**k for k in (1, 2))
        one = np.ones_like(v)
        between = gaussian_filter1d(q - load, BLUR)
        columns = np.column_stack([v, np.tanh(v / SLOW), a, one])
        late, play, twist, _ = np.linalg.lstsq(columns, between, rcond=None)[0]
        seen = np.abs(v) > SLOW
        drive = gaussian_filter1d(u, BLUR)[seen]

        def left(columns, seen=seen, drive=drive):
            rows = np.column_stack(columns)[seen]
            theta = np.linalg.lstsq(rows, drive, rcond=None)[0]
            return 100 * float(np.linalg.norm(drive - rows @ theta) / np.linalg.norm(drive)), theta

        rigid = [v, np.sign(v), one, q, a]
        best = rigid_left = left(rigid)[0]
        for turn in 2 * np.pi * RESONANCES:
            for ratio in DAMPINGS:
                b, den, _ = cont2discrete(([turn**2], [1.0, 2 * ratio * turn, turn**2]), DT)
                remaining, theta = left([*rigid, lfilter(b.ravel(), den, a)])
                if min(theta[-2:]) > 0.0:
                    best = min(best, remaining)
        table.append(
            {
                "record": record,
                "motor - load, std mrad": 1e3 * float(np.std(between)),
                "of it by speed, ms": 1e3 * late,
                "play, mrad": 2e3 * play,
                "twist, mrad s2": 1e3 * twist,
                "left by speed alone, %": 100 * float(np.std(between - late * v) / np.std(between)),
                "torque left, rigid, %": rigid_left,
                "with a load behind a spring, %": best,
            }
        )
    return table
