"""What of a log a diagnosis takes: its longest segment, and of a very long one the liveliest part."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from sklearn.utils import Bunch

from whsklearn.cli import records
from whsklearn.logs import load_log
from whsklearn.logs.errors import LogError


def log(n, groups=None):
    time = np.arange(n) / 100.0
    y = np.where(time < 20.0, 0.01, 1.0) * np.sin(7.0 * time)
    groups = np.zeros(n, dtype=int) if groups is None else groups
    return Bunch(
        X=y[:, None], y=y, time=time, reference=None, command=None, groups=groups, frame=None, notes=(), name="a"
    )


def test_the_longest_segment_comes_with_a_note(capsys):
    part = records.longest(log(100, np.repeat([0, 1, 2], [20, 70, 10])))
    assert "70 of 100 samples" in capsys.readouterr().err
    assert "70 of 100 samples" in part.notes[0]
    np.testing.assert_array_equal(part.time, np.arange(20, 90) / 100.0)


def test_all_segments_are_bridged_unless_a_hole_is_longer_than_the_log():
    whole = log(100, np.repeat([0, 1, 2], [30, 50, 20]))
    whole.sample_rate = 100.0
    whole.time = whole.time + np.repeat([0.0, 0.4, 0.5], [30, 50, 20])
    assert records.bridged(whole) is whole
    whole.time = whole.time + np.repeat([0.0, 3600.0, 3600.0], [30, 50, 20])
    part = records.bridged(whole)
    assert part.y.size == 70
    assert "70 of 100 samples" in part.notes[0]


@pytest.mark.parametrize("n", [3000, 4000])
def test_of_a_long_log_the_part_with_the_most_travel_is_taken(n, monkeypatch):
    monkeypatch.setattr(records, "MOST_ROWS", 1000)
    part = records.liveliest(log(n))
    assert part.y.size == part.time.size == len(part.X) == 1000
    assert part.time[0] >= 19.0  # the axis hardly moves before 20 s
    assert f"1000 of {n} samples" in part.notes[0]


def test_a_log_of_usual_length_is_left_as_it_is():
    whole = log(500)
    assert records.liveliest(whole) is whole
    assert records.longest(whole) is whole


def test_what_was_fitted_is_no_test_in_any_unit():
    rng = np.random.default_rng(0)
    first, other = log(800), log(800)
    for part in (first, other):
        part.units = {"drive": "Nm", "position": "rad"}
        part.X = part.X + 1e-3 * rng.standard_normal(part.X.shape)
    copy = Bunch(**{**first, "name": "b", "units": {"drive": "mNm", "position": "deg"}})
    copy.X, copy.y = 1e3 * first.X, np.rad2deg(first.y)
    records.refuse_shared(first, other)
    with pytest.raises(LogError, match=r"b from 0 to 7\.99 s is a from 0 to 7.99 s, sample by sample"):
        records.refuse_shared(first, copy)


NAMELESS = {"columns": None, "input_column": None, "output_column": None, "time_column": None, "rate": None}


def a_table(folder, names):
    t = np.arange(300) / 100.0
    columns = [t, np.sin(3.0 * t), np.cos(3.0 * t) - 1.0]
    pd.DataFrame(dict(zip(names, columns, strict=True))).to_csv(folder / "a.csv", index=False)
    return folder / "a.csv"


def test_a_system_is_found_by_the_names_of_its_columns_as_an_axis_is(tmp_path, capsys):
    read = records.read_system(a_table(tmp_path, ["time_s", "torque_mNm", "speed_rpm"]), NAMELESS)
    assert read.columns == {"time": "time_s", "drive": "torque_mNm", "position": "speed_rpm"}
    assert read.units == {"time": "s", "drive": "mNm", "position": "rpm"}
    assert read.sample_rate == pytest.approx(100.0)
    assert "'time_s' is taken for the time" in capsys.readouterr().err


def test_what_is_named_by_number_or_by_name_outweighs_what_is_found(tmp_path):
    file = a_table(tmp_path, ["time_s", "torque_nm", "position_rad"])
    named = {**NAMELESS, "input_column": "position_rad", "output_column": "torque_nm"}
    assert records.read_system(file, named).columns["drive"] == "position_rad"
    numbered = records.read_system(file, {**named, "columns": "1,2", "rate": 50.0})
    assert numbered.columns == {"drive": "torque_nm", "position": "position_rad"}
    assert numbered.sample_rate == pytest.approx(50.0)


def test_a_column_that_no_name_tells_is_asked_for_by_an_option_that_there_is(tmp_path):
    with pytest.raises(LogError, match=r"it has: time_s, a, b\. Name it with --drive, or by number with --columns"):
        records.read_system(a_table(tmp_path, ["time_s", "a", "b"]), NAMELESS)


@pytest.mark.parametrize(("limited", "told"), [(False, ["drive", "position"]), (True, ["position"])])
def test_where_a_limit_is_named_a_clipped_position_is_still_told(limited, told, capsys):
    there = [
        Bunch(code=code, explanation=f"{name} stays at its extreme values in 9 samples")
        for code, name in (("LOG005", "drive"), ("LOG005", "position"), ("LOG001", "time"))
    ]
    records.say_clipped(Bunch(name="a.csv", report=Bunch(findings=there)), limited=limited)
    assert [line.split()[1] for line in capsys.readouterr().out.splitlines()] == told


def test_the_origin_says_which_units_are_assumed(tmp_path):
    """A log of PWM had its friction in newtonmetres at the head of the page, and the assumption at its foot."""
    t = np.arange(400) / 100.0
    frame = pd.DataFrame({"time_s": t, "load": np.sin(t), "position_deg": np.cos(t)})
    frame.to_csv(tmp_path / "a.csv", index=False)
    log = load_log(tmp_path / "a.csv", time="time_s", drive="load", position="position_deg")
    assert "drive from 'load', position" in records.origin(log)  # of a chain, nothing is assumed
    records.note_assumed(log)
    told = records.origin(log)
    assert "drive from 'load' (unit not stated, taken as Nm)" in told
    assert "position from 'position_deg' in deg;" in told
