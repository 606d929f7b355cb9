"""The servo axis as an instrument: drive, sensor, controller, replay, parameters, batches."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from sklearn.utils import Bunch

from whsklearn.effects import (
    ActuatorLag,
    Backlash,
    Cogging,
    Coulomb,
    DeadZone,
    EncoderEccentricity,
    FlexibleCoupling,
    InputDelay,
    InputOffset,
    LuGre,
    OutputDrift,
    ParameterChange,
    Quantization,
    Saturation,
    Stribeck,
    TorqueRipple,
    Viscous,
    effect_names,
    get_effect,
)
from whsklearn.systems import Drive, PIDController, Sensor, ServoAxis, Transmission, record_frame, simulate_many

T = np.arange(1000) / 1000
DRIVE = 0.9 * np.sin(9.0 * T) + 0.3 * np.cos(31.0 * T)
REFERENCE = 0.5 * np.sin(5.0 * T)


# -- drive ----------------------------------------------------------------------------


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


# -- balance --------------------------------------------------------------------------


def test_torque_balance_holds_along_a_record():
    axis = ServoAxis(
        law=[Viscous(0.2), Coulomb(0.3)], effects=[Cogging(0.1, 9.0, 0.4), InputOffset(0.1), TorqueRipple(0.1, 3.0)]
    )
    t = np.arange(8000) / 2000
    axis = dataclasses.replace(axis, sample_rate=2000.0)
    record = axis.simulate_drive(0.9 * np.sin(4.0 * t))
    signals = Bunch(
        time=record.time,
        position=record.true_position,
        velocity=record.velocity,
        acceleration=np.gradient(record.velocity, record.time),
        drive=record.torque,
    )
    columns, names = axis.columns(signals)
    weights = np.concatenate([[0.05, 0.2, 0.3], *(e.coefficients for e in axis.effects)])
    assert names[:4] == ("inertia", "viscous", "coulomb", "cogging__cos")
    moving = np.abs(record.velocity) > 0.05
    error = (columns @ weights - record.torque)[moving]
    assert np.sqrt(np.mean(error**2)) < 2e-3


def test_a_parameter_changes_when_told():
    axis = ServoAxis(law=[Viscous(0.1)])
    change = ParameterChange(0.3, 0.5, "viscous")
    base, changed = axis.simulate_drive(DRIVE), axis.with_effect(change).simulate_drive(DRIVE)
    np.testing.assert_array_equal(base.velocity[:500], changed.velocity[:500])
    after = ServoAxis(law=[Viscous(0.4)]).simulate_drive(
        DRIVE[500:], initial_position=base.true_position[500], initial_velocity=base.velocity[500]
    )
    np.testing.assert_allclose(changed.velocity[500:], after.velocity, atol=2e-4)


# -- sensor ---------------------------------------------------------------------------


def test_sensor_reads_as_its_effects_say():
    axis = ServoAxis(effects=[EncoderEccentricity(0.01, 2.0, 0.3), OutputDrift(0.02)])
    record = axis.simulate_drive(DRIVE)
    expected = record.true_position + 0.01 * np.cos(2 * record.true_position + 0.3) + 0.02 * record.time
    np.testing.assert_allclose(record.position, expected, atol=1e-12)


def test_positions_lie_on_the_lattice():
    step = 2 * math.pi / 800
    for axis in (ServoAxis(sensor=Sensor(resolution=step)), ServoAxis(effects=[Quantization(step)])):
        record = axis.simulate_drive(DRIVE)
        np.testing.assert_allclose(record.position / step, np.round(record.position / step), atol=1e-9)
        assert np.abs(record.position - record.true_position).max() <= step / 2 + 1e-12


def test_noise_has_the_size_asked_for_and_follows_the_seed():
    axis = ServoAxis(sensor=Sensor(noise=1e-3))
    one, again, other = (axis.simulate(REFERENCE, random_state=s) for s in (3, 3, 4))
    np.testing.assert_array_equal(one.position, again.position)
    assert not np.array_equal(one.position, other.position)
    assert np.std(one.position - one.true_position) == pytest.approx(1e-3, rel=0.1)
    quiet = axis.simulate(REFERENCE, noise=False)
    np.testing.assert_array_equal(quiet.position, quiet.true_position)


def test_an_encoder_on_the_load_sees_the_load():
    axis = ServoAxis(transmission=Transmission(0.5, 20.0, 0.1), sensor=Sensor(side="load"))
    record = axis.simulate_drive(DRIVE)
    np.testing.assert_array_equal(record.position, record.load_position)
    assert np.abs(record.position - record.true_position).max() > 1e-3


# -- controller -----------------------------------------------------------------------


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


def test_feedforward_of_the_true_axis_leaves_little_to_the_feedback():
    bare = ServoAxis(law=[Viscous(0.12)])
    ahead = dataclasses.replace(bare, controller=PIDController(60.0, 60.0, 2.0, 0.12, 0.05))
    reference = 0.2 * (1 - np.cos(6.0 * T)) ** 2
    errors = [np.std(a.simulate(reference).position - reference) for a in (bare, ahead)]
    assert errors[1] < 0.1 * errors[0]


def test_the_rig_follows_the_papers_reference():
    rig = ServoAxis.paper_rig()
    t = np.arange(2000) / rig.sample_rate
    record = rig.simulate(0.8 * np.sin(0.4 * math.pi * t))
    assert (rig.controller.kp, rig.controller.ki, rig.controller.kd, rig.sample_rate) == (40.0, 0.001, 0.2, 100.0)
    assert np.unique(np.round(record.position * 800 / (2 * math.pi), 6) % 1).tolist() == [0.0]
    assert np.std(record.position - record.reference) < 0.1


# -- replay ---------------------------------------------------------------------------


def test_open_loop_repeats_the_closed_loop():
    axis = ServoAxis(effects=[Cogging(0.1, 7.0), LuGre(0.1, 0.01)])
    closed = axis.simulate(REFERENCE)
    opened = axis.simulate_drive(closed.drive, initial_position=REFERENCE[0], initial_velocity=0.0)
    np.testing.assert_allclose(opened.position, closed.position, atol=1e-10)
    assert np.isnan(opened.reference).all()


def test_resync_returns_to_the_measurement():
    truth = ServoAxis(inertia=0.05).simulate_drive(DRIVE)
    wrong = ServoAxis(inertia=0.06)
    options = {"position": truth.position, "velocity": truth.velocity}
    free = wrong.simulate_drive(DRIVE, **options).position
    often = wrong.simulate_drive(DRIVE, resync=0.1, **options)
    always = wrong.simulate_drive(DRIVE, resync=0.001, **options)
    np.testing.assert_array_equal(always.position, truth.position)
    np.testing.assert_array_equal(often.position[::100], truth.position[::100])
    assert np.std(often.position - truth.position) < 0.3 * np.std(free - truth.position)


def test_resync_without_velocity_takes_it_from_the_position():
    truth = ServoAxis().simulate_drive(DRIVE)
    again = ServoAxis().simulate_drive(DRIVE, position=truth.position, resync=0.2)
    assert np.abs(again.position - truth.position).max() < 2e-3


def test_a_linear_hold_interpolates():
    axis = ServoAxis(law=[Viscous(0.1)])
    slow = dataclasses.replace(axis, sample_rate=100.0, substeps=200)
    drive = np.sin(9.0 * np.arange(200) / 100)
    fine = axis.simulate_drive(np.sin(9.0 * np.arange(2000) / 1000), hold="linear").position[::10]
    errors = [np.std(slow.simulate_drive(drive, hold=h).position - fine) for h in ("linear", "zero")]
    assert errors[0] < 0.1 * errors[1]


# -- batches and access ---------------------------------------------------------------


def test_a_batch_is_the_same_as_one_by_one_in_threads_too():
    axes = [ServoAxis(effects=[get_effect(n)()]) for n in ("cogging", "backlash", "input_delay")]
    alone = [a.simulate(REFERENCE, noise=1e-4 * np.cos(T)) for a in axes]
    for jobs in (1, 2):
        batch = simulate_many(axes, reference=REFERENCE, noise=1e-4 * np.cos(T), n_jobs=jobs)
        for one, many in zip(alone, batch, strict=True):
            np.testing.assert_array_equal(one.position, many.position)


def test_a_batch_gives_each_axis_its_own_noise():
    axis = ServoAxis(sensor=Sensor(noise=1e-3))
    a, b, c = simulate_many([axis] * 3, reference=REFERENCE, random_state=[1, 2, 1])
    assert not np.array_equal(a.position, b.position)
    np.testing.assert_array_equal(a.position, c.position)


@pytest.mark.parametrize("name", [n for n in effect_names() if get_effect(n).__module__.startswith("whsklearn.")])
def test_every_effect_runs_in_closed_loop_and_does_something(name):
    effect = get_effect(name)()
    effect = effect.resized(0.2) if name in ("saturation", "sensor_rectification") else effect
    t = np.arange(3000) / 1000
    reference = 1.6 * np.sin(3.0 * t)
    base = ServoAxis().simulate(reference)
    record = ServoAxis(effects=[effect]).simulate(reference)
    assert np.isfinite(record.position).all()
    assert not np.array_equal(record.drive, base.drive)


def test_parameters_come_and_go_by_name():
    axis = ServoAxis(
        law=[Viscous(0.1), Coulomb(0.2), Stribeck(0.05, 0.1)],
        effects=[Cogging(0.1, 7.0), Cogging(0.2, 14.0), Coulomb(0.01)],
        transmission=Transmission(),
    )
    assert axis.term_names == ("inertia", "viscous", "coulomb", "stribeck", "cogging", "cogging2", "coulomb2")
    names = ["inertia", "stribeck__velocity", "cogging2__order", "coulomb2", "drive__delay", "transmission__gap"]
    new = axis.with_vector(names, [0.04, 0.2, 21.0, 0.03, 0.002, 0.001])
    np.testing.assert_allclose(new.vector(names), [0.04, 0.2, 21.0, 0.03, 0.002, 0.001])
    assert axis.parameters["inertia"] == 0.05
    untouched = set(axis.parameters) - set(names)
    assert all(new.parameters[n] == axis.parameters[n] for n in untouched)
    assert new.with_parameters(axis.parameters) == axis


def test_effects_come_and_go():
    axis = ServoAxis()
    more = axis.with_effect(Cogging(0.1)).with_effect(Backlash())
    assert more.without_effect("cogging").without_effect("backlash") == axis
    with pytest.raises(ValueError, match="No effect is called 'cogging'"):
        axis.without_effect("cogging")


def test_a_neutral_effect_leaves_the_simulation_bit_for_bit():
    base = ServoAxis().simulate(REFERENCE)
    neutral = [get_effect(n)() for n in effect_names() if get_effect(n).__module__.startswith("whsklearn.")]
    axis = ServoAxis(effects=[e.resized(e.neutral) for e in neutral])
    np.testing.assert_array_equal(axis.simulate(REFERENCE).position, base.position)


def test_a_log_has_the_agreed_columns():
    frame = record_frame(ServoAxis().simulate(REFERENCE))
    assert list(frame) == ["time_s", "reference_rad", "torque_nm", "position_rad"]


def test_a_linear_axis_is_the_same_equation():
    axis = ServoAxis(95.1, [Viscous(203.5), Coulomb(20.39)], [InputOffset(-3.16)])
    record = axis.simulate_drive(np.full(3000, 60.0))
    assert record.velocity[-1] == pytest.approx((60.0 + 3.16 - 20.39) / 203.5, rel=0.01)


# -- refusals -------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("wrong", "complaint"),
    [
        ({"inertia": -0.1}, "inertia"),
        ({"inertia": math.nan}, "inertia"),
        ({"sample_rate": 0.0}, "sample_rate"),
        ({"substeps": 0}, "substeps"),
        ({"friction": "grease"}, "friction"),
        ({"effects": ["cogging"]}, "is no effect"),
        ({"law": "cogging"}, "cannot be a term"),
    ],
)
def test_an_axis_that_cannot_be_is_refused(wrong, complaint):
    with pytest.raises(ValueError, match=complaint):
        ServoAxis(**wrong)


@pytest.mark.parametrize(
    ("make", "complaint"),
    [
        (lambda: Drive(delay=-1.0), "delay"),
        (lambda: Sensor(side="roof"), "side"),
        (lambda: Transmission(load_share=1.0), "load_share"),
        (lambda: Transmission(stiffness=0.0), "stiffness"),
        (lambda: PIDController(derivative_on="friday"), "derivative_on"),
    ],
)
def test_a_part_that_cannot_be_is_refused(make, complaint):
    with pytest.raises(ValueError, match=complaint):
        make()


@pytest.mark.parametrize(
    ("options", "complaint"),
    [
        ({"reference": np.ones(5), "drive": np.ones(5)}, "either"),
        ({}, "either"),
        ({"drive": np.ones((5, 2))}, "1-D"),
        ({"drive": np.array([0.0, np.nan])}, "row 1"),
        ({"drive": np.ones(5), "resync": 1.0}, "position="),
        ({"drive": np.ones(5), "position": np.ones(4)}, "5 samples"),
        ({"drive": np.ones(5), "hold": "breath"}, "hold"),
        ({"drive": np.ones(5), "position": np.ones(5), "resync": 0.0}, "resync"),
    ],
)
def test_an_experiment_that_cannot_be_is_refused(options, complaint):
    with pytest.raises(ValueError, match=complaint):
        simulate_many([ServoAxis()], **options)


def test_unknown_parameters_are_refused_and_the_known_listed():
    with pytest.raises(ValueError, match=r"charm.*inertia"):
        ServoAxis().with_parameters(charm=1.0)
    with pytest.raises(ValueError, match="charm"):
        ServoAxis().vector(["charm"])
    with pytest.raises(ValueError, match="transmission__gap"):
        ServoAxis().with_parameters(transmission__gap=0.1)


def test_a_run_that_blows_up_says_so_and_a_batch_goes_on():
    wild = ServoAxis(controller=PIDController(kp=1e9, ki=0.0, kd=0.0))
    with pytest.raises(FloatingPointError, match="no longer finite"):
        wild.simulate(REFERENCE)
    records = simulate_many([wild, ServoAxis()], reference=REFERENCE)
    assert np.isfinite(records[1].position).all()


def test_a_delay_below_zero_is_refused():
    with pytest.raises(ValueError, match="cannot act early"):
        ServoAxis(effects=[InputDelay(-0.001)]).simulate_drive(DRIVE)


def test_two_transmission_effects_add_up():
    axis = ServoAxis(effects=[FlexibleCoupling(1e-3), FlexibleCoupling(2e-3)])
    one = ServoAxis(effects=[FlexibleCoupling(3e-3)])
    np.testing.assert_allclose(axis.simulate_drive(DRIVE).position, one.simulate_drive(DRIVE).position, atol=1e-12)
