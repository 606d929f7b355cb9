"""Minima that no descent leaves are left by a pole where one is missing, or a zero across the unit circle."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from whsklearn.effects import as_law
from whsklearn.recursion.batch import wrong_minimum
from whsklearn.recursion.batch.simulation_error import FittedChain, refine
from whsklearn.recursion.batch.simulation_search import record
from whsklearn.recursion.batch.wrong_minimum import improved

LAW = as_law("cubic_spline")
A1, A2 = np.poly([0.9 * np.exp(0.5j), 0.9 * np.exp(-0.5j)]).real, np.poly([0.7, -0.5]).real
B1, B2 = np.array([1.0, 0.6, 0.0]), np.array([1.0, -2.2, 0.6])


def saturated(noise=0.05, n=3000, b1=B1, b2=B2):
    rng = np.random.default_rng(3)
    u = rng.standard_normal(n)
    x = lfilter(b1, A1, u)
    clean = lfilter(b2, A2, np.tanh(1.5 * x / np.std(x)))
    y = clean + noise * np.std(clean) * rng.standard_normal(n)
    data = record(u[:, None], y, np.arange(n) == 0)
    return data, (noise * np.std(clean)) ** 2 * data.counts.sum()


def start(b1, a1, b2, a2):
    return FittedChain(b1[None, :], a1, b2, a2, LAW, LAW.weights)


@pytest.mark.parametrize(
    "wrong",
    [
        start(B1, A1, np.array([1.0, -0.5, 0.1]), A2),
        start(np.array([1.0, 0.2]), np.array([1.0, -0.7]), B2, A2),
        start(B1, A1, np.array([1.0, 0.2]), np.array([1.0, -0.5])),
    ],
    ids=["a zero inside the circle", "a resonance missing before the law", "a pole missing behind it"],
)
def test_it_ends_at_the_noise(wrong):
    data, noise = saturated()
    assert improved(refine(wrong, data, 40), data).cost < 1.05 * noise


@pytest.mark.parametrize(
    ("true", "wrong"),
    [(([0.0, -0.6], [1.88, 0.32]), ([0.0, -0.6], [0.25 + 0.2j, 0.25 - 0.2j])),
     (([1.67, -0.15], [-1.47, 0.57]), ([0.67, 0.4], [2.37, 0.05]))],
    ids=["of the first block", "of the second"],
)  # fmt: skip
def test_a_zero_crosses_the_circle_without_a_further_pole(monkeypatch, true, wrong):
    """The one that has to cross is not the one that began on the wrong side."""
    monkeypatch.setattr(wrong_minimum, "missing_poles", lambda *_: [])
    (b1, b2), (c1, c2) = ([np.poly(zeros).real for zeros in blocks] for blocks in (true, wrong))
    data, noise = saturated(b1=b1, b2=b2)
    fitted = refine(start(c1, A1, c2, A2), data, 40)
    assert fitted.cost > 2.0 * noise
    assert improved(fitted, data).cost < 1.05 * noise


def test_what_is_right_stays():
    data, _ = saturated()
    fitted = refine(start(B1, A1, B2, A2), data, 40)
    assert improved(fitted, data) is fitted


def test_it_never_ends_worse():
    data, _ = saturated(n=800)
    for seed in range(4):
        rng = np.random.default_rng(seed)
        fitted = refine(start(rng.standard_normal(2), A2[:2], rng.standard_normal(3), A2), data, 5)
        assert improved(fitted, data).cost <= fitted.cost


def test_two_gains_about_a_law_have_no_move():
    data, _ = saturated(n=800)
    one = np.ones(1)
    data = data._replace(y=np.tanh(data.u[0]) + 0.1 * np.random.default_rng(0).standard_normal(800))
    fitted = refine(start(one, one, one, one), data, 10)
    assert improved(fitted, data) is fitted
