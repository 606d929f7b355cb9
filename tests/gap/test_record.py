"""A record's noise, units and held-out blocks."""

from __future__ import annotations

import tracemalloc
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from tests.foreign_frame import ForeignFrame
from whsklearn.gap.data_check import check_servo
from whsklearn.gap.plants.servo_sensors import coarse_encoder
from whsklearn.gap.record import ServoRecord, noise_level, reading_noise, training_samples

T = np.arange(20_000) / 1000
PATH = np.sin(2 * T) + 0.3 * np.sin(7 * T)


@pytest.mark.parametrize("noise", [1e-5, 1e-3])
def test_noise_is_seen_whatever_the_motion(noise):
    seen = noise_level(PATH + noise * np.random.default_rng(0).normal(size=T.size))
    assert seen == pytest.approx(noise, rel=0.1)
    assert noise_level(PATH) < 0.01 * noise


@pytest.mark.parametrize("gain", [0.0, 300.0])
@pytest.mark.parametrize("noise", [0.01, 0.05])
def test_the_noise_of_a_drive_is_seen_beside_what_its_controller_makes_of_the_encoder(gain, noise):
    position = np.round(PATH / 1e-3) * 1e-3
    drive = np.sin(3 * T) - gain * position + noise * np.random.default_rng(1).normal(size=T.size)
    halves = [(x[:9000], x[9000:]) for x in (drive, position)]
    assert reading_noise(*halves) == pytest.approx(noise, rel=0.1)
    if gain:
        assert noise_level(drive) > 1.5 * noise


def test_a_drive_that_the_motion_shows_is_no_noise_and_a_short_record_tells_none():
    drive = np.random.default_rng(2).normal(size=T.size)
    velocity = np.cumsum(drive) * 1e-3  # of a mass of 1 kg
    assert reading_noise([drive], [np.cumsum(velocity) * 1e-3]) < 0.05
    assert reading_noise([drive[:20]], [drive[:20]]) == 0.0


def test_the_noise_of_a_long_record_is_that_of_its_rows_here_and_there():
    noise = 0.05 * np.random.default_rng(3).normal(size=20 * T.size)
    drive, position = (np.tile(x, 20) for x in (np.sin(3 * T), PATH))
    tracemalloc.start()
    assert reading_noise([drive + noise], [position]) == pytest.approx(0.05, rel=0.1)
    most = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert most < 10 * drive.nbytes, "its windows alone would be 26 times the record"


@pytest.mark.parametrize(
    ("units", "made", "told"),
    [(("counts", "counts"), False, False), (("", ""), False, False), (("Nm", "rad"), False, False),
     (("rad", "rad"), False, True), (("m", "m"), False, True), (("counts", "counts"), True, True)],
)  # fmt: skip
def test_equal_units_make_no_following_error_of_a_drive(units, made, told):
    record = ServoRecord(T, PATH, PATH, units=units, in_place_of_drive="command minus position" if made else "")
    assert record.is_following_error == told


@pytest.mark.parametrize(
    ("step", "stated", "unit", "named"),
    [(0.01, 0.0, "rad", True), (0.01, 0.01, "rad", False), (0.01, 0.005, "rad", True),
     (2 * np.pi / 4000, 0.0, "rad", False), (2 * np.pi / 4000, 0.0, "m", True), (2 * np.pi / 4000, 1e-4, "rad", True)],
)  # fmt: skip
def test_a_grid_that_the_log_states_or_that_is_usual_is_no_effect(step, stated, unit, named):
    record = SimpleNamespace(resolution=stated, units=("Nm", unit))
    view = SimpleNamespace(
        quantum=step, noise=0.3 * step, scene=SimpleNamespace(reach=1.0), record=record,
        gap=lambda m: m, rms=lambda g: 1.0, floor=1.0,
    )  # fmt: skip
    assert bool(coarse_encoder(view, None)) == named


@pytest.mark.parametrize("n", [1003, 10_000])
def test_two_fifths_are_held_out_in_five_stretches(n):
    train = training_samples(np.sin(np.arange(n) / 50.0))
    assert np.mean(~train) == pytest.approx(0.4, abs=0.005)
    first, last = (np.flatnonzero(np.diff(np.pad(~train, 1).astype(int)) == way) for way in (1, -1))
    assert first.size == 5
    assert np.ptp(last - first) <= 1
    assert train[0]
    assert not train[-1]


def test_of_steps_that_all_lie_in_the_fitted_parts_two_fifths_are_held_out():
    moved = np.where(np.arange(5000) % 1000 < 400, 0.01, 0.0)  # the fitted 600 of each 1,000 have all of it
    joints = np.cumsum(np.column_stack([moved, -2.0 * moved]), axis=0)
    for position in (joints[:, 0], joints):
        train = training_samples(position)
        steps = np.abs(np.diff(joints[:, 0], prepend=0.0))
        assert steps[~train].sum() == pytest.approx(0.4 * steps.sum(), rel=0.05)
        assert np.flatnonzero(np.diff(train.astype(int))).size <= 10
    assert training_samples(np.zeros(100)).sum() == 60  # at rest


