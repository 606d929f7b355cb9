"""Base laws of a chain by name, orders, direct paths, and what a linear base names."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from scipy.signal import lfilter

from tests.gap.plants.example_chain import PLAIN, TRUE
from whsklearn import WienerHammersteinSystem
from whsklearn.effects import Power
from whsklearn.gap import GapFinder
from whsklearn.gap.plants import chain_law as laws
from whsklearn.gap.plants.chain_fit import base_starts, coloured, cost, minima
from whsklearn.gap.plants.chain_law import REACH, law_choice
from whsklearn.gap.plants.chain_model import Record, free_run, simulate


def static_record(bend, n=1500, seed=5, noise=0.01):
    """u -> second-order block -> a static bend of x -> first-order block with a direct path, by SciPy alone."""
    rng = np.random.default_rng(seed)
    u = rng.normal(size=n)
    x = lfilter([0.0, 1.0, 0.4], [1.0, -0.9, 0.4], u)
    v = bend(x)
    clean = lfilter([1.0, 0.3], [1.0, -0.5], v)
    y = clean + lfilter([1.0], [1.0, -0.5], noise * clean.std() * rng.normal(size=n))
    return pd.DataFrame({"u": u, "y": y}), x


@pytest.mark.parametrize("text", ["linear:x", "polynomial:0", "no_such_law", " , "])
def test_a_law_that_is_none_is_refused_in_one_sentence(text):
    with pytest.raises(ValueError, match=r"law|effect"):
        law_choice(text)


def test_direct_paths_take_a_delay_each():
    rng = np.random.default_rng(0)
    u = rng.normal(size=300)
    blocks = {"a": [1.0, 0.4], "b": [-0.9, 0.4], "c": [1.0, 0.3], "d": [-0.5]}
    law = [Power(1.0, 1.0), Power(0.2, 3.0)]
    x = lfilter(blocks["a"], [1.0, *blocks["b"]], u)
    y = lfilter(blocks["c"], [1.0, *blocks["d"]], x + 0.2 * x**3)
    plain = WienerHammersteinSystem(**blocks, law=law).simulate(u)
    np.testing.assert_allclose(plain[2:], y[:-2], atol=1e-9)
    np.testing.assert_allclose(WienerHammersteinSystem(**blocks, law=law, direct=1).simulate(u)[1:], y[:-1], atol=1e-9)
    np.testing.assert_allclose(WienerHammersteinSystem(**blocks, law=law, direct=2).simulate(u), y, atol=1e-9)


def test_a_linear_base_names_the_saturation_between_its_blocks_and_the_model_has_it():
    limit = 1.2
    frame, x = static_record(lambda x: np.clip(x, -limit, limit))
    assert np.mean(np.abs(x) > limit) > 0.1
    finder = GapFinder("wiener-hammerstein", law="linear", orders=(2, 2, 2, 1), direct=1).fit(frame)
    assert (finder.verdict_, [e.name for e in finder.effects_]) == ("named", ["saturation"])
    assert (finder.effects_[0].effect.at, finder.model_.effects[0].at) == ("middle", "middle")
    assert finder.effects_[0].effect.limit == pytest.approx(limit, rel=0.05)
    d = finder.diagnosis_
    assert d.closure > 0.9
    y_hat = finder.model_.simulate(frame["u"])
    assert np.std(frame["y"] - y_hat) < 1.5 * d.after["rmse"]


def test_a_free_law_leaves_nothing_of_a_bend_that_no_effect_has():
    frame, _ = static_record(lambda x: np.where(x > 0, x, 0.3 * x) + 0.1 * x**2, n=800, noise=0.02)
    settings = {"orders": (2, 2, 2, 1), "direct": 1, "max_effects": 1}
    free = GapFinder("wiener-hammerstein", law="piecewise_linear:10", **settings)
    assert free.fit(frame).diagnosis_.before["nmse"] < 2e-3
    line = GapFinder("wiener-hammerstein", law="linear", **settings).fit(frame)
    assert line.verdict_ != "named"
    assert "law has another shape" in line.diagnosis_.sentence


@pytest.mark.parametrize("more", [1, 2])
def test_more_poles_and_zeros_of_size_zero_change_nothing(more):
    s, m = laws.raised(PLAIN, TRUE, more)
    assert m.theta.size == TRUE.theta.size + 4 * more
    np.testing.assert_allclose(free_run(s, m), free_run(PLAIN, TRUE), atol=1e-12)


def test_a_free_law_of_weight_zero_changes_nothing_and_any_weight_does():
    s, m = laws.freed(PLAIN, TRUE)
    np.testing.assert_allclose(free_run(s, m), free_run(PLAIN, TRUE), atol=1e-12)
    for i in range(6, s.blocks[2].stop):
        theta = m.theta.copy()
        theta[i] = 0.5
        moved = free_run(s, type(m)(theta))
        assert np.abs(moved - free_run(PLAIN, TRUE)).max() > 1e-3


def test_knots_lie_at_the_quantiles_of_x_and_a_law_with_them_explains_as_much():
    frame, _ = static_record(np.tanh)
    choice = law_choice("piecewise_linear:6")
    u, y = (frame[k].to_numpy().copy() for k in ("u", "y"))
    law = choice.first()
    s = Record.of(u, y, 1.0, np.array([2, 2, 2, 1, len(law)]), law)
    start = minima(s, base_starts(s, np.random.default_rng(0)))[0]
    at, (model,) = laws.with_knots(s, start, choice)
    knots = [t.knot for t in at.law.terms if hasattr(t, "knot")]
    np.testing.assert_allclose(knots, np.quantile(simulate(s, start)[0], np.linspace(*REACH, 6)))
    assert int(at.dims[4]) == len(at.law) == 7
    assert cost(at, model) < 1.1 * cost(s, start)


def test_a_pole_too_few_is_told_and_an_effect_is_not_taken_for_it():
    rng = np.random.default_rng(3)
    u = rng.normal(size=1500)
    big = WienerHammersteinSystem([1.0, 0.5], [-1.2, 0.7, -0.1], [1.0], [-0.5, 0.3, -0.2, 0.4])
    y = big.simulate(u, 0.01 * rng.normal(size=u.size))
    law = law_choice(None).first()
    s = Record.of(u, y, 1.0, np.array([2, 1, 1, 2, len(law)]), law)
    base = minima(s, base_starts(s, np.random.default_rng(0)))[0]
    said = laws.falls_short(s, base, base)
    assert "linear dynamics are missing" in said
    assert "orders 2,1,1,2 were given" in said
    assert laws.falls_short(PLAIN, coloured(PLAIN, TRUE), coloured(PLAIN, TRUE)) == ""
