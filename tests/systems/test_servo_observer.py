"""The pass held near a log: it follows, restarts where measured, and shows the missing torque as its formula says."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from tests.own_effect import Magnet
from whsklearn.effects import (
    Backlash,
    Cogging,
    Coulomb,
    FlexibleCoupling,
    GravityImbalance,
    ParameterChange,
    Viscous,
)
from whsklearn.systems import ServoAxis
from whsklearn.systems import servo_observer as ob

DT, J, SHARE, HZ = 1e-3, 0.05, 0.4, 25.0


def run(effects, u, *, substeps=4, start=(0.0, 0.0), twist=None, every=0, on_load=False):
    plant = ob.plant_of(effects, ob.bare_parts(J, on_load=on_load))
    rows = [start[0], start[1]] if twist is None else [start[0], start[1], *twist]
    measured = np.repeat(np.array(rows, dtype=float)[:, None], u.size, axis=1)
    return ob.follow(plant, u, measured, ob.How(DT, substeps, every=every))


def compliance():
    return 1.0 / (J * SHARE * (1 - SHARE) * (2 * np.pi * HZ) ** 2)


def twist_of(out):
    return out[ob.POSITION] - out[ob.LOAD]


def swing(substeps):
    """Largest error of the twist's free oscillation, from a twist of 0.1 rad at rest."""
    n = 400
    effects = [FlexibleCoupling(compliance(), SHARE, 0.0)]
    out = run(effects, np.zeros(n), substeps=substeps, twist=(0.1, 0.0), every=n)
    return float(np.abs(twist_of(out) - 0.1 * np.cos(2 * np.pi * HZ * np.arange(n) * DT)).max())


def test_a_free_coupling_converges_to_its_oscillation_in_second_order():
    errors = np.array([swing(s) for s in (8, 16, 32)])
    assert errors[-1] < 2e-3
    assert np.log2(errors[:-1] / errors[1:]) == pytest.approx([2.0, 2.0], abs=0.3)


def test_the_resonance_of_a_free_coupling_is_where_theory_has_it():
    n = 4000
    out = run([FlexibleCoupling(compliance(), SHARE, 0.0)], np.zeros(n), substeps=32, twist=(0.1, 0.0), every=n)
    crossings = np.flatnonzero(np.diff(np.sign(twist_of(out))))
    hz = 0.5 * (crossings.size - 1) / ((crossings[-1] - crossings[0]) * DT)
    assert hz == pytest.approx(HZ, rel=2e-3)


def test_within_a_play_the_load_is_left_alone():
    n = 200
    out = run([Backlash(1.0, SHARE, 60.0, 0.1)], np.full(n, 0.5))
    assert (np.abs(twist_of(out)) < 0.5).all()
    assert out[ob.LOAD] == pytest.approx(np.zeros(n), abs=1e-12)
    t = np.arange(n) * DT
    assert out[ob.POSITION] == pytest.approx(0.5 * 0.5 / (J * (1 - SHARE)) * t**2, rel=1e-6, abs=1e-9)


def test_a_play_carries_the_load_along_and_never_pulls():
    u = 0.2 * np.sin(2 * np.pi * 0.5 * np.arange(6000) * DT)
    twist = np.abs(twist_of(run([Viscous(0.1), Backlash(0.02, SHARE, 60.0, 0.3)], u, substeps=8)))
    assert 0.01 < twist.max() < 0.022


@pytest.mark.parametrize("on_load", [False, True])
def test_a_restart_puts_the_encoder_where_it_was_measured(on_load):
    effects = [FlexibleCoupling(compliance(), SHARE, 0.1)]
    out = run(effects, np.zeros(50), start=(0.7, 0.0), twist=(0.01, 0.0), every=50, on_load=on_load)
    assert out[ob.MEASURED, 0] == pytest.approx(0.7)
    assert twist_of(out)[0] == pytest.approx(0.01)


LAW = [Viscous(0.12), Coulomb(0.3)]


@pytest.fixture(scope="module")
def log():
    t = np.arange(6000) * DT
    drive = 0.9 * np.sin(2 * np.pi * 0.6 * t) + 0.4 * np.sin(2 * np.pi * 1.7 * t)
    return ServoAxis(J, LAW, [Magnet(0.2, 0.3)]).simulate_drive(drive)