RNG = np.random.default_rng(0)


@pytest.mark.parametrize("sigma", [1e-5, 1e-3])
def test_noise_level_sees_through_motion(sigma):
    t = np.arange(20_000) * 1e-3
    assert noise_level(np.sin(3 * t) + sigma * RNG.standard_normal(t.size)) == pytest.approx(sigma, rel=0.15)


@pytest.mark.parametrize(
    ("columns", "scale", "units"),
    [
        (("t_ms", "torque_mnm", "angle_deg"), (1e3, 1e3, 180 / np.pi), ("Nm", "rad")),
        (("t_s", "force_kn", "travel_mm"), (1.0, 1e-3, 1e3), ("N", "m")),
        (("t_us", "current_ma", "angle_turns"), (1e6, 1e3, 0.5 / np.pi), ("A", "rad")),
        (("t", "u", "q"), (1.0, 1.0, 1.0), ("Nm", "rad")),
    ],
)
def test_a_record_is_in_si_whatever_the_columns_are_in(columns, scale, units):
    frame = ForeignFrame({c: s * x for c, s, x in zip(columns, scale, (T, np.sin(T), PATH), strict=True)})
    names = dict(zip(("time", "drive", "position"), columns, strict=True))
    record = ServoRecord.from_frame(frame, **names, reference=columns[2])
    assert record.units == units
    np.testing.assert_allclose(record.time, T, rtol=1e-12, atol=1e-15)
    np.testing.assert_allclose(record.drive, np.sin(T), rtol=1e-12)
    np.testing.assert_allclose(record.position, PATH, rtol=1e-12, atol=1e-15)
    np.testing.assert_allclose(record.reference, PATH, rtol=1e-12, atol=1e-15)


def test_a_step_of_the_encoder_goes_with_the_position():
    record = ServoRecord(T, PATH, PATH, units=("Nm", "counts/4096"), resolution=1.0)
    assert record.resolution == pytest.approx(2 * np.pi / 4096)
    assert record.told(record.resolution, "rad") == "0.00153 rad"  # a count is no unit to speak in
    assert ServoRecord(T, PATH, PATH, units=("Nm", "deg")).told(np.pi, "rad/s") == "180 deg/s"


def in_pieces():
    """A record of 10 s at 1 kHz without the samples from 4 to 5 s and from 8 to 8.5 s."""
    there = ~((T >= 4.0) & (T < 5.0) | (T >= 8.0) & (T < 8.5)) & (T < 10.0)
    return ServoRecord(T[there], PATH[there], PATH[there], starts=(4000, 7000))


def test_segments_have_their_own_time_and_the_record_one_rate():
    record = in_pieces()
    assert record.dt == pytest.approx(1e-3, rel=1e-9)
    assert [(s.stop - s.start, round(t, 9)) for s, t in record.pieces] == [(4000, 0.0), (3000, 5.0), (1500, 8.5)]
    np.testing.assert_allclose(record.clock, record.time, atol=1e-9)
    assert check_servo(record) == []
    bad = check_servo(ServoRecord(record.time, record.drive, record.position))
    assert [p.code for p in bad] == ["data-uneven-time"]


def test_what_runs_by_piece_never_sees_two_of_them():
    record = in_pieces()
    rates = record.by_piece(lambda x: np.gradient(x, record.dt), record.position)
    slope = 2 * np.cos(2 * record.time) + 2.1 * np.cos(7 * record.time)
    np.testing.assert_allclose(rates, slope, atol=0.02)
    near = record.near_a_hole(10, 20)
    assert near.sum() == 60
    assert near[[3990, 4019, 6990, 7019]].all()
    flat = record.smoothed(lambda x: np.convolve(x, np.ones(51) / 51, mode="same"), record.position, 25)
    inside = slice(25, -25)  # the record's own ends are as `convolve` leaves them at padded ones
    np.testing.assert_allclose(flat[inside], record.position[inside], atol=0.01)


@pytest.mark.parametrize(
    ("drive", "position", "units"),
    [
        ("torque [p.u.]", "angle_deg", ("p.u.", "rad")),  # had become Nm
        ("iq (Arms)", "x_nm", ("Arms", "m")),
        ("torque", "position_V", ("Nm", "rad")),
    ],
)
def test_the_columns_of_a_frame_keep_units_that_are_not_known(drive, position, units):
    frame = pd.DataFrame({"time_s": [0.0, 0.1, 0.2], drive: [1.0, 2.0, 3.0], position: [0.0, 1.0, 0.0]})
    assert ServoRecord.from_frame(frame, drive=drive, position=position).units == units
