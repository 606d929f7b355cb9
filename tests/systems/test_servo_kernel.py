"""The compiled kernel is its own reference: run uncompiled, it gives the same numbers."""

from __future__ import annotations

import dataclasses
import os
import subprocess
import sys

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from tests.own_effect import Magnet
from tests.systems.signals import DRIVE, REFERENCE
from tests.systems.torque import torque_along
from whsklearn.effects import (
    ActuatorLag,
    AsymmetricCoulomb,
    Backlash,
    CableSpring,
    Cogging,
    Coulomb,
    DeadZone,
    FlexibleCoupling,
    GravityImbalance,
    HardeningSpring,
    InputDelay,
    InputOffset,
    LuGre,
    ParameterChange,
    PreslidingHysteresis,
    QuadraticDrag,
    Saturation,
    Stribeck,
    Viscous,
)
from whsklearn.systems import Drive, PIDController, ServoAxis, Transmission
from whsklearn.systems import _servo_kernel as ob
from whsklearn.systems._servo_kernel import plant_of


def test_a_delay_of_whole_samples_shifts_the_torque():
    torque = ServoAxis(effects=[InputDelay(0.007)]).simulate_drive(DRIVE).torque
    np.testing.assert_allclose(torque[7:], DRIVE[:-7], atol=1e-12)
    np.testing.assert_array_equal(torque[:7], DRIVE[0])


def test_a_delay_acts_the_same_from_the_axis_and_from_the_effect():
    one = ServoAxis(drive=Drive(delay=0.0033)).simulate_drive(DRIVE)
    two = ServoAxis(effects=[InputDelay(0.0033)]).simulate_drive(DRIVE)
    np.testing.assert_array_equal(one.position, two.position)


def test_the_motion_depends_smoothly_on_the_delay():
    base = ServoAxis(law=[Viscous(0.3)])
    runs = [base.with_effect(InputDelay(d)).simulate_drive(DRIVE).position for d in (0.00201, 0.00202, 0.00203)]
    np.testing.assert_allclose(runs[2] - runs[1], runs[1] - runs[0], rtol=1e-3, atol=1e-9)


def test_a_lag_answers_a_step_exponentially():
    step = np.r_[np.zeros(10), np.ones(100)]
    torque = ServoAxis(effects=[ActuatorLag(0.01)]).simulate_drive(step).torque
    lagged = 1.0 - np.exp(-(np.arange(100) + 0.5 / 20) * 1e-3 / 0.01)  # mean over the first fine step
    np.testing.assert_allclose(torque[10:], lagged, atol=1e-5)


def test_dead_zone_and_saturation_shape_the_torque():
    u = np.linspace(-2.0, 2.0, 401)
    axis = ServoAxis(effects=[DeadZone(0.2), Saturation(1.5)])
    np.testing.assert_allclose(axis.simulate_drive(u).torque, np.clip(u - np.clip(u, -0.2, 0.2), -1.5, 1.5))


def test_an_offset_must_be_paid_for_by_the_drive():
    axis = ServoAxis(law=[Viscous(0.1)])
    with_offset = axis.with_effect(InputOffset(0.2)).simulate_drive(DRIVE + 0.2).position
    np.testing.assert_allclose(with_offset, axis.simulate_drive(DRIVE).position, atol=1e-12)


def test_a_disturbance_adds_to_the_torque():
    axis = ServoAxis()
    one = axis.simulate_drive(DRIVE, disturbance=0.1 * np.ones(1000)).position
    np.testing.assert_allclose(one, axis.simulate_drive(DRIVE + 0.1).position, atol=1e-12)


FREE = [Viscous(0.0)]
REST = np.zeros(20_000)


def free_run(axis, velocity=1.0, position=0.0, drive=REST):
    """The axis left alone."""
    return axis.simulate_drive(drive, initial_position=position, initial_velocity=velocity)


# -- energy ---------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("effect", "potential"),
    [
        (CableSpring(3.0, 0.1), lambda q: 1.5 * (q - 0.1) ** 2),
        (HardeningSpring(5.0), lambda q: 1.25 * q**4),
        (Cogging(0.2, 7.0, 0.3), lambda q: 0.2 / 7.0 * np.sin(7.0 * q + 0.3)),
        (GravityImbalance(0.4, 0.2), lambda q: 0.4 * np.sin(q + 0.2)),
    ],
)
def test_energy_is_kept_without_friction(effect, potential):
    record = free_run(ServoAxis(0.05, FREE, [effect]))
    energy = 0.025 * record.velocity**2 + potential(record.true_position)
    assert np.ptp(record.velocity) > 0.3, "it swings"
    swing = np.ptp(0.025 * record.velocity**2)
    assert np.ptp(energy) < 2e-5 * swing, "20 s, no drift"


