"""Candidates of a chain: an effect of a user's own is simulated at its port, searched, named, handed back."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import pandas as pd
import pytest

from tests.gap.plants.example_chain import PARTS, PLAIN, TRUE, U, term
from whsklearn import WienerHammersteinSystem
from whsklearn.effects import Effect, Quantity
from whsklearn.effects import base as catalogue
from whsklearn.gap import GapFinder
from whsklearn.gap.plants.chain import ChainPlant
from whsklearn.gap.plants.chain_candidates import BENDS, CATALOGUE, own_candidates
from whsklearn.gap.plants.chain_law import law_choice
from whsklearn.gap.plants.chain_model import Term, free_run


@pytest.fixture
def bump():
    """An effect that is in the catalogue for one test."""

    @dataclass(frozen=True)
    class Bump(Effect):
        torque: float = 0.1
        centre: float = 0.0
        width: float = 1.0
        name: ClassVar[str] = "bump"
        place: ClassVar[str] = "position"
        equation: ClassVar[str] = "c exp(-((q - q0)/w)^2)"
        size: ClassVar[str] = "torque"
        quantities: ClassVar[dict[str, Quantity]] = {
            "torque": Quantity("Nm", -10.0, 10.0),
            "centre": Quantity("rad", -20.0, 20.0, span=(-1.0, 1.0)),
            "width": Quantity("rad", 0.01, 20.0, log=True, span=(0.05, 0.5)),
        }

        @staticmethod
        def evaluate(p, time, position, velocity, drive):
            return p[0] * math.exp(-(((position - p[1]) / p[2]) ** 2))

    yield Bump
    catalogue._REGISTRY.pop("bump")


def test_it_is_added_behind_the_first_block(bump):
    u = np.random.default_rng(0).normal(size=200)
    with_it = WienerHammersteinSystem(**PARTS, effects=[bump(0.5, 1.0, 0.8)])
    plain = WienerHammersteinSystem(**PARTS).signals(u)
    got = with_it.signals(u)
    np.testing.assert_allclose(got.x, plain.x)
    np.testing.assert_allclose(got.v - plain.v, 0.5 * np.exp(-(((plain.x - 1.0) / 0.8) ** 2)), atol=1e-12)


def test_what_its_class_says_of_the_search_counts(bump):
    kind = next(k for k in own_candidates() if k.name == "bump")
    assert [kind.is_free(i) for i in range(3)] == [True, True, True]
    assert kind.scanned == 1
    bump.held, bump.aliases, bump.commoner = ("centre",), ("end_stop",), ("cable_spring",)
    bump.quantities["width"] = Quantity("rad", 0.01, 20.0, log=True, scan="step")
    kind = next(k for k in own_candidates() if k.name == "bump")
    assert [kind.is_free(i) for i in range(3)] == [True, False, True]
    assert kind.scanned > 1
    plant = ChainPlant(np.zeros(9), np.zeros(9), (law_choice(None), (2, 2, 2, 2), 0), tolerance=0.004)
    assert (plant.aliases("bump"), plant.commoner("bump")) == (("end_stop",), ("cable_spring",))
    assert plant.aliases("end_stop") == ()


def test_it_is_named_where_it_is_and_not_where_it_is_not(bump):
    rng = np.random.default_rng(1)
    u = rng.normal(size=1500)
    hidden = WienerHammersteinSystem(**PARTS, effects=[bump(0.6, 2.0, 1.5)])
    y = hidden.simulate(u, 0.02 * rng.normal(size=u.size))
    finder = GapFinder("wiener-hammerstein").fit(pd.DataFrame({"u": u, "y": y}))
    assert (finder.verdict_, [e.name for e in finder.effects_]) == ("named", ["bump"])
    assert finder.effects_[0].effect.labelled()["torque"] == pytest.approx(0.6, rel=0.1)
    assert [e.name for e in finder.model_.effects] == ["bump"]
    y = WienerHammersteinSystem(**PARTS).simulate(u, 0.02 * rng.normal(size=u.size))
    assert GapFinder("wiener-hammerstein").fit(pd.DataFrame({"u": u, "y": y})).verdict_ == "no_gap"


@pytest.mark.parametrize(
    "fitted",
    [
        term("cogging", 0.1, -0.2, 0.6), term("quadratic_drag", 0.1), term("dead_zone", 0.2),
        term("output_offset", 0.3),
        term("backlash", 0.3), term("position_friction", 0.1, 0.1, 0.7), term("hardening_spring", 0.01, 0.0),
        term("presliding_hysteresis", 0.2, 0.8), term("actuator_lag", 0.8), term("disturbance_tone", 0.1, 0.2, 0.05),
        term("encoder_eccentricity", 0.05, 0.02, 0.9), term("parameter_change", 0.1, 300.0),
    ],
    ids=lambda t: t.name,
)  # fmt: skip
def test_the_librarys_system_runs_as_the_fitted_model_does(fitted):
    system = WienerHammersteinSystem(**PARTS, effects=[fitted.kind.of_library(fitted.q)])
    np.testing.assert_allclose(system.simulate(U), free_run(PLAIN, TRUE.plus(fitted)), atol=1e-9)


def test_a_wave_is_told_by_amplitude_and_phase():
    told = term("cogging", 3.0, -4.0, 0.6).effect.labelled()
    assert told == {"amplitude": 5.0, "phase": pytest.approx(np.arctan2(4.0, 3.0)), "order": 0.6}


def test_ports_that_only_a_chain_has_are_handed_on_too():
    coupling = term("flexible_coupling", 0.1, 0.2)
    at_input = Term(next(k for k in CATALOGUE if k.variant == "at the input"), (0.1, 0.1, 0.05))
    for fitted in (coupling, at_input):
        system = WienerHammersteinSystem(**PARTS, effects=[fitted.kind.of_library(fitted.q)])
        np.testing.assert_allclose(system.simulate(U), free_run(PLAIN, TRUE.plus(fitted)), atol=1e-9)
    between = Term(BENDS[0], (0.8,))
    assert between.kind.of_library(between.q) is None  # a law of its own, `chain_law.bent`
    assert "resonance" in coupling.effect.equation
    assert between.effect.place == "law"
    assert "u" not in between.effect.equation.replace("saturation", "")
