"""Logs of the simulated axis: references, hidden effects, the rig's record."""

from __future__ import annotations

import numpy as np
import pytest

from whsklearn.datasets import draw_effect, load_turntable, make_servo_log, reference_signal
from whsklearn.datasets.servo import default_axis, make_turntable
from whsklearn.effects import BoucWen, Cogging, GeneralizedMaxwellSlip, LuGre, effect_names, get_effect

KINDS = ("sine", "multisine", "staircase", "sweep", "rich")


@pytest.mark.parametrize("kind", KINDS)
def test_height_length_and_seed(kind):
    path = reference_signal(kind, 10.0, 500.0, 0.7, random_state=3)
    assert path.shape == (5000,)
    assert np.abs(path).max() <= 0.7 * 1.35  # the rich one is a triangle with tones on it
    np.testing.assert_array_equal(path, reference_signal(kind, 10.0, 500.0, 0.7, random_state=3))


@pytest.mark.parametrize("kind", ["multisine", "staircase", "sweep", "rich"])
def test_the_axis_is_not_kicked_at_the_start(kind):
    path = reference_signal(kind, 20.0, 1000.0)
    speed = np.abs(np.diff(path))
    assert speed[:20].max() < 0.1 * speed.max()


def test_a_multisine_has_its_eight_tones_and_no_other():
    path = reference_signal("multisine", 50.0, 200.0, random_state=0)[1000:9000]  # 40 s: a whole number of periods
    power = np.abs(np.fft.rfft(path)) ** 2
    frequencies = np.fft.rfftfreq(path.size, 1 / 200)
    tones = np.isclose(frequencies[:, None], 0.1 + 0.4 * np.arange(8)).any(axis=1)
    assert power[tones].sum() / power[1:].sum() > 0.999


@pytest.mark.parametrize("wrong", [{"kind": "square"}, {"duration": -1.0}, {"sample_rate": np.inf}, {"amplitude": 0.0}])
def test_what_cannot_be_is_refused(wrong):
    with pytest.raises(ValueError, match=next(iter(wrong)) if "kind" not in wrong else "Unknown reference"):
        reference_signal(**{"kind": "sine", "duration": 5.0, "sample_rate": 100.0, **wrong})


AXIS = default_axis()
PATH = reference_signal("rich", 10.0, AXIS.sample_rate, random_state=0)


@pytest.mark.parametrize("name", ["coulomb", "cogging", "cable_spring", "load_friction", "disturbance_tone"])
@pytest.mark.parametrize("share", [0.02, 0.2])
def test_the_size_is_a_share_of_the_rms_drive(name, share):
    effect = draw_effect(name, AXIS, PATH, share, random_state=1)
    base = AXIS.simulate(PATH, noise=False)
    torque = effect.value(
        time=base.time, position=base.true_position, velocity=base.velocity, drive=base.torque,
        acceleration=np.gradient(base.velocity, base.time),
    )  # fmt: skip
    assert np.sqrt(np.mean(torque**2)) == pytest.approx(share * np.std(base.drive), rel=0.3)


def test_the_same_seed_draws_the_same_effect():
    first, second = (draw_effect("cogging", AXIS, PATH, 0.05, random_state=7) for _ in range(2))
    assert first == second
    assert draw_effect("cogging", AXIS, PATH, 0.05, random_state=8) != first


NAMES = [n for n in effect_names() if get_effect(n).__module__.startswith("whsklearn.")]


@pytest.mark.parametrize("kind", KINDS)
def test_a_reference_has_the_peak_asked_for_and_no_jumps(kind):
    r = reference_signal(kind, 20.0, 500.0, amplitude=0.7, random_state=1)
    assert r.shape == (10_000,)
    assert np.abs(r).max() == pytest.approx(0.7, rel=1e-3)
    assert r[0] == pytest.approx(0.0, abs=1e-3)
    acceleration = np.diff(r, 2) * 500.0**2
    assert np.abs(acceleration).max() < 60.0 * np.std(r) * (2 * np.pi) ** 2


def test_the_sine_is_the_papers():
    t = np.arange(1000) / 100
    np.testing.assert_allclose(reference_signal("sine", 10.0, 100.0), 0.8 * np.sin(0.4 * np.pi * t), atol=1e-12)


def test_the_staircase_holds_eight_speeds_both_ways():
    velocity = np.diff(reference_signal("staircase", 40.0, 500.0)) * 500
    held = velocity[np.abs(np.diff(velocity, prepend=0.0)) < 1e-9]
    speeds = np.unique(np.round(held, 4))
    assert np.sum(speeds > 0.005) == np.sum(speeds < -0.005) == 8


def test_the_multisine_has_its_eight_tones():
    r = reference_signal("multisine", 40.0, 100.0, random_state=3)[2000:]  # two whole periods after the fade
    spectrum = np.abs(np.fft.rfft(r))
    lines = np.fft.rfftfreq(r.size, 0.01)[spectrum > 0.01 * spectrum.max()]
    np.testing.assert_allclose(lines, 0.1 + 0.4 * np.arange(8), atol=1e-9)