def test_two_masses_keep_energy_and_momentum():
    axis = ServoAxis(0.05, FREE, transmission=Transmission(0.4, 30.0, 0.0))
    record = free_run(axis)  # both masses start at 1 rad/s: no vibration yet
    kicked = axis.simulate_drive(np.r_[5.0 * np.ones(10), REST])
    twist = kicked.true_position - kicked.load_position
    energy = 0.015 * kicked.velocity**2 + 0.01 * kicked.load_velocity**2 + 15.0 * twist**2
    assert np.ptp(record.velocity) < 1e-9
    assert np.ptp(twist[20:]) > 1e-3
    assert np.ptp(energy[20:]) < 1e-5 * energy[-1]
    momentum = 0.03 * kicked.velocity + 0.02 * kicked.load_velocity
    np.testing.assert_allclose(momentum[20:], 5.0 * 0.01, rtol=1e-9)


def test_work_of_the_drive_is_kinetic_energy_and_friction():
    t = np.arange(4000) / 1000
    axis = ServoAxis(0.05, [Viscous(0.2), Coulomb(0.3)], substeps=50)
    record = axis.simulate_drive(0.9 * np.sin(3.0 * t))
    v = record.velocity
    mean_v = np.diff(record.true_position) * 1000  # exact mean over each sample, in which the drive is constant
    work = np.sum(record.torque[:-1] * mean_v) / 1000
    loss = np.trapezoid(0.2 * v**2 + 0.3 * np.abs(v), t)
    assert work == pytest.approx(0.025 * v[-1] ** 2 + loss, rel=1e-4)


@pytest.mark.parametrize(
    "effect",
    [
        Viscous(0.05),
        Coulomb(0.02),
        Stribeck(0.02, 0.5),
        QuadraticDrag(0.05),
        PreslidingHysteresis(0.02, 0.01),
        LuGre(0.02, 0.01),
    ],
)
def test_friction_of_positive_size_brakes_in_both_directions(effect):
    axis = ServoAxis(0.05, [Viscous(0.01)])
    for v0 in (1.0, -1.0):
        bare, braked = free_run(axis, v0, drive=REST[:2000]), free_run(axis.with_effect(effect), v0, drive=REST[:2000])
        assert np.all(np.abs(braked.velocity[1:500]) < np.abs(bare.velocity[1:500]))


# -- closed forms ---------------------------------------------------------------------


def test_coulomb_stops_after_the_time_and_path_of_the_formula_and_stays():
    record = free_run(ServoAxis(0.05, [Coulomb(0.3)]), 2.0, drive=REST[:1000])
    stop = 0.05 * 2.0 / 0.3
    moving = record.velocity != 0.0
    assert record.time[moving][-1] == pytest.approx(stop, abs=1e-3)
    assert record.true_position[-1] == pytest.approx(0.05 * 2.0**2 / (2 * 0.3), rel=1e-7)
    assert not record.velocity[~moving].any()


def test_viscous_friction_decays_exponentially():
    record = free_run(ServoAxis(0.05, [Viscous(0.2)]), 2.0, drive=REST[:1000])
    np.testing.assert_allclose(record.velocity, 2.0 * np.exp(-0.2 / 0.05 * record.time), rtol=1e-6)


def test_asymmetric_coulomb_brakes_one_way_and_helps_the_other():
    axis = ServoAxis(0.05, [Coulomb(0.3), AsymmetricCoulomb(0.1)])
    forth, back = (free_run(axis, v, drive=REST[:1000]).true_position[-1] for v in (1.0, -1.0))
    assert forth == pytest.approx(0.025 / 0.4, rel=1e-6)
    assert back == pytest.approx(-0.025 / 0.2, rel=1e-6)


def test_free_resonance_of_two_masses():
    axis = ServoAxis(0.05, FREE, [FlexibleCoupling(1 / 30.0, 0.4, 0.0)])
    record = axis.simulate_drive(np.r_[np.ones(5), REST[:8000]])
    twist = record.true_position - record.load_position
    spectrum = np.abs(np.fft.rfft(twist * np.hanning(twist.size), 1 << 18))
    frequency = np.fft.rfftfreq(1 << 18, 1e-3)[spectrum.argmax()]
    assert frequency == pytest.approx(np.sqrt(30.0 / (0.05 * 0.4 * 0.6)) / (2 * np.pi), rel=1e-3)


