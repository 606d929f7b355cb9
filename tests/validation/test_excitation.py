"""Theorem 1's condition: its eigenvalues, and the names of what the data cannot show."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from whsklearn.validation import excitation


def delays(u, n):
    """Regressors u(t-1) ... u(t-n) of a record at rest before its start."""
    return np.column_stack([np.r_[np.zeros(k), u[:-k]] for k in range(1, n + 1)])


@pytest.mark.parametrize("p", [1, 2, 5])
def test_alpha_and_beta_are_those_of_the_double_sum(p):
    phi = np.random.default_rng(0).normal(size=(30, 3))
    total = np.zeros((3, 3))
    for j in range(30):
        for k in range(max(j - p + 1, 0), j + 1):
            total += np.outer(phi[k], phi[k])
    eigenvalues = np.linalg.eigvalsh(total / 30)
    found = excitation(phi, p=p)
    assert (found.alpha, found.beta) == pytest.approx((eigenvalues[0], eigenvalues[-1]), rel=1e-9)


@given(st.integers(0, 10_000), st.floats(-6, 6))
@settings(max_examples=40)
def test_rank_and_condition_know_no_units(seed, exponent):
    rng = np.random.default_rng(seed)
    phi = rng.normal(size=(40, 4))
    phi[:, 3] = phi[:, 0] - phi[:, 1] if seed % 2 else phi[:, 3]
    scaled = phi * np.array([1.0, 10.0**exponent, 1.0, 10.0**-exponent])
    a, b = excitation(phi), excitation(scaled)
    assert a.rank == b.rank == (3 if seed % 2 else 4)
    assert a.unseen == b.unseen == (("theta[0]", "theta[1]", "theta[3]") if seed % 2 else ())


@pytest.mark.parametrize("n_sines", [1, 2, 3])
def test_a_sum_of_sines_excites_twice_as_many_directions(n_sines):
    t = np.arange(2000)
    u = sum(np.sin(w * t) for w in (0.3, 1.1, 2.2)[:n_sines])
    found = excitation(delays(u, 8)[8:])
    assert found.rank == 2 * n_sines
    assert not found.persistent
    assert excitation(delays(u, 2 * n_sines)[8:]).persistent


def test_white_noise_excites_all_and_says_nothing():
    u = np.random.default_rng(1).normal(size=5000)
    found = excitation(delays(u, 6))
    assert found.persistent
    assert found.advice == ""
    assert found.condition < 1.2
    assert (found.alpha, found.beta) == pytest.approx((1, 1), abs=0.1)


def test_the_advice_names_the_parameters():
    u = np.random.default_rng(2).normal(size=500)
    phi = np.c_[u, np.roll(u, 3), -2 * u, np.zeros(500), np.roll(u, 1)]
    found = excitation(phi, names=["a2", "b1", "b2", "stribeck", "d1"])
    assert "nothing about stribeck and only combinations of a2 with b2 (3 of 5" in found.advice
    assert found.rank == 3
    assert found.unseen == ("a2", "b2", "stribeck")
    assert found.alpha == pytest.approx(0, abs=1e-9)
    assert found.condition == np.inf or found.condition > 1e12
    pair = next(d for d in found.directions if len(d) == 2)
    assert set(pair) == {"a2", "b2"}
    assert abs(pair["a2"] + pair["b2"]) == pytest.approx(0, abs=1e-9) or abs(pair["a2"]) == pytest.approx(2**-0.5)


def test_two_independent_confusions_are_told_apart():
    rng = np.random.default_rng(3)
    a, b, c = rng.normal(size=(3, 300))
    found = excitation(np.c_[a, b, a, b, c], names=list("abcde"))
    assert {frozenset(d) for d in found.directions} == {frozenset("ac"), frozenset("bd")}
    assert found.unseen == ("a", "b", "c", "d")


def test_nothing_at_all_and_fewer_samples_than_parameters():
    dead = excitation(np.zeros((10, 3)))
    assert (dead.rank, dead.alpha, dead.beta, dead.condition) == (0, 0, 0, np.inf)
    assert len(dead.unseen) == 3
    few = excitation(np.random.default_rng(4).normal(size=(2, 5)))
    assert few.rank == 2
    assert few.alpha == pytest.approx(0, abs=1e-12)


def test_long_records_and_large_units_cost_neither_memory_nor_overflow():
    phi = np.random.default_rng(5).normal(size=(100_000, 2)) * 1e200
    found = excitation(phi)
    assert found.rank == 2


@pytest.mark.parametrize(
    ("phi", "kwargs", "said"),
    [
        (np.ones(3), {}, "shape"),
        (np.ones((0, 3)), {}, "shape"),
        ([[np.nan]], {}, "NaN"),
        ([["x"]], {}, "not numbers"),
        (np.ones((3, 2)), {"names": ["a"]}, "1 names for 2"),
        (np.ones((3, 2)), {"p": 0}, "p is 0"),
        (np.ones((3, 2)), {"p": 1.5}, "p is 1.5"),
    ],
)
def test_bad_input_is_refused(phi, kwargs, said):
    with pytest.raises(ValueError, match=said):
        excitation(phi, **kwargs)
