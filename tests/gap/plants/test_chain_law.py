"""Base laws of a chain by name, orders, direct paths, and what a linear base names."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from scipy.signal import lfilter

from whsklearn import WienerHammersteinSystem
from whsklearn.effects import Power
from whsklearn.gap import GapFinder
from whsklearn.gap.plants.chain_law import law_choice


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
    assert finder.effects_[0].effect.place == "law"
    d = finder.diagnosis_
    assert d.closure > 0.9
    y_hat = finder.model_.simulate(frame["u"])
    assert np.std(frame["y"] - y_hat) < 1.5 * d.after["rmse"]


def test_a_free_law_leaves_nothing_of_a_bend_that_no_effect_has():
    frame, _ = static_record(lambda x: np.where(x > 0, x, 0.3 * x) + 0.1 * x**2, noise=0.02)
    settings = {"orders": (2, 2, 2, 1), "direct": 1}
    free = GapFinder("wiener-hammerstein", law="piecewise_linear:10", max_effects=1, **settings)
    assert free.fit(frame).diagnosis_.before["nmse"] < 2e-3
    line = GapFinder("wiener-hammerstein", law="linear", **settings).fit(frame)
    assert line.verdict_ != "named"
    assert "law has another shape" in line.diagnosis_.sentence
