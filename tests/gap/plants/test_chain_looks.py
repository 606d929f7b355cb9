"""Looks of a chain: who is a candidate, what a look promises, where its refit begins."""

from __future__ import annotations

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest

from tests.gap.plants.example_chain import PLAIN, SCALES, TRUE, kind, setting, term
from whsklearn.effects import Backlash, Cogging, DeadZone, as_law
from whsklearn.gap.evidence import delta_bic_of
from whsklearn.gap.plants.chain_fit import cost, rms_dx
from whsklearn.gap.plants.chain_looks import (
    PARTNERS,
    Start,
    as_looks,
    candidates_for,
    looks_at,
    refined,
    softened,
)
from whsklearn.gap.plants.chain_screening import Screened


def start(name, promise):
    """A candidate that promises so much, with half of its signature its own."""
    one = term(name, *[0.1] * kind(name).n_numbers)
    return Start(Screened(one, 1.0, 0.5, np.empty(0)), TRUE, promise)


def test_an_excess_over_dry_friction_needs_dry_friction():
    names = {c.name for c in candidates_for(PLAIN, TRUE)}
    assert "stribeck" in names  # the law of the example has it
    dry = dataclasses.replace(PLAIN, law=as_law("viscous"))
    assert "stribeck" not in {c.name for c in candidates_for(dry, TRUE)}
    assert "stribeck" in {c.name for c in candidates_for(dry, TRUE.plus(term("coulomb", 0.1)))}


def test_an_axis_has_one_play_and_one_limit_but_may_have_two_waves():
    m = TRUE.plus(term("backlash", 0.1)).plus(term("cogging", 0.1, 0.0, 3.0))
    names = {c.name for c in candidates_for(PLAIN, m)}
    assert "backlash" not in names
    assert {"saturation", "cogging"} <= names


@pytest.mark.parametrize(("name", "promise"), [("quadratic_drag", 50.0), ("cogging", 120.0), ("backlash", 0.0)])
def test_a_gain_is_the_share_that_gives_the_promised_evidence(name, promise):
    n = 500
    (look,) = [k for k in as_looks([], [start(name, promise)], n) if k.name == name]
    of_gain = delta_bic_of(n, 1.0, 1.0 - look.gain, look.n_numbers, look.n_looks)
    assert of_gain == pytest.approx(promise, abs=1e-6)


def test_a_variant_begins_from_two_starts_at_the_most_the_most_promising_first():
    starts = [start("dead_zone", p) for p in (20.0, 60.0, 40.0)]
    promised = [k.start.promise for k in as_looks([], starts, 500) if k.name == "dead_zone"]
    assert promised == [60.0, 40.0]


@pytest.mark.parametrize(("name", "partner"), PARTNERS.items())
def test_near_neighbours_are_both_tried(name, partner):
    starts = [start(name, 80.0), start(partner, -3.0)]
    looks = {k.name: k for k in as_looks([], starts, 500)}
    assert looks[partner].start is not None
    assert looks[partner].gain < looks[name].gain


def test_what_the_models_own_numbers_can_make_is_told_and_not_tried():
    hidden = SimpleNamespace(name="viscous", left=1e-3, term=SimpleNamespace(kind=kind("viscous")))
    (look,) = as_looks([hidden], [start("viscous", 50.0)], 500)
    assert (look.gain, look.start, look.expected) == (0.0, None, 0.0)


def test_a_softened_sign_is_no_sharper_than_it_says_and_a_soft_one_stays():
    sharp = softened(PLAIN, TRUE)
    assert sharp.kappa * rms_dx(PLAIN, TRUE) == pytest.approx(30.0)
    soft = TRUE.at(1.0 / rms_dx(PLAIN, TRUE))
    assert softened(PLAIN, soft).kappa == soft.kappa


@pytest.mark.parametrize(
    ("effect", "size"),
    [(DeadZone(0.3), 0.3), (Backlash(0.5), 0.5), (Cogging(0.3, 4.0, 0.4), 0.3)],
    ids=["dead zone", "play", "cogging"],
)
def test_the_hidden_effect_looks_best_and_its_refit_finds_its_size(effect, size):
    s = setting(effect)
    looks = [k for k in looks_at(s, TRUE, SCALES, quick=False) if k.start is not None]
    best = max(looks, key=lambda k: k.gain)
    assert best.name == effect.name
    model, value = refined(s, best.start, SCALES)
    last = model.terms[-1]
    assert value < 0.8 * cost(s, TRUE)
    assert np.linalg.norm(last.q[: max(last.kind.linear, 1)]) == pytest.approx(size, rel=0.15)
