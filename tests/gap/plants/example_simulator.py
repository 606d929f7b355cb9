"""A simulator as small as one can be, with and without numbers to set, and a record that shows a spring it lacks."""

from __future__ import annotations

import numpy as np

from whsklearn.effects import AsymmetricViscous, CableSpring, InputOffset
from whsklearn.gap import ServoRecord

TIME = np.arange(8000) * 2e-3
DRIVE = np.sin(3 * TIME) + 0.5 * np.sin(11 * TIME + 1) + 0.3 * np.sin(0.7 * TIME)


class Damper:
    """x' = (u - effects) / b, stepped by Euler: as small as a simulator can be."""

    effects_to_try = (CableSpring(1.0, 0.0), InputOffset(1.0), AsymmetricViscous(1.0))

    def __init__(self, damping=1.0, effects=()):
        self.damping, self.effects = damping, tuple(effects)

    def simulate(self, record):
        x, v, out = 0.0, 0.0, np.empty(len(record))
        for i, u in enumerate(record.drive):
            out[i] = x
            force = 0.0
            for e in self.effects:
                force += {"cable_spring": x, "input_offset": 1.0, "asymmetric_viscous": abs(v)}[e.name] * e.magnitude
            v = (u - force) / self.damping
            x += 2e-3 * v
        return out

    def refit(self, record, keep):
        def error(damping):
            return np.sum((record.position - Damper(damping, self.effects).simulate(record))[keep] ** 2)

        grid = self.damping * np.linspace(0.9, 1.1, 9)
        return Damper(float(grid[np.argmin([error(d) for d in grid])]), self.effects)

    def with_effect(self, effect):
        return Damper(self.damping, (*self.effects, effect))


class Told(Damper):
    """The same, with its one number to set."""

    refits = 0

    @property
    def parameters(self):
        return {"damping": self.damping}

    @property
    def numbers(self):
        return np.log([self.damping])

    def with_numbers(self, x):
        return Told(float(np.exp(x[0])), self.effects)

    def refit(self, record, keep):
        Told.refits += 1
        return Told(super().refit(record, keep).damping, self.effects)

    def with_effect(self, effect):
        return Told(self.damping, (*self.effects, effect))


def springy_record():
    """What a damper with a spring of 0.3 leaves, with noise."""
    truth = Damper(1.0, (CableSpring(0.3, 0.0),))
    noise = 1e-3 * np.random.default_rng(0).standard_normal(TIME.size)
    return ServoRecord(TIME, DRIVE, truth.simulate(ServoRecord(TIME, DRIVE, np.zeros_like(TIME))) + noise)


RECORD = springy_record()
