"""Logs with the usual faults come back mended, and say so."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from tests.logs.rig import RATE, columns
from whsklearn.logs import LogError, LogWarning, load_log
from whsklearn.logs.mend import turn_in

NAMES = {"time": "time_s", "drive": "torque_nm", "position": "position_rad"}


@pytest.fixture
def load(tmp_path):
    def read(table, **names):
        pd.DataFrame(table).to_csv(tmp_path / "axis.csv", index=False)
        return load_log(tmp_path / "axis.csv", **{**NAMES, **names})

    return read


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


def test_what_is_not_wrapped_is_left(load):
    table = turning()
    assert turn_in(table["position_rad"], "rad") is None
    assert turn_in(3.1 * np.sign(np.sin(table["time_s"])), "rad") is None  # a command that steps from end to end
    log = load(columns())
    assert "LOG012" not in log.report.codes


def test_a_hole_cuts_the_log_into_segments(load):
    table = {k: np.delete(v, np.arange(500, 600)) for k, v in columns().items()}
    with pytest.warns(LogWarning, match=r"about 100 samples, the first before row 500"):
        log = load(table)
    assert np.bincount(log.groups).tolist() == [500, 600]
    assert np.array_equal(log.y[:500], table["position_rad"][:500])


def test_jitter_goes_onto_an_even_grid_with_little_error(load):
    table = columns(2000)
    rng = np.random.default_rng(1)
    t = table["time_s"] = table["time_s"] + rng.uniform(-0.2, 0.2, 2000) / RATE
    table["position_rad"] = np.cos(8 * t)
    with pytest.warns(LogWarning, match="even grid"):
        log = load(table)
    assert np.ptp(np.diff(log.time)) < 1e-9
    assert np.max(np.abs(log.y - np.cos(8 * (log.time + t[0])))[2:-2]) < 2e-5  # a straight line would be 2e-4 off


def test_steps_of_10_and_12_ms_are_11(load):
    table = columns(1000)
    table["time_s"] = np.cumsum(np.tile([0.010, 0.012], 500))
    with pytest.warns(LogWarning):
        assert load(table).sample_rate == pytest.approx(1 / 0.011, rel=1e-3)


def test_rounded_stamps_leave_the_samples_as_they_are(load):
    table = columns(1000)
    table["time_s"] = np.floor(np.arange(1000) * 1.5) * 1e-3
    with pytest.warns(LogWarning, match="rounded"):
        log = load(table)
    assert np.array_equal(log.y, table["position_rad"])
    assert log.sample_rate == pytest.approx(1 / 0.0015, rel=1e-3)


def test_coarse_stamps_that_several_rows_share_are_spread(load):
    table = columns(1000)
    table["time_s"] = np.arange(1000) // 4 * 0.01
    with pytest.warns(LogWarning, match="rows share a stamp"):
        log = load(table)
    assert log.sample_rate == pytest.approx(400, rel=1e-3)


def test_a_clock_that_starts_anew_begins_a_segment(load):
    table = columns(1000)
    table["time_s"][600:] -= table["time_s"][600]
    with pytest.warns(LogWarning, match="At row 600 time falls back"):
        log = load(table)
    assert np.bincount(log.groups).tolist() == [600, 400]
    assert np.all(np.diff(log.time) > 0)


def test_one_wrong_stamp_is_one_lost_row(load):
    table = columns(1000)
    table["time_s"][300] = 1e9
    with pytest.warns(LogWarning, match=r"Row 300 is stamped 1e\+09 s"):
        log = load(table)
    assert log.groups.max() == 0
    assert len(log.y) == 1000


def test_rows_a_little_out_of_order_are_sorted(load):
    table = columns(1000)
    order = np.arange(1000)
    order[[400, 401, 402]] = [402, 400, 401]
    swapped = {k: v[order] for k, v in table.items()}
    with pytest.warns(LogWarning):
        log = load(swapped)
    assert np.allclose(log.y, table["position_rad"], atol=1e-3)


@pytest.mark.parametrize(("unit", "factor"), [("s", 1.0), ("ms", 1e3), ("us", 1e6), ("ns", 1e9)])
def test_ticks_since_1970(load, unit, factor):
    table = columns(400)
    ticks = table["time_s"] * factor + 1.7e9 * factor
    table["time_s"] = ticks if unit == "s" else np.round(ticks).astype(np.int64)
    log = load(table)
    assert log.sample_rate == pytest.approx(RATE, rel=1e-3)
    assert "LOG015" in log.report.codes


@pytest.mark.parametrize("form", ["%Y-%m-%dT%H:%M:%S.%fZ", "%d.%m.%Y %H:%M:%S,%f", "%H:%M:%S.%f"])
def test_dates_and_times_of_the_day(load, form):
    table = columns(400)
    stamps = pd.Timestamp("2026-05-21 12:00:00") + pd.to_timedelta(table["time_s"], unit="s")
    table["time_s"] = stamps.strftime(form)
    assert load(table).sample_rate == pytest.approx(RATE, rel=1e-3)


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
