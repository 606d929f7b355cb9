"""The EMPS axis run forward: position from the drive alone, parameters from the identification record alone.

The axis is `ServoAxis` with effects of the catalogue, the three that held-out cycles ask for, and a slow
`DisturbanceTone` (a quarter of a wave in 25 s) for the amplifier's zero, which moves while the record is taken.
Initial velocity is the slope of a cubic through the first 20 positions, the window the benchmark allows.

Position is the integral of a velocity that friction alone holds in check, so a constant error of 0.1 N is
13 mm after 25 s, and friction is 3 % higher in the validation record: a record's own zero and friction level
decide its free run, and the identification record cannot know those of another one. What can be known is that
the axis turns at the ends of its travel; that, with the drive alone, is enough to find the two numbers.
"""

from __future__ import annotations

import itertools

import numpy as np
from scipy.optimize import least_squares, minimize

from whsklearn.effects import (
    AsymmetricViscous,
    Coulomb,
    DisturbanceTone,
    FrictionLaw,
    InputOffset,
    PositionFriction,
    Stribeck,
    Viscous,
)
from whsklearn.systems import ServoAxis

FOUR = ("inertia", "viscous", "coulomb", "input_offset")
ALL = (*FOUR, "asymmetric_viscous", "stribeck", "position_friction", "disturbance_tone")
FIRST = 20  # samples that may be looked at for the initial state
STEP = {
    "inertia": 1.0,
    "viscous": 2.0,
    "coulomb": 0.2,
    "input_offset": 0.03,
    "asymmetric_viscous": 0.5,
    "stribeck": 0.3,
    "disturbance_tone": 0.05,
    "position_friction": 0.1,
    "position_friction__phase": 0.3,
    "quadratic_drag": 5.0,
    "load_friction": 0.005,
    "cable_spring": 1.0,
    "presliding_hysteresis": 0.3,
}


def rigid_axis():
    """The published parameters."""
    law = FrictionLaw([Viscous(203.5034), Coulomb(20.3935)])
    return ServoAxis(inertia=95.1089, law=law, effects=[InputOffset(-3.1648)], substeps=1)


def full_axis():
    """The same with the effects that the identification record shows, at a guess of their sizes."""
    law = FrictionLaw([Viscous(200.0), Coulomb(21.0), AsymmetricViscous(-30.0), Stribeck(0.5, 0.02)])
    drift = DisturbanceTone(-0.5, frequency=0.01, phase=-np.pi / 2)
    uneven = PositionFriction(0.5, order=6.0, phase=0.8)
    return ServoAxis(inertia=92.0, law=law, effects=[InputOffset(-0.5), drift, uneven], substeps=1)


def start(frame):
    """Initial position and velocity from the first samples."""
    t = np.arange(FIRST) * 1e-3
    slope, level = np.polyfit(t, frame["position_m"].to_numpy()[:FIRST], 3)[-2:]
    return {"initial_position": float(level), "initial_velocity": float(slope)}


def run(axis, frame, **initial):
    """Free run (n,): simulated position in m."""
    initial = initial or start(frame)
    return axis.simulate_drive(frame["force_N"].to_numpy(), noise=False, **initial).true_position


def rmse_mm(axis, frame):
    """Root mean square of the free run's error, in mm."""
    return 1e3 * float(np.sqrt(np.mean((run(axis, frame) - frame["position_m"].to_numpy()) ** 2)))


def fit(axis, frame, names, every=10, rounds=3):
    """The axis whose free run is closest to a record, over the named parameters."""
    measured = frame["position_m"].to_numpy()[::every]
    steps = np.array([STEP[n] for n in names])
    initial = start(frame)

    def residual(z, origin):
        moved = axis.with_vector(names, origin + steps * z)
        return 1e3 * (run(moved, frame, **initial)[::every] - measured) / np.sqrt(measured.size)

    def jacobian(z, origin):
        pairs = [[residual(z + s * d, origin) for s in (0.2, -0.2)] for d in np.eye(len(names))]
        return np.column_stack([(up - down) / 0.4 for up, down in pairs])

    for _ in range(rounds):
        origin = axis.vector(names)
        found = least_squares(residual, np.zeros(len(names)), jac=jacobian, args=(origin,), max_nfev=25)
        axis = axis.with_vector(names, origin + steps * found.x)
    return axis


def turning_points(position):
    """Ends of the strokes: highest positions, lowest positions."""
    above = position > 0.5 * (position.max() + position.min())
    edges = np.flatnonzero(np.diff(above.astype(int))) + 1
    strokes = [position[i:j] for i, j in itertools.pairwise(edges)]
    high = [s.max() for s in strokes if s[0] > 0.5 * (position.max() + position.min())]
    low = [s.min() for s in strokes if s[0] <= 0.5 * (position.max() + position.min())]
    return np.array(high), np.array(low)


