"""Pictures of a page: made from the series that there are, bytes that depend on them alone, peaks kept."""

from __future__ import annotations

import base64

import numpy as np
import pytest

from whsklearn.effects import Cogging, DisturbanceTone
from whsklearn.gap import Diagnosis, NamedEffect, Place, pictures
from whsklearn.gap.diagnosis import CandidateLine
from whsklearn.gap.pictures import A_PERIOD, DRAWN, bins_of, draw, thinned, titled, waves_of, width_of

T = 0.01 * np.arange(600)


def diagnosis(**more):
    gap = np.sin(T)
    series = {
        "time": T, "measured": gap, "runs": {"before": 0 * T, "after": 0.9 * gap}, "held": T > 3.0,
        "gap_time": T, "gap_before": gap, "gap_after": 0.1 * gap, "usable": T > 0.1, "floor": 0.01,
        "frequency": T, "spectrum": (1 + T, 1 + T), "orders": T[:20], "order_spectrum": (T[:20], T[:20]),
        "axes": {}, "units": ("Nm", "rad"), "what": "missing torque",
    }  # fmt: skip
    return Diagnosis("named", "", pictures=series | more.pop("pictures", {}), **more)


def titles(d):
    return [title for title, _, _ in draw(d)]


def test_a_picture_is_drawn_where_its_series_are_and_left_out_where_not():
    d = diagnosis(candidates=[CandidateLine("cogging", 80.0, 0.9, "named", "accepted")])
    assert titles(d) == ["Simulation and measurement", "The gap over time", "Candidates", "Frequency", "Order"]
    del d.pictures["spectrum"]
    d.pictures["orders"] = T[:3]
    assert titles(d) == ["Simulation and measurement", "The gap over time", "Candidates"]
    more = NamedEffect(Cogging(0.1, 8.0), {}, 0.0, 1.0)
    family = NamedEffect(Cogging(0.3, 4.0), {}, 0.0, 1.0, orders=[more])
    assert "Map over one turn" in titles(diagnosis(effects=[family]))


def test_the_same_series_give_the_same_bytes_and_the_repair_is_a_line_of_its_own():
    one, same = draw(diagnosis()), draw(diagnosis())
    assert one == same
    with_repair = draw(diagnosis(effects=[NamedEffect(Cogging(0.1, 4.0), {}, 0.0, 1.0)]))
    lines = [base64.b64decode(p[0][2]).count(b"<path") for p in (one, with_repair)]
    assert lines[0] < lines[1]


def test_a_thinned_series_keeps_every_peak():
    x = np.zeros(50 * DRAWN)
    x[[7, 99_999]] = 5.0, -3.0
    t, thin, also = thinned(np.arange(x.size), x, 2 * x)
    assert thin.size <= 2 * DRAWN
    assert (thin.max(), thin.min()) == (5.0, -3.0)
    assert t[np.argmax(thin)] == 7
    np.testing.assert_array_equal(also, 2 * thin)
    assert np.all(np.diff(t) >= 0)


@pytest.mark.parametrize(("horizon", "width"), [(0.0, 2.0), (0.05, 0.5), (1.0, 2.0)])
def test_the_overlay_shows_two_seconds_or_ten_restarts(horizon, width):
    assert width_of(Diagnosis("named", "", horizon=horizon)) == pytest.approx(width)


def test_a_log_without_units_has_none_on_its_axes():
    assert (titled("drive", "Nm"), titled("drive", "")) == ("drive (Nm)", "drive")


def test_the_band_of_noise_is_the_floor_that_the_page_states():
    import matplotlib.pyplot as plt

    d = diagnosis(figures=(0.05, 0.005, 0.002))
    figure, axes = plt.subplots()
    pictures._over_time(axes, d)
    (band,) = axes.patches
    rms = float(np.sqrt(np.mean(np.sin(T[T > 0.1]) ** 2)))
    assert band.get_height() == pytest.approx(4 * rms * 0.002 / 0.05)
    plt.close(figure)


@pytest.mark.parametrize(("unit", "turn"), [("rad", 2 * np.pi), ("deg", 360.0)])
@pytest.mark.parametrize("order", [3.0, 24.0])
def test_the_bins_of_a_wave_over_position_follow_its_order(unit, turn, order):
    from matplotlib.figure import Figure

    from whsklearn.gap.pictures import _where

    angle = np.linspace(0.0, 1.0, 6000) * turn
    wave = np.cos(2 * np.pi * order * angle / turn)
    none = np.zeros(0)
    place = Place("position", 0.0, turn, 0.5, 0.5, 0.01, unit, none, none, none)
    series = {
        "axes": {"position": (angle, unit)},
        "usable": np.ones(6000, bool),
        "gap_before": wave,
        "gap_after": 0 * wave,
    }
    effect = NamedEffect(Cogging(1.0, order), {}, 0.0, 1.0)
    axes = Figure().subplots()
    _where(axes, diagnosis(effects=[effect], where=[place], pictures=series))
    line = next(x for x in axes.lines if x.get_label() == "what the repair takes")
    x, y = line.get_data()
    assert x.max() <= turn / order, "one period of it"
    np.testing.assert_allclose(y, np.cos(2 * np.pi * order * x / turn), atol=0.05)


def test_waves_of_a_family_share_a_period_and_the_fastest_sets_the_bins():
    x = np.linspace(0.0, 3.0 * np.pi, 9000)
    edges, period = bins_of(x, [w / (2 * np.pi) for w in (4.002, 24.01, 6.0)])
    assert period == pytest.approx(np.pi, rel=1e-3)
    assert np.diff(edges).max() <= 2 * np.pi / 24 / A_PERIOD * 1.01
    edges, period = bins_of(x, [w / (2 * np.pi) for w in (17.0, 20.3)])  # no period of both within the travel
    assert period == 0.0
    assert (edges[0], edges[-1]) == (0.0, pytest.approx(x[-1]))


def test_a_tone_is_drawn_over_its_own_period():
    place = Place("time", 0.0, 6.0, 0.5, 0.5, 0.01, "s", *[np.zeros(0)] * 3)
    d = diagnosis(effects=[NamedEffect(DisturbanceTone(1.0, 7.0), {}, 0.0, 1.0)], where=[place])
    assert waves_of(d, place) == [7.0]
    assert bins_of(T, [7.0])[1] == pytest.approx(1 / 7)


def test_the_place_of_an_arm_is_that_of_its_joint():
    places = [
        Place(s, 0.0, 6.0, 0.5, 0.5, p, "rad", *[np.zeros(0)] * 3)
        for s, p in (("time", 0.01), ("position of elbow", 0.02))
    ]
    d = diagnosis(effects=[NamedEffect(Cogging(1.0, 7.0), {}, 0.0, 1.0)], where=places)
    assert pictures._shown_axis(d).signal == "position of elbow"
    assert waves_of(d, places[1]) == [7.0 / (2 * np.pi)]
