"""Candidates of a chain: an effect of a user's own is simulated at its port, searched, named, handed back."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import pandas as pd
import pytest

from tests.gap.plants.example_chain import PARTS, PLAIN, SIZES, TRUE, U, term
from whsklearn import WienerHammersteinSystem
from whsklearn.effects import Effect, Quantity, as_law, base
from whsklearn.gap import GapFinder
from whsklearn.gap.plants.chain import ChainPlant
from whsklearn.gap.plants.chain_candidates import Term, catalogue
from whsklearn.gap.plants.chain_law import law_choice
from whsklearn.gap.plants.chain_model import free_run
from whsklearn.gap.report import as_model
from whsklearn.models import load_model, save_model


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
    base._REGISTRY.pop("bump")


def test_it_is_added_behind_the_first_block(bump):
    u = np.random.default_rng(0).normal(size=200)
    with_it = WienerHammersteinSystem(**PARTS, effects=[bump(0.5, 1.0, 0.8)])
    plain = WienerHammersteinSystem(**PARTS).signals(u)
    got = with_it.signals(u)
    np.testing.assert_allclose(got.x, plain.x)
    np.testing.assert_allclose(got.v - plain.v, 0.5 * np.exp(-(((plain.x - 1.0) / 0.8) ** 2)), atol=1e-12)


def test_what_its_class_says_of_the_search_counts(bump):
    def found():
        return next(k for k in catalogue(as_law(None)) if k.name == "bump")

    assert (found().free, found().n_numbers, found().scan) == ((0, 1, 2), 3, "")
    bump.held, bump.aliases = ("centre",), ("end_stop",)
    bump.quantities["width"] = Quantity("rad", 0.01, 20.0, log=True, scan="step")
    assert (found().free, found().n_numbers, found().scan) == ((0,), 2, "step")
    plant = ChainPlant(np.zeros(9), np.zeros(9), (law_choice(None), (2, 2, 2, 2), 0), tolerance=0.004)
    assert plant.aliases("bump") == ("end_stop",)
    assert plant.aliases("end_stop") == ()


def test_it_is_named_where_it_is_and_not_where_it_is_not(bump):
    rng = np.random.default_rng(1)
    u = rng.normal(size=1500)
    hidden = WienerHammersteinSystem(**PARTS, effects=[bump(0.6, 2.0, 1.5)])
    y = hidden.simulate(u, 0.02 * rng.normal(size=u.size))
    finder = GapFinder("wiener-hammerstein").fit(pd.DataFrame({"u": u, "y": y}))
    assert (finder.verdict_, [e.name for e in finder.effects_]) == ("named", ["bump"])
    assert finder.effects_[0].effect.torque == pytest.approx(0.6, rel=0.1)
    assert [e.name for e in finder.model_.effects] == ["bump"]
    y = WienerHammersteinSystem(**PARTS).simulate(u, 0.02 * rng.normal(size=u.size))
    assert GapFinder("wiener-hammerstein").fit(pd.DataFrame({"u": u, "y": y})).verdict_ == "no_gap"


LINE = law_choice("linear").first()
TABLE = [*catalogue(as_law(None)), *(k for k in catalogue(LINE) if k.at == "middle" and k.cls.port == "input")]


def filled(k):
    """A term of a candidate in the middle of its first shape, of a size that shows."""
    size = {0: (), 1: (0.05,), 2: (0.05, -0.03)}[k.linear]
    shapes = k.shapes(SIZES)
    return Term(k, (*size, *(shapes[len(shapes) // 2] if shapes else (0.1,))))


@pytest.mark.parametrize("k", TABLE, ids=lambda k: f"{k.name}{k.options}")
def test_every_candidate_is_in_the_system_that_is_handed_back_saved_and_loaded(k, tmp_path):
    one = filled(k)
    assert one.row()[: len(one.q)] == pytest.approx(one.effect.row)
    assert one.effect.name == k.name
    system = WienerHammersteinSystem(**PARTS, effects=[one.effect])
    np.testing.assert_allclose(system.simulate(U), free_run(PLAIN, TRUE.plus(one)), atol=1e-9)
    assert (
        np.abs(system.simulate(U) - WienerHammersteinSystem(**PARTS).simulate(U)).max() > 0.0
        or k.name == "input_offset"
    )
    path = tmp_path / "repaired.json"
    save_model(as_model(system, ("", "")), path)
    again = load_model(path)
    assert [e.name for e in again.effects] == [k.name]
    np.testing.assert_allclose(again.simulate(U), system.simulate(U), atol=1e-9)


@pytest.mark.parametrize("k", catalogue(as_law(None)), ids=lambda k: f"{k.name}{k.options}")
def test_shapes_lie_in_their_ranges_and_follow_the_units_of_the_log(k):
    larger = dataclasses.replace(
        SIZES, **{f: 1e3 * getattr(SIZES, f) for f in ("u", "u_peak", "x", "x_peak", "dx", "y")}
    )
    for z in (SIZES, larger):
        for shape in k.shapes(z):
            for i, value in enumerate(shape, start=k.linear):
                low, high = k.range_of(i, z)
                assert low * 0.999 <= value <= high * 1.001


def test_a_wave_is_told_by_amplitude_and_phase():
    told = term("cogging", 3.0, -4.0, 0.6).effect.labelled()
    assert told == {"amplitude_nm": 5.0, "phase_rad": pytest.approx(np.arctan2(4.0, 3.0)), "order": 0.6}


def test_what_bends_a_line_is_asked_between_the_blocks_only_where_the_law_is_one():
    def middle(law):
        return {k.name for k in catalogue(as_law(law)) if k.at == "middle"}

    assert middle(None) == {"backlash", "flexible_coupling"}
    assert middle(LINE) == {"backlash", "flexible_coupling", "saturation", "dead_zone"}
