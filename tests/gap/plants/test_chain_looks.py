"""Looks of a chain: columns, own records, functions without a name, signs that are wrong."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from tests.gap.plants.example_chain import PLAIN, TRUE, kind, record, term
from whsklearn.effects import Backlash, Cogging, ParameterChange, as_law
from whsklearn.gap.plants import chain_looks as looks
from whsklearn.gap.plants.chain_fit import coloured, polished
from whsklearn.gap.plants.chain_model import catalogue, simulate

RNG = np.random.default_rng


@pytest.fixture(scope="module")
def base():
    return polished(PLAIN, coloured(PLAIN, TRUE))


def seen(*effects, seed=0):
    s = record(*effects, seed=seed)
    return looks.look(s, polished(s, coloured(s, TRUE)), RNG(1))


@pytest.mark.parametrize("name", ["cogging", "quadratic_drag", "output_drift", "torque_ripple"])
def test_a_column_is_what_a_small_effect_does(base, name):
    e = looks.cm.left(PLAIN, base)[PLAIN.fit]
    scene = looks.Softened.of(PLAIN, base, looks.SLOPED, e, np.zeros((0, e.size)))
    k = kind(name)
    shape = k.shapes(scene.sizes)[0]
    columns = scene.columns(k, [shape])[:, 0, :]
    q = (*(1e-6 * np.ones(k.linear)), *shape)
    change = simulate(PLAIN, base.with_term(term(name, *q)), scene.kappa)[2] - scene.run[2]
    np.testing.assert_allclose(1e-6 * columns.sum(axis=1), scene.seen(change), rtol=1e-2, atol=1e-10)


def test_nothing_is_seen_where_nothing_is_missing():
    found = [seen(seed=s) for s in range(3)]
    assert min(f.p_value for f in found) > 1e-3
    assert max(f.share for f in found) < 0.03


def test_what_is_missing_is_seen_first_and_by_functions_without_a_name_too():
    found = seen(Cogging(0.1, 0.9, 0.4))
    first = min((k for k in found.looks if k.name), key=lambda k: k.p_value)
    assert first.name == "cogging"
    assert first.start.q[2] == pytest.approx(0.9, abs=0.2)
    assert found.p_value < 1e-6
    assert found.share > 0.1


def test_a_square_change_in_time_is_seen_without_a_name():
    assert min(k.p_value for k in seen(ParameterChange(0.1, 450.0, "coulomb")).looks if not k.name) < 1e-3


def test_a_small_play_shows_in_reversals_that_are_missed():
    s = record(Backlash(0.1))
    e, null = looks.cm.left(s, coloured(s, TRUE))[s.fit], looks.own_errors(s, coloured(s, TRUE), RNG(0))
    found = looks.reversals(e, null)
    assert found.gain > 3.0 * found.null.mean() + 5.0


def test_own_errors_have_the_size_of_what_is_left(base):
    null = looks.own_errors(PLAIN, base, RNG(0))
    e = looks.cm.left(PLAIN, base)[PLAIN.fit]
    assert null.shape == (looks.N_NULL, e.size)
    assert np.std(null) == pytest.approx(np.std(e), rel=0.1)


def test_an_excess_over_dry_friction_needs_dry_friction():
    assert "stribeck" in {c.name for c in catalogue(as_law(None))}
    dry = dataclasses.replace(PLAIN, law=as_law("viscous"))
    assert "stribeck" not in {c.name for c in looks.kinds(dry, TRUE)}


def test_a_chain_has_one_play_at_a_port_but_may_have_two_waves():
    m = TRUE.with_term(term("backlash", 0.1, at="middle")).with_term(term("disturbance_tone", 0.1, 0.0, 0.1, at="law"))
    ports = {(c.name, c.at) for c in looks.kinds(PLAIN, m)}
    assert ("backlash", "middle") not in ports
    assert {("backlash", "input"), ("disturbance_tone", "law"), ("saturation", "input")} <= ports
