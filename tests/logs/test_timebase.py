"""Stamps: holes, restarts, strays and disorder are found; ticks and dates become seconds; jitter ends on a grid."""

from __future__ import annotations

from contextlib import nullcontext

import numpy as np
import pandas as pd
import pytest

from tests.logs.rig import NAMES, RATE, columns
from tests.logs.rig import columns as table
from whsklearn.logs import LogWarning, load_log
from whsklearn.logs.timebase import even, to_seconds


def test_a_hole_cuts_the_log_into_segments(load):
    table = {k: np.delete(v, np.arange(500, 600)) for k, v in columns().items()}
    with pytest.warns(LogWarning, match=r"about 100 samples, the first before row 500"):
        log = load(table)
    assert np.bincount(log.groups).tolist() == [500, 600]
    assert np.array_equal(log.y[:500], table["position_rad"][:500])


def test_a_clock_that_starts_anew_begins_a_segment(load):
    table = columns(1000)
    table["time_s"][600:] -= table["time_s"][600]
    with pytest.warns(LogWarning, match="At row 600 time jumps back"):
        log = load(table)
    assert np.bincount(log.groups).tolist() == [600, 400]
    assert np.all(np.diff(log.time) > 0)


def test_one_wrong_stamp_is_one_lost_row(load):
    table = columns(1000)
    table["time_s"][300] = 1e9
    with pytest.warns(LogWarning, match=r"Row 300 has the stamp 1e\+09 s"):
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


@pytest.mark.parametrize(
    "stamps", [("59:59.25", "59:59.75", "00:00.25"), ("23:59:59.25", "23:59:59.75", "00:00:00.25")]
)
def test_times_of_the_day_go_on_over_the_hour_and_over_midnight(stamps):
    assert to_seconds(np.array(stamps, dtype=object), "s", "t")[0].tolist() == [0.0, 0.5, 1.0]


def test_stamps_may_be_dates(write):
    columns = table(400)
    dates = pd.Timestamp("2024-05-01 12:00:00") + pd.to_timedelta(np.round(columns["time_s"] * 1e6), unit="us")
    for name in ("axis.csv", "axis.parquet"):
        if name.endswith("parquet"):
            pytest.importorskip("pyarrow")
        log = load_log(write({**columns, "stamp": dates}, name), **{**NAMES, "time": "stamp"})
        assert log.sample_rate == pytest.approx(RATE)
        assert log.time[-1] == pytest.approx(columns["time_s"][-1])
    with pytest.raises(ValueError, match=r"'word' holds neither numbers nor dates: row 0 holds 'noon'"):
        load_log(write({**columns, "word": ["noon"] * 400}), **{**NAMES, "time": "word"})


def test_the_row_that_holds_no_date_is_told():
    """The first row was told, which held one."""
    stamps = np.array([f"2026-06-30T23:59:{58 + k}.5Z" for k in range(3)])
    with pytest.raises(ValueError, match=r"row 2 holds '2026-06-30T23:59:60\.5Z'"):
        to_seconds(stamps, "s", "t")


def test_gaps_doubles_and_backward_stamps_are_found_and_mended(write):
    columns = {k: v.copy() for k, v in table(2000).items()}
    keep = np.r_[0:500, 503:1000, 1200:2000]
    columns = {k: v[keep] for k, v in columns.items()}
    columns["time_s"][100] = columns["time_s"][99]
    columns["time_s"][300] = columns["time_s"][297]
    file = write(columns)
    with pytest.raises(ValueError, match=r"time runs backwards. From row 299 to row 300"):
        load_log(file, **NAMES, resample=False)
    with pytest.warns(LogWarning):
        log = load_log(file, **NAMES)
    assert {"LOG002", "LOG003", "LOG004"} <= set(log.report.codes)
    assert set(log.groups) == {0, 1}  # the gap of 200 samples parts the log, that of 3 is bridged
    assert np.sum(log.groups == 0) == pytest.approx(1000, abs=1)
    missing = next(f for f in log.report.findings if f.code == "LOG002")
    assert missing.value == pytest.approx(203, abs=8)


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
    with pytest.warns(LogWarning, match="rows share a time stamp"):
        log = load(table)
    assert log.sample_rate == pytest.approx(400, rel=1e-3)