def own_level(axis, change):
    """The axis with a record's own zero (N), its drift (N a quarter wave) and friction level (relative)."""
    offset, drift, level = change
    p = axis.parameters
    scaled = {n: p[n] * (1 + level) for n in ("viscous", "coulomb", "stribeck", "position_friction") if n in p}
    if "disturbance_tone" in p:
        scaled["disturbance_tone"] = p["disturbance_tone"] + drift
    return axis.with_parameters({**scaled, "input_offset": p["input_offset"] + offset})


def levelled(axis):
    """The axis with its moving zero replaced by the mean of it: what is left to say about a record not yet seen."""
    tone = axis.parameters["disturbance_tone"]
    return own_level(axis, (0.6 * tone, -tone, 0.0))  # sin(2 pi 0.01 t) over 25 s has the mean 0.6


CONSTANT = np.array([0.3, 0.0, 0.03])  # prior standard deviations of `own_level`, as the records' spread suggests
MOVING = np.array([0.3, 0.3, 0.03])


def settle(axis, frame, misfit, width):
    """The change of a record's own level with the least misfit, from three friction levels; and the change."""
    initial = start(frame)
    free = np.flatnonzero(width)

    def change(z):
        full = np.zeros(3)
        full[free] = width[free] * z
        return full

    def cost(z):
        return misfit(run(own_level(axis, change(z)), frame, **initial)) + float(z @ z)

    starts = [np.r_[np.zeros(free.size - 1), level] for level in (0.0, 1.0, -1.0)]
    options = {"xatol": 1e-2, "fatol": 1e-2, "maxiter": 150}
    found = min((minimize(cost, s, method="Nelder-Mead", options=options) for s in starts), key=lambda r: r.fun)
    return own_level(axis, change(found.x)), change(found.x)


def by_travel(axis, frame, identification, width=CONSTANT, tolerance=5e-4):
    """Own level from the drive alone: the axis turns where it turned in the identification record."""
    high, low = (float(np.mean(x)) for x in turning_points(identification["position_m"].to_numpy()))

    def misfit(position):
        ends = turning_points(np.nan_to_num(position))
        return sum(float((((x - level) / tolerance) ** 2).sum()) for x, level in zip(ends, (high, low), strict=True))

    return settle(axis, frame, misfit, width)


def by_first_seconds(axis, frame, seconds, width=CONSTANT, tolerance=6e-5):
    """Own level from the positions of the first seconds."""
    n = int(seconds * 1000)
    measured = frame["position_m"].to_numpy()[:n]
    return settle(axis, frame, lambda position: float(np.mean(((position[:n] - measured) / tolerance) ** 2)), width)


def forward_rows(emps):
    """Table of free runs, and the axis with all its effects."""
    train, test = emps.train, emps.test
    rigid = rigid_axis()
    four = fit(rigid, train, FOUR)
    full = fit(full_axis(), train, ALL)
    mean = levelled(full)
    plain = [by_travel(four, f, train)[0] for f in (train, test)]
    travel = [by_travel(mean, f, train)[0] for f in (train, test)]
    moving = [by_travel(full, f, train, MOVING)[0] for f in (train, test)]
    cycle = [by_first_seconds(mean, f, 6.2)[0] for f in (train, test)]
    state = "20 samples"
    lines = [
        ("published rigid parameters", rigid, rigid, state),
        ("the same four, fitted to the free run", four, four, state),
        ("  own zero and friction level, by the travel known", *plain, state + ", drive"),
        ("+ asymmetric viscous, Stribeck, uneven, moving zero", full, full, state),
        ("  own zero and friction level, by the travel known", *travel, state + ", drive"),
        ("  own zero, its drift and friction level, by the travel", *moving, state + ", drive"),
        ("  own zero and friction level, by the first cycle", *cycle, "6.2 s"),
    ]
    table = [
        {"model": name, "identification": rmse_mm(a, train), "validation": rmse_mm(b, test), "of the record": used}
        for name, a, b, used in lines
    ]
    published = {"model": "dynoNet, as published", "identification": "-", "validation": 2.64, "of the record": "-"}
    return [published, *table], full


def sensitivity(emps, full):
    """What an error of a record's own level costs in the free run of the identification record."""
    changes = {"none": (0, 0, 0), "zero +0.05 N": (0.05, 0, 0), "zero +0.1 N": (0.1, 0, 0)}
    changes |= {"friction +1 %": (0, 0, 0.01), "friction +3.5 %": (0, 0, 0.035)}
    return [{"change": n, "identification": rmse_mm(own_level(full, c), emps.train)} for n, c in changes.items()]
