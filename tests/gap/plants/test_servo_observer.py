"""The observer view: a fine step no finer than the record and its axis ask for."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from whsklearn.effects import Viscous
from whsklearn.gap.plants.servo_model import LONGEST_STEP
from whsklearn.gap.plants.servo_run import STEP_ERROR
from whsklearn.gap.plants.servo_start import observer_view, start_of
from whsklearn.gap.record import ServoRecord
from whsklearn.systems import ServoAxis

VISCOUS = 0.2


def opened(rate, time_constant):
    """(observer view, base model) of a record of an axis with this mechanical time constant (s)."""
    t = np.arange(int(500.0 * 40.0)) / 500.0
    reference = 0.8 * np.sin(1.3 * t) + 0.3 * np.sin(3.7 * t + 1)
    axis = ServoAxis(inertia=VISCOUS * time_constant, law=[Viscous(VISCOUS)], sample_rate=500.0)
    r = axis.simulate(reference=reference, random_state=1)
    keep = slice(None, None, round(500.0 / rate))
    record = ServoRecord(r.time[keep], r.drive[keep], r.position[keep])
    inverse, base = start_of(record, ("viscous",), 0.004)
    return observer_view(inverse, base.scene), base


@pytest.mark.parametrize(("rate", "longer"), [(50.0, 4.0), (500.0, 1.0)], ids=["50 Hz", "500 Hz"])
def test_a_slow_axis_is_stepped_at_a_quarter_of_a_sample_and_no_longer(rate, longer):
    view, base = opened(rate, 0.15)
    coarse = view.coarsened(base)
    assert coarse.step == pytest.approx(longer * LONGEST_STEP)
    fine = dataclasses.replace(base, step=1e-4)
    moved = coarse.rms(coarse.gap(dataclasses.replace(base, step=coarse.step)) - view.gap(fine))
    assert moved < 2.0 * STEP_ERROR * view.tolerance * view.scene.torque
    assert coarse.fit(base).step == coarse.step


def test_an_axis_faster_than_that_keeps_its_fine_step():
    view, base = opened(50.0, 0.15)
    light = dataclasses.replace(base, inertia=2e-3 * VISCOUS)
    assert view.coarsened(light).step == LONGEST_STEP