def test_damping_of_the_coupling_is_the_ratio_asked_for():
    axis = ServoAxis(0.05, FREE, [FlexibleCoupling(1 / 30.0, 0.4, 0.05)])
    record = axis.simulate_drive(np.r_[np.ones(5), REST[:1000]])
    twist = (record.true_position - record.load_position)[10:]
    peaks = np.flatnonzero((twist[1:-1] > twist[:-2]) & (twist[1:-1] > twist[2:])) + 1
    decay = np.log(twist[peaks[0]] / twist[peaks[4]]) / 4
    assert decay == pytest.approx(2 * np.pi * 0.05 / np.sqrt(1 - 0.05**2), rel=0.02)


def test_a_stiff_coupling_tends_to_the_rigid_axis():
    t = np.arange(2000) / 1000
    drive = np.sin(5.0 * t)
    axis = ServoAxis(law=[Viscous(0.3)])
    rigid = axis.simulate_drive(drive).true_position
    error = [
        np.abs(axis.with_effect(FlexibleCoupling(c)).simulate_drive(drive).true_position - rigid).max()
        for c in (1e-3, 1e-4, 1e-7)
    ]
    assert error[0] > 5 * error[1] > 25 * error[2]
    assert error[2] < 1e-6


def test_within_the_gap_the_motor_moves_alone_and_then_takes_the_load_along():
    axis = ServoAxis(0.05, FREE, [Backlash(0.02, 0.6)])
    record = axis.simulate_drive(0.1 * np.ones(3000))
    twist = record.true_position - record.load_position
    inside = np.flatnonzero(twist > 0.01)[0] - 1
    np.testing.assert_allclose(record.velocity[:inside], 0.1 / 0.02 * record.time[:inside], rtol=1e-9, atol=1e-12)
    assert not record.load_velocity[:inside].any()
    assert np.abs(twist).max() < 0.0115, "the contact is stiff"
    assert record.load_velocity[-1] == pytest.approx(record.velocity[-1], rel=0.02)
    assert record.velocity[-1] == pytest.approx(0.1 * 3.0 / 0.05, rel=0.02)


@pytest.mark.parametrize(
    "transmission", [Backlash(0.02, 0.6, load_coulomb=0.04), FlexibleCoupling(1e-3, 0.6, load_coulomb=0.04)],
    ids=["play", "spring"],
)  # fmt: skip
def test_behind_a_transmission_the_load_takes_its_own_friction_along(transmission):
    axis = ServoAxis(0.05, FREE, [transmission])
    record = axis.simulate_drive(0.1 * np.ones(3000))
    assert record.velocity[-1] - record.velocity[1999] == pytest.approx((0.1 - 0.04) / 0.05, rel=0.02)


# -- standstill -----------------------------------------------------------------------


# -- limit cycles ---------------------------------------------------------------------


# -- convergence ----------------------------------------------------------------------


def test_rows_are_in_the_order_of_the_effects_with_their_numbers_first():
    effects = [Cogging(0.2, 7.0, 0.3), Viscous(0.1)]
    plant = plant_of(effects, np.zeros(12))
    assert plant.codes.tolist() == [e.code for e in effects]
    for row, e in zip(plant.p, effects, strict=True):
        np.testing.assert_array_equal(row[: len(e.row)], e.row)
        assert not row[len(e.row) :].any()


def test_stands_still_within_the_band_of_stiction_and_leaves_at_its_end():
    axis = ServoAxis(0.05, [Coulomb(0.3), Stribeck(0.1, 0.05)])
    drive = np.linspace(0.0, 0.5, 5001)
    for sign in (1.0, -1.0):
        record = axis.simulate_drive(sign * drive)
        leaves = np.flatnonzero(record.velocity)[0]
        assert drive[leaves] == pytest.approx(0.4, abs=2e-4)
        assert not record.true_position[:leaves].any(), "no creep"


def test_tanh_friction_creeps_where_stiction_holds():
    axis = ServoAxis(0.05, [Coulomb(0.3)], friction="tanh", smoothing=0.01)
    record = axis.simulate_drive(np.full(5000, 0.15))
    assert record.velocity[-1] == pytest.approx(0.01 * np.arctanh(0.5), rel=1e-3)


def test_asymmetric_friction_shifts_the_band():
    axis = ServoAxis(0.05, [Coulomb(0.3), AsymmetricCoulomb(0.1)])
    assert not axis.simulate_drive(np.full(500, 0.39)).velocity.any()
    assert axis.simulate_drive(np.full(500, 0.41)).velocity[-1] > 0
    assert not axis.simulate_drive(np.full(500, -0.19)).velocity.any()
    assert axis.simulate_drive(np.full(500, -0.21)).velocity[-1] < 0