@pytest.mark.parametrize(
    ("options", "complaint"),
    [
        ({"kind": "noise"}, "multisine"),
        ({"kind": "sine", "duration": -1.0}, "duration"),
        ({"kind": "sine", "duration": 1e-4}, "at least two"),
    ],
)
def test_a_reference_that_cannot_be_is_refused(options, complaint):
    with pytest.raises(ValueError, match=complaint):
        reference_signal(**options)


def test_a_log_follows_its_seed():
    one, again, other = (make_servo_log(["cogging"], duration=3.0, random_state=s) for s in (5, 5, 6))
    assert one.equals(again)
    assert not one.equals(other)
    assert list(one) == ["time_s", "reference_rad", "torque_nm", "position_rad"]
    assert len(one) == 3000


def test_the_truth_tells_what_is_hidden():
    log, truth = make_servo_log([Cogging(0.1, 9.0), "viscous"], duration=2.0, return_truth=True)
    assert truth.effects[0] == Cogging(0.1, 9.0)
    assert [e.name for e in truth.axis.effects] == ["cogging", "viscous"]
    assert truth.parameters["cogging__order"] == 9.0
    np.testing.assert_array_equal(truth.record.position, log["position_rad"])


def test_noise_is_given_by_size():
    _, truth = make_servo_log(duration=10.0, reference="multisine", noise=1e-3, return_truth=True)
    assert np.std(truth.record.position - truth.record.true_position) == pytest.approx(1e-3, rel=0.05)
    _, truth = make_servo_log(duration=2.0, noise=0.0, resolution=1e-3, return_truth=True)
    np.testing.assert_allclose(truth.record.position * 1000, np.round(truth.record.position * 1000), atol=1e-9)


@pytest.mark.parametrize(
    "name",
    [n for n in NAMES if n not in ("output_offset", "output_drift", "saturation")]
    + [LuGre, GeneralizedMaxwellSlip, BoucWen],
)
def test_a_drawn_effect_matters_as_much_as_asked(name):
    axis = default_axis()
    reference = reference_signal("rich", 8.0, 1000.0)
    effect = draw_effect(name, axis, reference, 0.1, random_state=2)
    base = axis.simulate(reference, noise=False)
    record = axis.with_effect(effect).simulate(reference, noise=False)
    answer = np.sqrt(np.mean((record.drive - base.drive) ** 2)) / np.std(base.drive)
    assert 0.02 < answer < 0.25


def test_a_drawn_saturation_cuts_the_share_asked_for():
    axis, reference = default_axis(), reference_signal("rich", 8.0, 1000.0)
    effect = draw_effect("saturation", axis, reference, 0.05)
    drive = axis.simulate(reference, noise=False).drive
    cut = drive - np.clip(drive, -effect.limit, effect.limit)
    assert np.sqrt(np.mean(cut**2)) / np.std(drive) == pytest.approx(0.05, rel=0.05)


def test_shares_and_names_that_cannot_be_are_refused():
    with pytest.raises(ValueError, match="share"):
        make_servo_log("cogging", sizes=0.0, duration=1.0)
    with pytest.raises(ValueError, match="Unknown effect"):
        make_servo_log("gremlin", duration=1.0)


@pytest.mark.parametrize("experiment", ["sine", "multisine"])
def test_the_turntable_is_what_the_library_simulates(experiment):
    stored, made = load_turntable(experiment), make_turntable(experiment)
    assert list(stored) == list(made)
    np.testing.assert_allclose(stored["time_s"], made["time_s"], atol=1e-9)
    np.testing.assert_allclose(stored["position_rad"], made["position_rad"], atol=1e-5)
    np.testing.assert_allclose(stored["torque_nm"], made["torque_nm"], atol=1e-5)


def test_the_turntable_as_arrays():
    X, y = load_turntable(return_X_y=True)
    assert X.shape == (4000, 1)
    assert y.shape == (4000,)
    assert np.std(X[:, 0] - y) < 0.1
    with pytest.raises(ValueError, match="multisine"):
        load_turntable("waltz")


@pytest.mark.parametrize("experiment", ["sine", "multisine"])
def test_records_are_even_and_finite(experiment):
    log = load_turntable(experiment)
    assert list(log) == ["time_s", "reference_rad", "torque_nm", "position_rad"]
    assert np.isfinite(log.to_numpy()).all()
    np.testing.assert_allclose(np.diff(log["time_s"]), np.diff(log["time_s"])[0], rtol=1e-6)


def test_the_sine_is_the_papers_reference():
    log = load_turntable("sine")
    np.testing.assert_allclose(log["reference_rad"], 0.8 * np.sin(0.4 * np.pi * log["time_s"]), atol=1e-6)


def test_as_arrays_and_an_unknown_name():
    X, y = load_turntable("sine", return_X_y=True)
    assert X.shape == (4000, 1)
    assert y.shape == (4000,)
    with pytest.raises(ValueError, match="Unknown experiment"):
        load_turntable("square")
