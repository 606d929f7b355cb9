"""A log of a viscous axis, its views and its base model."""

from __future__ import annotations

import numpy as np

from whsklearn.effects import Coulomb, Viscous
from whsklearn.gap.plants.servo_start import observer_view, start_of
from whsklearn.gap.record import ServoRecord
from whsklearn.systems import ServoAxis

RATE, SECONDS, INERTIA = 500.0, 14.0, 0.05
TIME = np.arange(int(RATE * SECONDS)) / RATE
REFERENCE = 1.4 * np.sin(1.7 * TIME) + 0.5 * np.sin(5.1 * TIME + 1) + 0.2 * np.sin(12.3 * TIME)


def record_of(effects=(), law="viscous"):
    """What an axis with these effects leaves under its controller."""
    axis = ServoAxis(inertia=INERTIA, law=law, effects=effects, sample_rate=RATE)
    r = axis.simulate(reference=REFERENCE, random_state=1)
    return ServoRecord(r.time, r.drive, r.position)


def shaken(noise=2e-5, rate=200.0, n=4000):
    """A record of an axis with nothing missing whose drive changes at every sample."""
    rng = np.random.default_rng(3)
    axis = ServoAxis(inertia=INERTIA, law=[Viscous(0.12), Coulomb(0.3)], sample_rate=rate)
    drive = 3.0 * rng.standard_normal(n) + np.sin(3.0 * np.arange(n) / rate)
    r = axis.simulate_drive(drive, noise=noise * rng.standard_normal(n))
    return ServoRecord(r.time, r.drive, r.position)


def opened(record, law=("viscous",)):
    """(inverse view, observer view, base model) of a record."""
    inverse, base = start_of(record, law, 0.004)
    return inverse, observer_view(inverse, base.scene), base