def test_presliding_is_a_spring_that_returns():
    axis = ServoAxis(0.05, [Viscous(0.5)], [PreslidingHysteresis(0.3, 0.01)])
    record = axis.simulate_drive(0.06 * np.interp(np.arange(8000), [0, 4000, 8000], [0, 1, 0]))
    loaded = -0.01 * np.log(1 - 0.06 / 0.3)
    back = 0.01 * np.log(1 + 0.06 / 0.3)  # the way back starts 1.2 from the other end of the loop
    assert record.true_position[4000] == pytest.approx(loaded, rel=0.02)
    assert record.true_position[-1] == pytest.approx(loaded - back, rel=0.1)


def test_stick_slip_on_a_moving_spring_jumps_as_far_as_the_formula():
    """A mass pulled by a spring whose end moves at V; dF is the drop from static to Coulomb friction.

    In slip x = V t - V/w sin(w t) + dF/k (1 - cos(w t)) with w^2 = k/J, and it ends where
    dx/dt = 0, at tan(w t / 2) = -dF w / (k V); for a slow end that is 2 dF / k.
    """
    axis = ServoAxis(
        0.05,
        [Coulomb(0.2), Stribeck(0.1, 1e-4, 2.0)],
        controller=PIDController(kp=5.0, ki=0.0, kd=0.0),
        substeps=40,
    )
    reference = 0.01 * np.arange(30_000) / 1000
    record = axis.simulate(reference)
    jumps = np.diff(record.true_position[np.flatnonzero(np.diff((record.velocity == 0.0).astype(int)) == 1) + 1])
    assert jumps.size >= 4
    w, drop, speed = np.sqrt(5.0 / 0.05), 0.1 / 5.0, 0.01
    angle = 2 * (np.pi - np.arctan(drop * w / speed))
    slip = speed / w * (angle - np.sin(angle)) + drop * (1 - np.cos(angle))
    np.testing.assert_allclose(jumps, slip, rtol=0.01)


def test_stick_slip_needs_the_drop():
    axis = ServoAxis(0.05, [Coulomb(0.3)], controller=PIDController(kp=5.0, ki=0.0, kd=0.5))
    record = axis.simulate(0.01 * np.arange(30_000) / 1000)
    assert np.std(record.velocity[15_000:]) < 1e-6


def test_integral_action_hunts_with_static_friction_above_coulomb_and_rests_without_drop():
    controller = PIDController(kp=10.0, ki=20.0, kd=1.0, derivative_filter=0.0)
    reference = np.full(60_000, 0.1)
    hunting = ServoAxis(0.05, [Coulomb(0.2), Stribeck(0.1, 0.01)], controller=controller)
    late = hunting.simulate(reference, initial_position=0.0).true_position[30_000:] - 0.1
    assert np.sum(np.diff(np.sign(late)) != 0) >= 4, "the error keeps changing sign"
    calm = dataclasses.replace(hunting, law=as_coulomb(0.3))
    assert np.ptp(calm.simulate(reference, initial_position=0.0).true_position[30_000:]) < 0.1 * np.ptp(late)


def as_coulomb(torque):
    """A law of dry friction alone."""
    from whsklearn.effects import FrictionLaw

    return FrictionLaw([Coulomb(torque)])


SMOOTH = {
    "viscous": ServoAxis(law=[Viscous(0.3)]),
    "tanh": ServoAxis(friction="tanh", smoothing=0.02),
    "cogging": ServoAxis(law=[Viscous(0.12)], effects=[Cogging(0.1, 17)]),
    "two masses": ServoAxis(law=[Viscous(0.12)], effects=[FlexibleCoupling(1e-2)]),
    "dry": ServoAxis(law=[Viscous(0.12), Coulomb(0.3)]),
    "stribeck": ServoAxis(law=[Viscous(0.12), Coulomb(0.3), Stribeck(0.1, 0.1)]),
}


@pytest.mark.parametrize("name", list(SMOOTH))
def test_order_of_convergence_is_two(name):
    t = np.arange(1000) / 1000
    drive = 0.8 * np.sin(2 * np.pi * 1.1 * t) + 0.3 * np.sin(2 * np.pi * 3 * t)
    steps = np.array([5, 10, 20, 40])
    exact = dataclasses.replace(SMOOTH[name], substeps=1280).simulate_drive(drive).true_position
    error = [
        np.sqrt(
            np.mean(
                (dataclasses.replace(SMOOTH[name], substeps=int(n)).simulate_drive(drive).true_position - exact) ** 2
            )
        )
        for n in steps
    ]
    order = -np.polyfit(np.log(steps), np.log(error), 1)[0]
    assert order > 1.7
    assert error[-1] < 1e-7


