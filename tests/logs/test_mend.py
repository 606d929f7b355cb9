"""Logs with the usual faults come back mended, and say so."""

from __future__ import annotations

import numpy as np
import pytest

from tests.logs.rig import columns
from whsklearn.logs import LogError, LogWarning
from whsklearn.logs.mend import frozen, jumps_in, lone_readings, turn_in


def turning(n=2000):
    table = columns(n)
    table["position_rad"] = 3.0 * table["time_s"] + 0.3 * np.sin(table["time_s"])
    return table


@pytest.mark.parametrize(
    ("name", "turn", "low"),
    [("position_rad", 2 * np.pi, -np.pi), ("position_rad", 2 * np.pi, 0.0), ("position_deg", 360.0, -180.0),
     ("position_counts", 65536.0, 0.0), ("position_counts", 4096.0, 0.0), ("angle", 360.0, 0.0)],
)  # fmt: skip
def test_a_wrapped_angle_goes_on(load, name, turn, low):
    table = turning()
    true = table.pop("position_rad") / (2 * np.pi) * turn
    wrapped = np.mod(true - low, turn) + low
    table[name] = np.round(wrapped) if turn > 400 else wrapped
    log = load(table, position=name)
    assert np.allclose(log.y - log.y[0], true - true[0], atol=1.0 if turn > 400 else 1e-6)
    assert "LOG012" in log.report.codes


@pytest.mark.parametrize("low", [0, -32768], ids=["unsigned", "signed"])
def test_a_16_bit_counter_overflows_whatever_its_counts_of_a_turn(load, low):
    """Counts of a turn that are known were the only period that was tried; signed counters were left in pieces."""
    table = turning()
    true = np.round(table.pop("position_rad") / (2 * np.pi) * 200_000)
    table["enc"] = np.mod(true - low, 65536) + low
    log = load(table, position="enc", units={"position": "counts/200000"})
    assert np.array_equal(log.y - log.y[0], true - true[0])
    assert "LOG012" in log.report.codes


@pytest.mark.parametrize("clock", ["restarts", "goes on"])
def test_a_run_that_is_there_twice_counts_once(load, clock):
    """Its second half would be held out, and is what was fitted."""
    table = columns(1000)
    twice = {k: np.r_[v, v] for k, v in table.items()}
    if clock == "goes on":
        twice["time_s"] = np.arange(2000) * (table["time_s"][1] - table["time_s"][0])
    with pytest.warns(LogWarning, match="From row 1000 on, 1000 rows repeat the log"):
        log = load(twice)
    assert np.array_equal(log.y, table["position_rad"])
    other = {k: v if k == "time_s" else np.r_[table[k], -table[k]] for k, v in twice.items()}
    with pytest.warns(LogWarning):
        assert load(other).y.size == 2000


def test_a_run_that_ends_where_it_began_is_found_where_its_clock_restarts(load):
    """No signal leaps there: the motion comes to rest where it started, under a drive that is nothing but noise."""
    table = columns(1000)
    table["torque_nm"] = np.random.default_rng(1).normal(size=1000)
    table["position_rad"] = np.sin(np.pi * np.arange(1000) / 999) ** 4
    with pytest.warns(LogWarning, match="From row 1000 on, 1000 rows repeat the log"):
        assert load({k: np.r_[v, v] for k, v in table.items()}).y.size == 1000


def test_a_simulated_motion_that_repeats_itself_is_kept(load):
    t = np.arange(2000)
    turn = {"torque_nm": np.round(np.cos(2 * np.pi * (t % 200) / 200), 6),
            "position_rad": np.round(np.sin(2 * np.pi * (t % 200) / 200), 6)}  # fmt: skip
    log = load({"time_s": t / 200, **turn})
    assert log.y.size == 2000
    assert "LOG006" not in log.report.codes


def test_what_is_not_wrapped_is_left(load):
    table = turning()
    assert turn_in(table["position_rad"], "rad") is None
    assert turn_in(3.1 * np.sign(np.sin(table["time_s"])), "rad") is None  # a command that steps from end to end
    log = load(columns())
    assert "LOG012" not in log.report.codes


def test_an_emergency_stop_is_cut_out_and_a_coast_is_not(load):
    table = columns(2000)
    rng = np.random.default_rng(0)
    table["torque_nm"] = table["torque_nm"] + 0.01 * rng.normal(size=2000)
    stopped = {k: v.copy() for k, v in table.items()}
    stopped["torque_nm"][1000:1400] = 0.0
    stopped["position_rad"][1040:1400] = stopped["position_rad"][1040]
    with pytest.warns(LogWarning, match="emergency stop"):
        log = load(stopped)
    assert np.bincount(log.groups).tolist() == [1000, 600]
    coast = {k: v.copy() for k, v in table.items()}
    coast["torque_nm"][1000:1400] = 0.0
    assert len(load(coast).y) == 2000


def test_a_velocity_alone_is_summed_up(load):
    table = columns(1000)
    table["velocity_rad_s"] = -2 * np.sin(2 * table["time_s"])
    with pytest.warns(LogWarning, match="Only the velocity"):
        log = load(table, position=None, velocity="velocity_rad_s")
    assert np.allclose(log.y, np.cos(2 * table["time_s"]) - 1, atol=1e-4)
    assert log.units["position"] == "rad"


