"""Which effects to carry from the identification record of the EMPS to another one, decided by that record alone.

The rule:

1. An effect that is a function of time (`DisturbanceTone`, `FrictionDrift`) belongs to the record in which it was seen.
   It is not a candidate, however well it fits.
2. The others are added one at a time, as long as the free run over the half of the identification record that was not
   fitted gets better by a twentieth. The amplifier's zero moves while the record is taken, and 0.1 N is 13 mm, so the
   zero alone is fitted to the held-out half: otherwise its change hides everything else.
3. What stays is fitted to the whole identification record, its zero a constant.

Every fit starts twice, from a guess and from a random size and phase. The validation record is in the table for every
row and in none of the decisions; the rule was written by people who had seen that column, so it is reasoned, not blind.

Measured: held-out error falls from 2.04 to 0.58 mm with `asymmetric_viscous` and to 0.52 with `position_friction`,
where the rule ends; on the validation record that axis has 7.3 mm. All axes with the asymmetry fit the identification
record to 1.4 to 2.2 mm and have 3.5 to 9.5 mm on the other one, in an order that the identification record does not
tell: what decides is the zero that each fit happens to carry (0.1 N is 13 mm), and friction is 3 % higher there.
"""

from __future__ import annotations

import numpy as np

from benchmarks._emps_forward import FOUR, fit, rmse_mm
from whsklearn.effects import (
    AsymmetricViscous,
    CableSpring,
    Coulomb,
    FrictionLaw,
    InputOffset,
    LoadFriction,
    PositionFriction,
    PreslidingHysteresis,
    QuadraticDrag,
    StaticEffect,
    Stribeck,
    Viscous,
)
from whsklearn.systems import ServoAxis

CANDIDATES = {
    "asymmetric_viscous": AsymmetricViscous(-20.0),
    "stribeck": Stribeck(3.0, 0.02),
    "position_friction": PositionFriction(0.3, order=6.0, phase=0.8),
    "quadratic_drag": QuadraticDrag(1.0),
    "load_friction": LoadFriction(0.01),
    "cable_spring": CableSpring(1.0),
    "presliding_hysteresis": PreslidingHysteresis(0.5, 1e-4),
}
GAIN = 0.05
EVERY = 20


def axis_with(names, rng=None):
    """The rigid axis with these effects at their guess, or at a random share of it."""
    law, effects = [Viscous(203.5), Coulomb(20.4)], [InputOffset(-3.16)]
    for effect in map(CANDIDATES.get, names):
        if rng is not None:
            effect = effect.resized(effect.magnitude * rng.uniform(0.1, 2.0))
            if effect.phased:
                effect = type(effect)(effect.magnitude, **{**effect.shape, "phase": rng.uniform(-np.pi, np.pi)})
        (law if isinstance(effect, StaticEffect) and not effect.phased else effects).append(effect)
    return ServoAxis(inertia=95.1, law=FrictionLaw(law), effects=effects, substeps=1)


def fitted(names, frame):
    """The better of two fits of the axis with these effects."""
    free = (*FOUR, *names, *(f"{n}__phase" for n in names if CANDIDATES[n].phased))
    starts = [axis_with(names), axis_with(names, np.random.default_rng(0))][: 2 if names else 1]
    return min((fit(s, frame, free, every=EVERY) for s in starts), key=lambda a: rmse_mm(a, frame))


def halves(frame):
    """First and second half, two cycles each."""
    n = len(frame) // 2
    return [frame.iloc[:n].reset_index(drop=True), frame.iloc[n:].reset_index(drop=True)]


def held_out(names, frame):
    """Free-run error (mm) over each half of the axis fitted to the other, its zero fitted to the half itself."""
    parts = halves(frame)
    misses = [
        rmse_mm(fit(fitted(names, learnt), asked, ("input_offset",), every=EVERY, rounds=2), asked)
        for learnt, asked in (parts, parts[::-1])
    ]
    return float(np.sqrt(np.mean(np.square(misses))))


def selection_rows(emps):
    """Table of the forward choice, and the axis that it ends with."""
    table, chosen, best = [], (), np.inf
    trials = {(): held_out((), emps.train)}
    axes = {}
    while True:
        for names in trials:
            axes[names] = fitted(names, emps.train)
        leader = min(trials, key=trials.get)
        stays = trials[leader] < (1 - GAIN) * best
        for names, score in sorted(trials.items(), key=lambda item: item[1]):
            verdict = "stays" if stays and names == leader else "too little" if score < best else "no help"
            table.append(_line(names, score, axes[names], emps, verdict if names else "base"))
        if not stays:
            return table, axes[chosen], chosen
        chosen, best = leader, trials[leader]
        trials = {(*chosen, n): held_out((*chosen, n), emps.train) for n in CANDIDATES if n not in chosen}


def _line(names, score, axis, emps, verdict):
    """A row of the table."""
    label = "+ " + " + ".join(names) if names else "the four"
    figures = {"held-out halves": score, "identification": rmse_mm(axis, emps.train)}
    return {"effects": label, **figures, "verdict": verdict, "validation (not used)": rmse_mm(axis, emps.test)}
