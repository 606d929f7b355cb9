"""The servo axis as an instrument: drive, sensor, controller, replay, parameters, batches."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from tests.systems.signals import DRIVE, REFERENCE, T
from whsklearn import _numba
from whsklearn.effects import (
    Cogging,
    Coulomb,
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
    codes,
    effect_names,
    get_effect,
)
from whsklearn.effects.base import signals_of
from whsklearn.systems import Drive, PIDController, Sensor, ServoAxis, Transmission, record_frame, simulate_many
from whsklearn.systems.servo import is_compiled, pack, parts_of


def test_an_axis_is_compiled_once_one_has_been_simulated(tmp_path, monkeypatch):
    ServoAxis().simulate(np.zeros(10))
    assert is_compiled()
    monkeypatch.setattr(_numba._settings, "CACHE_DIR", str(tmp_path))
    assert not is_compiled()


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


def test_a_log_has_the_agreed_columns():
    frame = record_frame(ServoAxis().simulate(REFERENCE))
    assert list(frame) == ["time_s", "reference_rad", "torque_nm", "position_rad"]


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


def test_a_run_that_blows_up_says_so_and_a_batch_goes_on():
    wild = ServoAxis(controller=PIDController(kp=1e9, ki=0.0, kd=0.0))
    with pytest.raises(FloatingPointError, match="no longer finite"):
        wild.simulate(REFERENCE)
    records = simulate_many([wild, ServoAxis()], reference=REFERENCE)
    assert np.isfinite(records[1].position).all()


# -- drive ----------------------------------------------------------------------------


# -- balance --------------------------------------------------------------------------


def test_torque_balance_holds_along_a_record():
    axis = ServoAxis(
        law=[Viscous(0.2), Coulomb(0.3)], effects=[Cogging(0.1, 9.0, 0.4), InputOffset(0.1), TorqueRipple(0.1, 3.0)]
    )
    t = np.arange(8000) / 2000
    axis = dataclasses.replace(axis, sample_rate=2000.0)
    record = axis.simulate_drive(0.9 * np.sin(4.0 * t))
    signals = signals_of(record, "torque")
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


# -- batches and access ---------------------------------------------------------------


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


def test_a_neutral_effect_leaves_the_simulation_bit_for_bit():
    base = ServoAxis().simulate(REFERENCE)
    neutral = [get_effect(n)() for n in effect_names() if get_effect(n).__module__.startswith("whsklearn.")]
    axis = ServoAxis(effects=[e.resized(e.neutral) for e in neutral])
    np.testing.assert_array_equal(axis.simulate(REFERENCE).position, base.position)


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
        ({"effects": ["cogging"]}, "is not an effect"),
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


def test_a_delay_below_zero_is_refused():
    with pytest.raises(ValueError, match="cannot act early"):
        ServoAxis(effects=[InputDelay(-0.001)]).simulate_drive(DRIVE)


def test_two_transmission_effects_add_up():
    axis = ServoAxis(effects=[FlexibleCoupling(1e-3), FlexibleCoupling(2e-3)])
    one = ServoAxis(effects=[FlexibleCoupling(3e-3)])
    np.testing.assert_allclose(axis.simulate_drive(DRIVE).position, one.simulate_drive(DRIVE).position, atol=1e-12)


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


def test_unknown_parameters_are_refused_and_the_known_listed():
    with pytest.raises(ValueError, match=r"charm.*inertia"):
        ServoAxis().with_parameters(charm=1.0)
    with pytest.raises(ValueError, match="charm"):
        ServoAxis().vector(["charm"])
    with pytest.raises(ValueError, match="transmission__gap"):
        ServoAxis().with_parameters(transmission__gap=0.1)


def test_effects_of_neutral_size_are_left_out():
    plant = pack(ServoAxis(law=[Viscous(0.1), Coulomb(0.0)], effects=[Cogging(0.0), Saturation(math.inf)]))
    assert plant.codes.tolist() == [codes.VISCOUS]
    assert plant.p[0, 0] == 0.1


def test_parts_hold_what_is_no_effect():
    axis = ServoAxis(
        inertia=0.03, friction="tanh", smoothing=0.02, drive=Drive(2.0, 5.0, 0.003, 0.004),
        transmission=Transmission(0.4, 30.0, 0.1, 0.01), sensor=Sensor(1e-3, side="load"),
    )  # fmt: skip
    np.testing.assert_allclose(parts_of(axis), [0.03, 50.0, 2.0, 5.0, 0.003, 0.004, 0.4, 30.0, 0.1, 0.01, 1e-3, 1.0])
    rigid = parts_of(ServoAxis())
    assert rigid[1] == math.inf  # true stiction
    assert not rigid[6:10].any()


def test_a_controllers_switch_is_a_number():
    for source in ("error", "measurement"):
        c = PIDController(kp=3.0, ki=2.0, kd=1.0, derivative_on=source)
        row = c.row
        assert row[:3] == (3.0, 2.0, 1.0)
        assert row[6] == float(source == "measurement")


def test_a_drive_cannot_act_early():
    with pytest.raises(ValueError, match="cannot act early"):
        pack(ServoAxis(drive=Drive(delay=0.001), effects=[InputDelay(-0.004)]))