def test_values_beyond_measure(load):
    table = columns(1000)
    table["torque_nm"][77] = 1e300
    with pytest.warns(LogWarning, match=r"no value at row 77 \(1e\+300"):
        assert np.abs(load(table).X).max() < 2
    table["torque_nm"] = table["torque_nm"] * 0 + 1e-300
    with pytest.raises(LogError, match="never exceeds 1e-300"):
        load(table)


@pytest.mark.parametrize("unit", ["rad", "counts"])
def test_an_encoder_that_was_reset_or_misread_goes_on(load, unit):
    table = turning()
    table["torque_nm"] = np.cos(7.0 * table["time_s"])
    true = table.pop("position_rad") * (1.0 if unit == "rad" else 1e4)
    true = true if unit == "rad" else np.round(true)
    read = true.copy()
    read[700:] -= true[700]
    read[1200] += 50 * np.abs(np.diff(true)).max()
    table[f"position_{unit}"] = read
    with pytest.warns(LogWarning, match=r"jumps by .* at row 700 \(3 such"):
        log = load(table, position=f"position_{unit}")
    assert np.allclose(log.y, true, atol=0.01 * np.ptp(np.diff(true)) + (unit == "counts") * 3)


def test_an_impact_and_a_coarse_step_are_no_resets(load):
    t = np.arange(2000) / 500
    wall = {"time_s": t, "torque_nm": np.cos(7 * t), "position_rad": np.abs(np.sin(3 * t))}
    assert "LOG023" not in load(wall).report.codes
    step = {
        "time_s": t,
        "torque_nm": np.cos(7 * t),
        "position_rad": (t > 2.0) + np.random.default_rng(0).normal(0.0, 1e-4, 2000),
    }
    assert "LOG023" not in load(step).report.codes


def test_whole_numbers_are_counts_where_no_unit_is_stated(load):
    table = columns()
    table["position"] = np.round(4096 / 6 * table.pop("position_rad"))
    log = load(table, position="position")
    assert log.units["position"] == "counts"
    assert any("whole numbers" in note for note in log.notes)


def test_an_output_of_unknown_unit_that_jumps_with_its_input_is_no_encoder(load):
    t = np.arange(2000) / 500
    jump = np.where((t > 1) & (t < 3), 3.0, 0.0)
    y = np.sin(3 * t) + jump
    assert np.flatnonzero(jumps_in(t, y, np.zeros(2000, dtype=np.int64))).tolist() == [501, 1500]
    log = load({"time_s": t, "torque_nm": np.cos(2 * t) + jump, "y": y}, position="y")
    assert np.allclose(log.y, y)


@pytest.mark.parametrize(("reading", "rows"), [("the last", 3), ("the last", 100), ("zero", 100)])
def test_a_log_that_repeats_an_old_reading_loses_those_rows(load, rows, reading):
    table = columns()
    true = table["position_rad"].copy()
    a = 560  # the axis moves at half its speed and more
    table["position_rad"][a : a + rows] = true[a - 1] if reading == "the last" else 0.0
    with pytest.warns(LogWarning, match=f"At row {a} a moving axis is logged at one place"):
        log = load(table)
    assert log.groups.max() == (rows == 100)
    left = np.delete(true, np.arange(a, a + rows)) if rows == 100 else true
    np.testing.assert_allclose(log.y, left, atol=1e-4)  # no offset behind, as after a reset of the encoder


def test_stops_starts_and_coarse_steps_are_not_frozen():
    t = np.arange(2000) / 1000
    one = np.zeros(2000, dtype=np.int64)
    stop = np.minimum(t, 1.0) * 3.0  # against a stop, at full speed
    start = 3.0 * np.maximum(t - 1.0, 0.0)  # hit by something
    slow = np.round(40 * np.sin(3 * t))
    held = np.repeat(np.sin(3 * t)[::5], 5)  # read at 200 Hz, logged at 1 kHz
    brake = np.where(t < 1, t, np.where(t < 1.5, 1.0, 1.0 + 2 * (t - 1.5) ** 2))
    for motion in (stop, start, slow, held, brake):
        assert frozen(motion, one)[1] is None


def pushed(drive):
    """Position of an axis of 0.05 kg m2 with 0.2 Nm s/rad at 500 Hz under a drive, which acts from its row on."""
    q, v, path = 0.0, 0.0, []
    for u in drive:
        path.append(q)
        v += (u - 0.2 * v) / 0.05 / 500
        q += v / 500
    return np.array(path)


@pytest.mark.parametrize("late", [0, 5])
@pytest.mark.parametrize("size", [60.0, -1e9])
def test_a_reading_of_the_drive_that_moves_nothing_is_no_drive_and_one_that_moves_the_axis_is(size, late):
    drive = 2.0 * np.sin(np.arange(3000) / 80.0)
    drive[1000] = size
    acting = np.roll(drive, late)
    glitch = np.where(np.arange(3000) == 1000 + late, 0.0, acting)
    assert np.flatnonzero(lone_readings(drive, pushed(glitch), 2)).tolist() == [1000]
    assert not lone_readings(drive, pushed(acting), 2).any()


def test_a_lone_reading_of_the_drive_is_told_and_counts_as_a_lost_sample(load):
    table = columns(2000)
    sound = load(dict(table))
    table["torque_nm"] = np.where(np.arange(2000) == 700, 1e9, table["torque_nm"])
    with pytest.warns(LogWarning, match="1e.09, which the motion does not answer"):
        log = load(table)
    np.testing.assert_allclose(log.X, sound.X, atol=0.05)
