"""Figures of a chain's report: tests of whiteness, gap of a round, floor, options that count, a base too small."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from scipy.signal import butter, lfilter
from scipy.stats import chi2

from benchmarks.blind_logs import wiener_hammerstein as blind
from whsklearn.gap import GapFinder
from whsklearn.gap.plants.chain_noise import quietest_band


@pytest.fixture(scope="module")
def rounds():
    seen = []
    case = blind.make_case("named", 11, effects=("quadratic_drag",), size=0.15, noise=30.0, n=1500)
    finder = GapFinder("wiener-hammerstein", on_round=seen.append).fit(case.frame, **blind.COLUMNS)
    return seen, finder.diagnosis_


def test_ljung_box_is_printed_with_the_p_value_of_its_own_statistic(rounds):
    tests = [t for t in rounds[1].residual_tests if t["test"].startswith("Ljung-Box")]
    assert len(tests) == 2
    for t in tests:
        assert t["p_value"] == pytest.approx(float(chi2.sf(t["statistic"], 20 - 6)), rel=1e-9)  # six of the colour


def test_the_gap_of_a_round_is_an_error_in_the_unit_of_the_output(rounds):
    d = rounds[1]
    one_step = next(h for h in d.horizons if h["horizon"] == 1.0)
    assert d.rounds[0]["gap"] == pytest.approx(one_step["before"], rel=0.25)
    assert d.rounds[0]["gap"] < d.before["rmse"]


def test_every_round_is_told_as_it_ends(rounds):
    seen, d = rounds
    assert [r.taken.name if r.taken else "nothing" for r in seen] == [r["taken"] for r in d.rounds]
    assert len(seen) >= 1


def test_no_floor_lies_above_the_quietest_band_of_the_output():
    rng = np.random.default_rng(0)
    blocks = butter(6, 0.2)  # leaves the upper half of the band to the noise
    y = lfilter(*blocks, rng.normal(size=8000)) + 1e-3 * rng.normal(size=8000)
    assert quietest_band(y) == pytest.approx(1e-3, rel=0.4)


def low_order_record(n=1500, seed=3):
    """A chain of order five under white noise, with the law that the base model has."""
    rng = np.random.default_rng(seed)
    u = rng.normal(size=n)
    b = np.real(np.poly([0.8 * np.exp(1j), 0.8 * np.exp(-1j), 0.6, 0.7 * np.exp(2.2j), 0.7 * np.exp(-2.2j)]))
    x = lfilter([0.0, 1.0, 0.7, -0.4, 0.3], b, u)
    dx = np.diff(x, prepend=0.0)
    v = 0.2 * dx + 0.7 * np.sign(dx) - 0.2 * np.tanh(dx)
    y = lfilter([0.0, 1.0, 0.2], [1.0, 0.15, 0.4], v)
    noise = lfilter([1.0], [1.0, 0.15, 0.4], 0.02 * y.std() * rng.normal(size=n))
    return pd.DataFrame({"u": u, "y": y + noise})


def test_a_base_of_too_low_an_order_is_called_so_and_no_effect_is_invented():
    d = GapFinder("wiener-hammerstein").fit(low_order_record()).diagnosis_
    assert d.verdict == "unknown"
    assert d.effects == []
    assert d.after == d.before
    assert d.closure == 0.0
    assert "linear dynamics" in d.sentence