@pytest.mark.parametrize("effects", [LAW, [*LAW, Magnet(0.2, 0.3)], [*LAW, Cogging(0.1, 7.0)]], ids=len)
def test_it_is_the_simulation_where_nothing_is_corrected(log, effects):
    plant = ob.plant_of(effects, ob.bare_parts(J))
    measured = np.array([log.position, log.velocity])
    out = ob.follow(plant, log.drive, measured, ob.How(DT, 20))
    axis = ServoAxis(J, effects[:2], effects[2:])
    again = axis.simulate_drive(log.drive, initial_position=log.position[0], initial_velocity=log.velocity[0])
    np.testing.assert_array_equal(out[ob.MEASURED], again.position)


def missing(log, effects, gains):
    """J (p^2 + l1 p + l2) e by central differences, and F on either motion."""
    plant = ob.plant_of(effects, ob.bare_parts(J))
    out = ob.follow(plant, log.drive, np.array([log.position, log.velocity]), ob.How(DT, 4, gains=gains))
    e = log.position - out[ob.MEASURED]
    rate = np.gradient(e, DT)
    shown = J * (np.gradient(rate, DT) + gains[0] / DT * rate + gains[1] / DT * e)
    true = ob.effect_torque(plant, log.time, log.position, log.velocity, log.drive)
    own = ob.effect_torque(plant, log.time, out[ob.POSITION], out[ob.VELOCITY], log.drive)
    return shown, true - own


def test_the_missing_torque_is_the_innovations_and_what_the_effects_differ_by(log):
    """Too much viscous friction carries the observer along: only with F(q, v) - F(q^, v^) is the bump seen."""
    wrong = [Viscous(2.0)]
    shown, differs = missing(log, wrong, (0.05, 2.0))
    truth = 0.2 * np.exp(-((log.position / 0.3) ** 2)) + 0.3 * np.sign(log.velocity) + (0.12 - 2.0) * log.velocity
    inner = slice(200, -200)
    left = np.sqrt(np.mean((truth - (-(shown + differs)))[inner] ** 2)) / np.std(truth[inner])
    alone = np.sqrt(np.mean((truth - (-shown))[inner] ** 2)) / np.std(truth[inner])
    assert left < 0.25
    assert alone > 2.0 * left


def test_it_follows_a_fine_reference_of_another_integrator():
    effects = [Viscous(0.3), GravityImbalance(0.5, 0.4), Cogging(0.1, 5.0, 1.0), Magnet(0.2, 0.5)]
    u = 0.8 * np.sin(2 * np.pi * 1.1 * np.arange(1500) * DT)
    out = run(effects, u, substeps=8)

    def motion(t, state):
        q, v = state
        held = u[min(int(t / DT + 1e-9), u.size - 1)]
        return [v, (held - sum(float(e.value(position=q, velocity=v)) for e in effects)) / J]

    state, samples = np.zeros(2), [0.0]
    for k in range(300):
        state = solve_ivp(motion, (k * DT, (k + 1) * DT), state, rtol=1e-10, atol=1e-12).y[:, -1]
        samples.append(state[0])
    np.testing.assert_allclose(out[ob.POSITION, :301], samples, atol=1e-7)


@pytest.mark.parametrize("which", ["inertia", "viscous", "coulomb", "gain"])
def test_a_change_acts_from_its_instant_on(which):
    """At t_0 itself the change is there, in the columns and in the pass alike."""
    change = ParameterChange(0.5, 0.1, which)
    at = change.value(time=[0.0999, 0.1], velocity=[1.0, 1.0], acceleration=[1.0, 1.0], drive=[1.0, 1.0])
    assert at[0] == 0.0
    assert abs(at[1]) == 0.5
    n = 300
    u = np.full(n, 1.0)
    base, changed = run(LAW, u, substeps=1), run([*LAW, change], u, substeps=1)
    differs = np.flatnonzero(base[ob.VELOCITY] != changed[ob.VELOCITY])
    assert differs[0] == 101  # the step from sample 100, at t = 0.1, is the first that it acts in


def test_a_fractional_age_of_the_drive_shifts_its_effect():
    u = np.r_[np.zeros(50), np.full(50, 0.4)]
    early, late = (
        ob.follow(ob.plant_of([Viscous(0.1)], ob.bare_parts(J, delay)), u, np.zeros((2, 100)), ob.How(DT, 1))
        for delay in (-0.3 * DT, 0.3 * DT)
    )
    assert early[ob.TORQUE, 49] == pytest.approx(0.3 * 0.4)
    assert late[ob.TORQUE, 50] == pytest.approx(0.7 * 0.4)