@pytest.mark.parametrize("off", [0.02, -0.3])
def test_irregular_sampling_is_refused_with_the_row_and_resampled_on_request(write, off):
    columns = table(2000)
    columns["time_s"] = columns["time_s"].copy()
    columns["time_s"][700] += off / RATE
    file = write(columns)
    with pytest.raises(ValueError, match=r"sampling is irregular. Row 70[01] .*1% allowed.*resample=True"):
        load_log(file, **NAMES, resample=False)
    with pytest.warns(LogWarning):
        log = load_log(file, **NAMES)
    assert set(log.report.codes) == {"LOG001", "LOG011"}
    assert np.allclose(np.diff(log.time), 1 / RATE)
    assert np.allclose(log.y, np.cos(2 * log.time), atol=5e-3)


def test_jitter_within_one_percent_passes_and_is_reported(write):
    columns = table(2000)
    columns["time_s"] = columns["time_s"] + 0.004 / RATE * np.sin(np.arange(2000.0))
    log = load_log(write(columns), **NAMES)
    assert 0.003 < log.report.jitter < 0.01


@pytest.mark.parametrize("form", ["10:00:0{}:{:03d}", "2026-03-01 10:00:0{}:{:03d}"])
def test_a_colon_before_the_milliseconds(load, form):
    table = columns(1000)
    ticks = np.round(1000 * table["time_s"]).astype(int)
    table["time_s"] = [form.format(t // 1000, t % 1000) for t in ticks]
    log = load(table)
    assert log.sample_rate == pytest.approx(RATE, rel=1e-6)
    assert np.allclose(log.y, table["position_rad"])


def test_rows_that_were_shuffled_are_one_run_and_two_runs_are_two(load):
    table = columns(1000)
    order = np.random.default_rng(0).permutation(1000)
    with pytest.warns(LogWarning, match="all are of one even run"):
        log = load({k: v[order] for k, v in table.items()})
    assert log.groups.max() == 0
    np.testing.assert_allclose(log.y, table["position_rad"], atol=1e-9)
    other = table | {"torque_nm": -table["torque_nm"], "position_rad": -table["position_rad"]}
    with pytest.warns(LogWarning, match="time jumps back"):
        assert load({k: np.r_[v, other[k]] for k, v in table.items()}).groups.max() == 1


@pytest.mark.filterwarnings("ignore::whsklearn.logs.LogWarning")
def test_a_freeze_is_filled_where_the_signals_pass_over_it_and_cuts_where_they_do_not(load):
    """A logger that stops for 20 ms in every 0.9 s left segments of 0.9 s, too short for a diagnosis."""
    t = np.arange(6000) / 500
    table = {"time_s": t, "torque_nm": np.cos(2 * t) + np.sin(5 * t), "position_rad": np.sin(2 * t)}
    there = t % 0.9 > 0.02
    log = load({k: v[there] for k, v in table.items()})
    assert log.groups.max() == 0
    rows = slice(round(500 * t[there][0]), None)
    assert np.abs(log.y - table["position_rad"][rows][: log.y.size]).max() < 1e-6
    assert np.abs(log.X[:, 0] - table["torque_nm"][rows][: log.y.size]).max() < 0.01
    assert any("13 hole(s) of up to 0.024 s were filled" in f.explanation for f in log.report.findings)
    table["torque_nm"] = np.random.default_rng(0).normal(size=t.size)
    assert load({k: v[there] for k, v in table.items()}).groups.max() == 13
    table["torque_nm"] = np.cos(2 * t) + np.sin(5 * t)
    there = np.abs(t - 6.0) > 0.8
    assert load({k: v[there] for k, v in table.items()}).groups.max() == 1


@pytest.mark.parametrize("unit", [1.0, 1e3, 1e6])
def test_the_time_of_day_goes_on_over_midnight(load, unit):
    table = columns(1000)
    table["time_s"] = (
        np.round((86397.0 + table["time_s"]) * unit) % (86400 * unit)
        if unit > 1
        else ((86397.0 + table["time_s"]) % 86400)
    )
    name = {1.0: "time_s", 1e3: "time_ms", 1e6: "time_us"}[unit]
    log = load({name if k == "time_s" else k: v for k, v in table.items()}, time=name)
    assert log.groups.max() == 0
    assert log.sample_rate == pytest.approx(RATE, rel=1e-6)


def test_a_zone_behind_the_date_is_no_part_of_it(load):
    table = columns(300)
    stamps = pd.Timestamp("2026-05-21 10:00") + pd.to_timedelta(table["time_s"], unit="s")
    table["time_s"] = stamps.strftime("%Y-%m-%d %H:%M:%S.%f CEST")
    assert load(table).sample_rate == pytest.approx(RATE, rel=1e-6)


@pytest.mark.parametrize("day", ["2026-01-02", "2026-01-12", "2026-01-31", "2026-06-11"])
@pytest.mark.parametrize("form", ["%m/%d/%Y %H:%M:%S.%f", "%d/%m/%Y %H:%M:%S.%f", "%d.%m.%Y %H:%M:%S,%f"])
def test_dates_go_on_over_midnight_whichever_of_day_and_month_comes_first(form, day):
    stamps = pd.Timestamp(f"{day} 23:59:59.5") + pd.to_timedelta(np.arange(100) * 0.01, unit="s")
    seconds, _ = to_seconds(stamps.strftime(form).to_numpy(dtype=object), "s", "Time")
    np.testing.assert_allclose(seconds, np.arange(100) * 0.01, atol=1e-9)


@pytest.mark.parametrize("form", ["%I:%M:%S.%f %p", "%b %d %Y %H:%M:%S.%f"])
def test_times_may_be_of_a_half_day_and_months_may_be_words(form):
    stamps = pd.Timestamp("2026-03-28 11:59:59.5") + pd.to_timedelta(np.arange(100) * 0.01, unit="s")
    seconds, _ = to_seconds(stamps.strftime(form).to_numpy(dtype=object), "s", "Time")
    np.testing.assert_allclose(seconds, np.arange(100) * 0.01, atol=1e-9)


@pytest.mark.parametrize("sign", ":;")  # RSTrendX writes a semicolon
@pytest.mark.parametrize("digits", [3, 4, 6, 7])
def test_a_fraction_behind_a_third_colon_is_a_fraction_of_the_second(digits, sign):
    stamps = np.array([f"14:02:07{sign}{k * 10 ** (digits - 2):0{digits}d}" for k in (0, 1, 25)])

    seconds, _ = to_seconds(stamps, "s", "Time")
    np.testing.assert_allclose(seconds, [0.0, 0.01, 0.25], atol=1e-9)


def jittered(count, jitter, seed, samples):
    """Stamps, and the position of a fast sweep at them (`samples`) or at the even times that they should have had."""
    rng = np.random.default_rng(seed)
    times = np.arange(3000) / RATE
    stamps = times + jitter / RATE * rng.uniform(-0.5, 0.5, times.size)
    at = stamps if samples else times
    position = 5 * np.sin(6 * at) + 2 * np.sin(15 * at + 1)
    return stamps, times, np.round(position / count) * count


@pytest.mark.parametrize("jitter", [0.03, 0.1, 0.3])
@pytest.mark.parametrize("seed", [0, 1])
def test_stamps_that_jitter_more_than_the_samples_are_replaced_by_rows(jitter, seed):
    stamps, times, position = jittered(1e-4, jitter, seed, samples=False)
    done = even(stamps, {"position": position, "drive": np.cos(times)}, np.zeros(3000, dtype=np.int64))
    assert np.array_equal(done.signals["position"], position)
    assert np.ptp(done.time - times) < 5 * jitter / RATE / np.sqrt(3000)  # the error of a line's slope
    assert "smoother by rows" in done.finding.explanation


@pytest.mark.parametrize("jitter", [0.03, 0.1, 0.3])
@pytest.mark.parametrize("count", [1e-4, 0.01, 0.3])
@pytest.mark.parametrize("seed", [0, 1])
def test_samples_that_jitter_keep_their_stamps(jitter, count, seed):
    """Also where the steps of the encoder drown the jitter."""
    stamps, _, position = jittered(count, jitter, seed, samples=True)
    done = even(stamps, {"position": position, "drive": np.cos(stamps)}, np.zeros(3000, dtype=np.int64))
    assert "Onto an even grid" in done.finding.explanation


@pytest.mark.parametrize("rate", [50, 100, 200, 500, 1000])
@pytest.mark.parametrize("digits", [12, 15])
def test_days_of_a_spreadsheet_are_read_in_as_many_digits_as_it_saves(tmp_path, rate, digits):
    # Of a day after 2023, twelve digits resolve 9 ms and fifteen 9 us.
    n = 8 * rate
    t = np.arange(n) / rate
    rows = zip((45000.5 + t / 86400).tolist(), np.sin(3 * t).tolist(), np.cos(2 * t).tolist(), strict=True)
    text = "Time,torque_nm,position_rad\n" + "".join(f"{d:.{digits}g},{u:.9f},{q:.9f}\n" for d, u, q in rows)
    (tmp_path / "days.csv").write_text(text)
    with pytest.warns(LogWarning) if digits == 12 else nullcontext():
        log = load_log(tmp_path / "days.csv", time="Time", drive="torque_nm", position="position_rad")
    assert log.sample_rate == pytest.approx(rate, rel=1e-4)
    assert len(log.y) == n
    assert np.allclose(log.y, np.cos(2 * t), rtol=0, atol=1e-8)  # rows as logged, none interpolated
