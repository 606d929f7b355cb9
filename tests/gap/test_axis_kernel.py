"""The compiled pass: a coupling keeps its energy to second order, a play passes nothing, restarts know the twist."""

from __future__ import annotations

import numpy as np
import pytest

from whsklearn.gap import axis_kernel as k

DT, J, SHARE, HZ = 1e-3, 0.05, 0.4, 25.0


def run(codes, q, u, *, substeps=4, start=(0.0, 0.0), twist=None, reset=0):
    n = u.size
    numbers = np.zeros((len(q), k.N_SLOTS))
    for row, values in zip(numbers, q, strict=True):
        row[: len(values)] = values
    th0, v0 = np.full(n, start[0]), np.full(n, start[1])
    rows = np.empty((0, 2)) if twist is None else np.tile(np.asarray(twist, dtype=float), (n, 1))
    return k.follow(
        J, 0.0, np.array(codes, dtype=np.int64), numbers, u, np.zeros(n), DT, substeps, 0.0, 0.0, reset, th0, v0, rows
    )


def compliance():
    return 1.0 / (J * SHARE * (1 - SHARE) * (2 * np.pi * HZ) ** 2)


def swing(substeps):
    """Largest error of the twist's free oscillation, from a twist of 0.1 rad at rest."""
    n = 400
    twist = run([k.FLEXIBLE], [(compliance(), SHARE, 0.0)], np.zeros(n), substeps=substeps, twist=(0.1, 0.0), reset=n)[
        3
    ][:, 0]
    t = np.arange(n) * DT
    return float(np.abs(twist - 0.1 * np.cos(2 * np.pi * HZ * t)).max())


def test_a_free_coupling_converges_to_its_oscillation_in_second_order():
    errors = np.array([swing(s) for s in (4, 8, 16)])
    assert errors[-1] < 1e-3
    assert np.log2(errors[:-1] / errors[1:]) == pytest.approx([2.0, 2.0], abs=0.3)


def test_the_resonance_of_a_free_coupling_is_where_theory_has_it():
    n = 4000
    twist = run([k.FLEXIBLE], [(compliance(), SHARE, 0.0)], np.zeros(n), substeps=16, twist=(0.1, 0.0), reset=n)[3]
    crossings = np.flatnonzero(np.diff(np.sign(twist[:, 0])))
    hz = 0.5 * (crossings.size - 1) / ((crossings[-1] - crossings[0]) * DT)
    assert hz == pytest.approx(HZ, rel=2e-3)


def test_within_a_play_the_load_is_left_alone():
    gap = 1.0
    n = 200
    _, angle, _, twist = run([k.BACKLASH], [(gap, SHARE, 60.0, 0.1)], np.full(n, 0.5))
    load = angle - twist[:, 0]
    inside = np.abs(twist[:, 0]) < 0.5 * gap
    assert inside.all()
    assert load == pytest.approx(np.zeros(n), abs=1e-12)
    t = np.arange(n) * DT
    assert angle == pytest.approx(0.5 * 0.5 / (J * (1 - SHARE)) * t**2, rel=1e-6, abs=1e-9)


def test_a_play_carries_the_load_along_and_never_pulls():
    n = 6000
    u = 0.2 * np.sin(2 * np.pi * 0.5 * np.arange(n) * DT)
    gap = 0.02
    twist = run([k.VISCOUS, k.BACKLASH], [(0.1,), (gap, SHARE, 60.0, 0.3)], u, substeps=8)[3][:, 0]
    assert np.abs(twist).max() > 0.5 * gap
    assert np.abs(twist).max() < 0.6 * gap + 0.01
    assert k.contact(0.3 * gap, 5.0, gap, 100.0, 1.0) == 0.0
    assert k.contact(0.51 * gap, -5.0, gap, 100.0, 1.0) == 0.0


@pytest.mark.parametrize(("motor", "load"), [(k.FLEXIBLE, k.FLEXIBLE_LOAD)])
def test_a_restart_puts_the_encoder_where_it_was_measured(motor, load):
    for code in (motor, load):
        y, *_ = run([code], [(compliance(), SHARE, 0.1)], np.zeros(50), start=(0.7, 0.0), twist=(0.01, 0.0), reset=50)
        assert y[0] == pytest.approx(0.7)
