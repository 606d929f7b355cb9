"""A gap is found where it was put, and nowhere if it follows nothing."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.blind_logs.servo import COLUMNS, make_case
from whsklearn.gap import GapFinder
from whsklearn.gap.localisation import Bins, drift_sentence, locate, order_spectrum

RNG = np.random.default_rng(0)
N = 8000
POSITION = np.sin(np.arange(N) / 700) + 0.3 * np.sin(np.arange(N) / 90)
AXES = {"position": (POSITION, "rad"), "drive": (RNG.normal(size=N), "Nm")}


def test_a_bump_in_one_place_is_found_there():
    gap = 0.05 * RNG.normal(size=N) + np.where(np.abs(POSITION - 0.4) < 0.1, 1.0, 0.0)
    first = locate(AXES, gap, np.random.default_rng(1))[0]
    assert first.signal == "position"
    assert first.low < 0.4 < first.high
    assert first.p_value < 0.05
    assert first.share > 2 * first.width


def test_noise_follows_no_signal_more_often_than_it_may():
    worst = [
        min(p.p_value for p in locate(AXES, np.random.default_rng(s).normal(size=N), np.random.default_rng(s)))
        for s in range(20)
    ]
    assert sum(p < 0.05 for p in worst) <= 4


def test_p_values_are_level_for_dependent_samples_and_small_for_a_gap_that_follows():
    rng = np.random.default_rng(1)
    n, hits = 1500, 0
    x = np.sin(np.arange(n) * 0.05) + 0.2 * np.cumsum(rng.standard_normal(n)) / np.sqrt(n)
    for _ in range(60):
        gap = np.convolve(rng.standard_normal(n + 20), np.ones(21), mode="valid")
        hits += locate({"position": (x, "rad")}, gap, rng)[0].p_value <= 0.05
    assert hits <= 9
    assert locate({"position": (x, "rad")}, np.cos(3 * x) + 0.3 * rng.standard_normal(n), rng)[0].p_value < 0.02


def test_a_spectrum_by_order_is_the_projection_on_each_wave():
    rng = np.random.default_rng(4)
    angle, orders = np.cumsum(rng.standard_normal(3000)), np.arange(0.5, 160.0, 0.1)
    gap = 0.7 * np.cos(12.0 * angle + 0.3) + rng.standard_normal(3000)
    found = order_spectrum(gap, angle, orders)
    for i in (0, 1, 700, orders.size - 1):
        direct = 2.0 * abs(np.mean(gap * np.exp(-1j * orders[i] * angle)))
        assert abs(found[i] - direct) < 1e-10
    assert orders[np.argmax(found)] == pytest.approx(12.0)
    assert found.max() == pytest.approx(0.7, abs=0.1)


SHORT = {"seconds": 16.0, "rate": 500.0, "noise": 1e-4}


def test_a_friction_that_drifts_moves_with_time():
    case = make_case("named", 41, effects=("friction_drift",), size=0.1, **SHORT)
    d = GapFinder("servo").fit(case.frame, **COLUMNS).diagnosis_
    first = d.drifting[0]
    assert (first["name"], first["follows"]) == ("coulomb", "time")
    assert first["taken"] > 0.5
    assert "coulomb" in drift_sentence(d.drifting)


def test_a_constant_signal_is_one_bin():
    assert Bins(np.ones(50)).count.tolist() == [50]


def test_a_constant_that_was_lost_has_no_share_of_itself():
    lost = {"name": "inertia", "mean": 6e-8, "spread": 4e5, "taken": 0.66, "follows": "reversal", "share": 0.96}
    assert "changes by more than itself, 96 %" in drift_sentence([lost])


def test_constants_stay_constant_where_nothing_is_missing():
    case = make_case("none", 42, **SHORT)
    d = GapFinder("servo").fit(case.frame, **COLUMNS).diagnosis_
    assert all(r["taken"] < 0.1 and r["spread"] < 0.02 for r in d.drifting)
    assert drift_sentence(d.drifting) == ""


def test_false_alarms_of_dependent_paths_stay_at_their_level():
    rng = np.random.default_rng(0)
    x = np.sin(np.arange(3000) / 90)
    hits = 0
    for _ in range(60):
        path = np.convolve(rng.standard_normal(3200), np.ones(100) / 10, mode="valid")[:3000]
        hits += Bins(x).chance((path,), rng, along_time=False)[1] < 0.05
    assert hits <= 9  # 3 expected; 10 or more has a probability below 0.1 %