SCRIPT = """
import numpy as np
from whsklearn.effects import (BoucWen, Coulomb, Cogging, EncoderEccentricity, FrictionDrift, GeneralizedMaxwellSlip,
    InputDelay, ActuatorLag, DeadZone, LoadFriction, LuGre, PositionFriction, Stribeck, TorqueRipple, Viscous, Backlash)
from whsklearn.systems import ServoAxis, Sensor
law = [Viscous(0.1), Coulomb(0.2), Stribeck(0.1, 0.1, 1.5)]
late = [InputDelay(0.0013), ActuatorLag(0.002), DeadZone(0.02), TorqueRipple(0.1, 3.0), EncoderEccentricity(1e-3)]
dry = [PositionFriction(0.05, 2.0), LoadFriction(0.05), FrictionDrift(0.1, 1.0), Cogging(0.05, 8.0, 1.0)]
path = [LuGre(0.1, 0.01), GeneralizedMaxwellSlip(0.1, 0.01, 4.0, 1.3), BoucWen(0.1, 0.01), Backlash(0.01)]
reference = 0.3 * np.sin(np.arange(60) / 8.0)
for effects in (late, dry, path):
    for friction in ("stick", "tanh"):
        axis = ServoAxis(0.05, law, effects, friction=friction, sensor=Sensor(1e-5, 1e-5), substeps=4)
        record = axis.simulate(reference, random_state=1)
        print(*(repr(float(record[k][-1])) for k in ("true_position", "drive", "load_position")))
"""


def test_uncompiled_is_the_same(capsys):
    exec(SCRIPT, {})
    compiled = np.array([float(x) for x in capsys.readouterr().out.split()])
    environment = os.environ | {"NUMBA_DISABLE_JIT": "1"}
    run = subprocess.run([sys.executable, "-c", SCRIPT], env=environment, capture_output=True, text=True, check=True)
    plain = np.array([float(x) for x in run.stdout.split()])
    assert compiled.size == 18
    np.testing.assert_allclose(compiled, plain, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("derivative_on", ["error", "measurement"])
def test_controller_is_the_discrete_pid_of_its_docstring(derivative_on):
    c = PIDController(20.0, 5.0, 0.5, 0.1, 0.05, derivative_on=derivative_on, derivative_filter=0.003)
    record = ServoAxis(controller=c, drive=Drive(gain=0.5)).simulate(REFERENCE)
    error = REFERENCE - record.position
    source = error if derivative_on == "error" else -record.position
    blend = 0.003 / (0.003 + 1e-3)
    derivative, filtered = np.r_[0.0, np.diff(source)] * 1000, np.zeros(1000)
    for k in range(1, 1000):
        filtered[k] = blend * filtered[k - 1] + (1 - blend) * derivative[k]
    velocity = np.gradient(REFERENCE) * 1000
    out = 20.0 * error + 5.0 * np.cumsum(error) / 1000 + 0.5 * filtered
    out += 0.1 * velocity + 0.05 * np.gradient(velocity) * 1000
    np.testing.assert_allclose(record.drive, 0.5 * out, atol=1e-9)


def test_the_log_shows_the_torque_within_the_controllers_limit():
    axis = ServoAxis(controller=PIDController(limit=0.7))
    record = axis.simulate(np.ones(1000), initial_position=0.0)
    assert np.abs(record.drive).max() == pytest.approx(0.7)


def test_the_integral_does_not_wind_up():
    free = PIDController(20.0, 40.0, 2.0)
    step = np.ones(4000)
    bounded = ServoAxis(controller=dataclasses.replace(free, limit=0.6)).simulate(step, initial_position=0.0)
    overshoot = bounded.true_position.max() - 1.0
    # the same bound outside the controller's sight: its integral winds up
    blind = ServoAxis(controller=free, drive=Drive(limit=0.6)).simulate(step, initial_position=0.0)
    assert overshoot < 0.5 * (blind.true_position.max() - 1.0)


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
    true = torque_along(plant, log.time, log.position, log.velocity, log.drive)
    own = torque_along(plant, log.time, out[ob.POSITION], out[ob.VELOCITY], log.drive)
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

    def motion(_t, state, held):
        q, v = state
        return [v, (held - sum(float(e.value(position=q, velocity=v)) for e in effects)) / J]

    state, samples = np.zeros(2), [0.0]
    for k in range(300):
        exact = {"rtol": 1e-10, "atol": 1e-12, "first_step": DT, "args": (u[k],)}
        state = solve_ivp(motion, (0.0, DT), state, **exact).y[:, -1]
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
