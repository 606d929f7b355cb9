"""Torques of an axis obey mechanics: energy, momentum, closed forms."""

from __future__ import annotations

import numpy as np
import pytest

from whsklearn.effects import (
    AsymmetricCoulomb,
    Backlash,
    CableSpring,
    Cogging,
    Coulomb,
    FlexibleCoupling,
    GravityImbalance,
    HardeningSpring,
    LuGre,
    PreslidingHysteresis,
    QuadraticDrag,
    Stribeck,
    Viscous,
)
from whsklearn.systems import ServoAxis, Transmission
from whsklearn.systems._servo_torques import plant_of

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
