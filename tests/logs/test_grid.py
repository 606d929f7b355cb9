"""Jitter and coarse stamps end on an even grid; samples are left as they are where only the stamps are rounded."""

from __future__ import annotations

import numpy as np
import pytest

from tests.logs.rig import NAMES, RATE, columns
from tests.logs.rig import columns as table
from whsklearn.logs import LogWarning, load_log


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
