"""The simulator against (1), (2) and (4) written with other tools."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import lfilter

from whsklearn import WienerHammersteinSystem
from whsklearn.effects.law import as_law, polynomial_law, reduced_law, smooth_law
from whsklearn.effects.static import Power
from whsklearn.recursion.memory.starts import random_stable

LAWS = {
    "reduced": reduced_law(),
    "smooth": smooth_law([0.5, 3.0, 0.6, 0.8, 2.0, 0.1]),
    "polynomial": polynomial_law([0.1, 1.0, -0.2]),
}


def drawn(seed, law):
    """A stable system of random orders."""
    rng = np.random.default_rng(seed)
    na, nb, nc, nd = rng.integers([1, 0, 1, 0], 4)
    a, c = np.r_[1.0, rng.normal(size=na - 1)], np.r_[1.0, rng.normal(size=nc - 1)]
    return WienerHammersteinSystem(a, random_stable(nb, rng), c, random_stable(nd, rng), law)


@settings(max_examples=40)
@given(st.integers(0, 10_000), st.sampled_from(list(LAWS)))
def test_the_chain_is_two_filters_about_the_law(seed, law):
    system = drawn(seed, LAWS[law])
    rng = np.random.default_rng(seed + 1)
    u, d = rng.standard_normal((2, 80))
    x = lfilter(np.r_[0.0, system.a], np.r_[1.0, system.b], u)
    v = system.law(x, np.diff(x, prepend=0.0))
    y = lfilter(np.r_[0.0, system.c], np.r_[1.0, system.d], v) + lfilter([1.0], np.r_[1.0, system.d], d)
    got = system.signals(u, d)
    np.testing.assert_allclose(got.x, x, atol=1e-9 * max(1.0, np.abs(x).max()))
    if law != "reduced":  # sign() of a dx that is zero but for rounding may differ
        np.testing.assert_allclose(got.v, v, atol=1e-8 * max(1.0, np.abs(v).max()))
        np.testing.assert_allclose(got.y, y, atol=1e-7 * max(1.0, np.abs(y).max()))
    np.testing.assert_array_equal(got.y, system.simulate(u, d))


def test_example_5_1_sample_by_sample():
    u = np.random.default_rng(0).standard_normal(50)
    x, v, y = np.zeros(52), np.zeros(52), np.zeros(52)
    up = np.r_[0.0, 0.0, u]
    for t in range(2, 52):
        x[t] = up[t - 1] + 2.2 * up[t - 2] - 1.0 * x[t - 1] - 0.5 * x[t - 2]
        dx = x[t] - x[t - 1]
        v[t] = 0.05 * dx + 0.7 * np.sign(dx) - 0.2 * np.tanh(dx)
        y[t] = v[t - 1] + 0.2 * v[t - 2] - 0.15 * y[t - 1] - 0.4 * y[t - 2]
    np.testing.assert_allclose(WienerHammersteinSystem.example().simulate(u), y[2:], atol=1e-13)


def test_it_is_causal_and_answers_two_samples_late():
    system = WienerHammersteinSystem.example()
    u = np.random.default_rng(1).standard_normal(60)
    later = u.copy()
    later[30:] += 1.0
    np.testing.assert_array_equal(system.simulate(u)[:32], system.simulate(later)[:32])
    assert system.simulate(u)[32] != system.simulate(later)[32]


def test_friction_of_the_paper_is_odd():
    system = WienerHammersteinSystem.example()
    u = np.random.default_rng(2).standard_normal(100)
    np.testing.assert_array_equal(system.simulate(-u), -system.simulate(u))


def test_hammerstein_and_wiener_are_the_same_class():
    u = np.random.default_rng(3).standard_normal(40)
    law = polynomial_law([0.0, 1.0, 0.5])
    hammerstein = WienerHammersteinSystem([1.0], [], [1.0, 0.3], [-0.5], law).simulate(u)
    delayed = np.r_[0.0, u[:-1]]
    np.testing.assert_allclose(hammerstein, lfilter([0, 1, 0.3], [1, -0.5], delayed + 0.5 * delayed**2), atol=1e-12)
    wiener = WienerHammersteinSystem([1.0, 0.3], [-0.5], [1.0], [], law).simulate(u)
    x = lfilter([0, 1, 0.3], [1, -0.5], u)
    np.testing.assert_allclose(wiener, np.r_[0.0, (x + 0.5 * x**2)[:-1]], atol=1e-12)


def test_theta_is_in_the_order_of_six():
    g, b1, b2 = 0.05, 1.0, 0.5
    expected = [g, 2.2 * g, g * b1 + g, g * b2, 0.7, 0.2, 0.2, 0.15, 0.4]
    np.testing.assert_allclose(WienerHammersteinSystem.example().theta, expected)


def test_theta_needs_a_linear_term():
    with pytest.raises(ValueError, match="no linear term"):
        _ = WienerHammersteinSystem([1.0], [], [1.0], [], [Power(1.0, 2)]).theta


@pytest.mark.parametrize(
    ("blocks", "says"),
    [
        (([2.0], [], [1.0], []), r"a is \[2.0\], expected it to begin with 1"),
        (([], [], [1.0], []), "expected it to begin with 1"),
        (([1.0], [], [0.5], []), "c is .* divide it by its first"),
        (([1.0], [-1.0], [1.0], []), "b is .* unstable"),
        (([1.0], [], [1.0], [0.0, 1.2]), "d is .* unstable"),
    ],
)
def test_blocks_that_cannot_be_are_refused(blocks, says):
    with pytest.raises(ValueError, match=says):
        WienerHammersteinSystem(*blocks)


def test_an_unknown_law_and_noise_of_another_length_are_refused():
    with pytest.raises(ValueError, match="glue"):
        WienerHammersteinSystem([1.0], [], [1.0], [], law="viscous,glue")
    with pytest.raises(ValueError, match="3 samples and u has 5"):
        WienerHammersteinSystem.example().simulate(np.zeros(5), np.zeros(3))


def test_its_repr_makes_it_again():
    from whsklearn import effects

    system = WienerHammersteinSystem.example()
    names = {"WienerHammersteinSystem": WienerHammersteinSystem} | vars(effects)
    again = eval(repr(system), names)
    u = np.random.default_rng(4).standard_normal(20)
    np.testing.assert_array_equal(again.simulate(u), system.simulate(u))
    assert again.law == as_law(None)
