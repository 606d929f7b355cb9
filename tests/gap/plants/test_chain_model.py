"""The model under diagnosis: vector, sensitivities, robust sums, colour; its candidates, those of a user's own too."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import pandas as pd
import pytest
from scipy.signal import lfilter

from tests.gap.plants.example_chain import PARTS, PLAIN, SIZES, THETA, TRUE, U, record, term
from whsklearn import WienerHammersteinSystem
from whsklearn.effects import Effect, Quantity, as_law, base
from whsklearn.gap import GapFinder
from whsklearn.gap.plants import chain_model as cm
from whsklearn.gap.plants.chain import ChainPlant
from whsklearn.gap.plants.chain_fit import coloured, cost
from whsklearn.gap.plants.chain_model import ChainTerm, catalogue, chain_free_run
from whsklearn.gap.report import as_model
from whsklearn.models import load_model, save_model

COLOUR = np.array([0.3, -0.1, 0.0, 0.0, 0.0, 0.05])
TERMS = [
    term("cogging", 0.1, -0.2, 0.6), term("dead_zone", 0.2), term("output_offset", 0.3), term("actuator_lag", 0.8),
    term("stribeck", 0.2, 1.0, 2.0), term("sensor_rectification", 0.3), term("hardening_spring", 0.01, 0.0),
    term("flexible_coupling", 0.1, 0.2, at="output"), term("disturbance_tone", 0.1, 0.2, 0.05, at="input"),
]  # fmt: skip


@pytest.mark.parametrize("one", TERMS, ids=lambda t: t.name)
def test_vector_and_model_are_inverses(one):
    m = TRUE.with_term(one)
    again = cm.from_vector(m, cm.to_vector(m))
    np.testing.assert_allclose(again.theta, THETA)
    np.testing.assert_allclose(again.terms[0].q, one.q)


@pytest.mark.parametrize("one", TERMS, ids=lambda t: t.name)
def test_sensitivities_are_central_differences(one):
    m = dataclasses.replace(TRUE.with_term(one), ar=COLOUR)
    rows = cm.sensitivities(PLAIN, m, 0.5)
    x = cm.to_vector(m)
    for i in range(x.size):
        h = 1e-5 * max(abs(x[i]), 0.1) * np.eye(1, x.size, i)[0]
        e = [cm.left(PLAIN, cm.from_vector(m, v), 0.5) for v in (x + h, x - h)]
        slope = (e[0] - e[1]) / (2 * h[i])
        assert np.linalg.norm(rows[:, i] - slope) <= 5e-3 * np.linalg.norm(slope) + 1e-6


def test_sensitivities_follow_the_units_of_the_record():
    one = dataclasses.replace(TRUE.with_term(term("sensor_rectification", 0.3)), ar=COLOUR)
    grey = dataclasses.replace(TRUE.with_term(term("input_offset", 0.0)), ar=COLOUR)
    linear = as_law("viscous,coulomb")
    for m in (one, grey):
        theta = np.delete(m.theta, 5)
        rows = []
        for unit in (1.0, 1e9):
            s = cm.Record.of(unit * U, PLAIN.y, 1.0, np.array([2, 2, 2, 2, 2]), linear)
            theta[3] = m.theta[3] / unit  # viscous friction is per unit of x
            rows.append(cm.sensitivities(s, dataclasses.replace(m, theta=theta.copy()), 0.5 / unit))
        there = rows[1].copy()
        there[:, 3] /= 1e9
        if m is grey:
            there[:, -1] *= 1e9
        assert np.linalg.norm(there - rows[0], axis=0) == pytest.approx(
            np.zeros(rows[0].shape[1]), abs=1e-4 * np.linalg.norm(rows[0])
        )


def test_what_the_truth_leaves_is_the_noise_that_has_passed_l2():
    d = 0.02 * np.random.default_rng(0).normal(size=U.size)
    np.testing.assert_allclose(cm.left(PLAIN, TRUE), lfilter([1.0], [1.0, 0.15, 0.4], d), atol=1e-9)
    white = dataclasses.replace(TRUE, ar=np.array([0.15, 0.4, 0.0, 0.0, 0.0, 0.0]))
    np.testing.assert_allclose(cm.left(PLAIN, white), d, atol=1e-9)


def test_several_runs_at_once_are_the_runs_one_by_one():
    models = [TRUE.with_term(term("cogging", a, 0.0, 0.6)) for a in (0.1, 0.3)]
    both = cm.outputs(PLAIN, models, 5.0)
    for run, m in zip(both, models, strict=True):
        np.testing.assert_array_equal(run, cm.simulate(PLAIN, m, 5.0)[2])


def test_the_sum_of_squares_of_gaussian_errors_is_theirs():
    e = np.random.default_rng(0).normal(size=4000)
    assert cm.deviance(e) == pytest.approx(float(e @ e), rel=0.02)
    assert float(cm.held(e) @ cm.held(e)) == pytest.approx(cm.deviance(e))


def test_an_outlier_costs_no_more_than_the_cap_and_leaves_the_variance_alone():
    e = np.random.default_rng(0).normal(size=4000)
    bad = e.copy()
    bad[10] = 1e4
    assert 0.0 < e.size * np.log(cm.deviance(bad) / cm.deviance(e)) < cm.CAP + 3.0
    bad[::100] += 20.0
    assert cm.variance_of(bad) == pytest.approx(1.0, rel=0.1)


def test_the_colour_is_that_of_the_noise_and_outliers_have_none():
    e = np.random.default_rng(0).normal(size=6000)
    r = lfilter([1.0], [1.0, -0.8, 0.3], e)
    r[1000] += 100.0
    np.testing.assert_allclose(cm.colour([r])[:3], [-0.8, 0.3, 0.0], atol=0.06)
    assert cm.loudness(np.array([-0.8, 0.3])) == pytest.approx(np.std(lfilter([1.0], [1.0, -0.8, 0.3], e)), rel=0.05)


def test_the_colour_cannot_take_a_constant_or_a_tone_out_of_the_errors():
    t = np.arange(3000.0)
    for r in (np.ones(3000), np.sin(0.4 * t)):
        held = cm.burg([r + 1e-3 * np.random.default_rng(0).normal(size=r.size)])
        assert np.abs(np.roots([1.0, *held])).max() < cm.LONGEST_COLOUR * 1.0001
        assert np.std(cm.whiten(r, held)[50:] - r.mean()) > 0.0 or abs(cm.whiten(r, held)[-1]) > 1e-3


def test_a_made_record_has_the_models_output_and_noise_of_the_same_size_and_colour():
    m = dataclasses.replace(TRUE, ar=np.array([0.15, 0.4, 0.0, 0.0, 0.0, 0.0]))
    made = cm.made(PLAIN, m, np.random.default_rng(5))
    e = cm.left(made, m)
    assert np.std(e) == pytest.approx(0.02, rel=0.1)
    assert abs(np.corrcoef(e[1:], e[:-1])[0, 1]) < 0.1
    assert abs(np.corrcoef(e, cm.left(PLAIN, m))[0, 1]) < 0.1


def test_readings_that_are_never_negative_stay_so_in_made_records():
    m = TRUE.with_term(term("sensor_rectification", 1.0))
    folded = PLAIN.with_output(np.abs(PLAIN.y))
    assert cm.made(folded, m, np.random.default_rng(0)).y.min() >= 0.0
    below = PLAIN.with_output(np.abs(PLAIN.y) - 1e-3)
    assert cm.made(below, m, np.random.default_rng(0)).y.min() < 0.0


def test_made_records_are_read_on_the_grid_of_the_record():
    step = 0.5 * float(np.std(PLAIN.y))
    coarse = cm.Record.of(PLAIN.u, step * np.round(PLAIN.y / step), PLAIN.dt, PLAIN.dims, PLAIN.law)
    made = cm.made(coarse, TRUE, np.random.default_rng(0))
    assert np.allclose(made.y / step, np.round(made.y / step))
    sizes = [np.std(r.y - cm.chain_free_run(r, TRUE)) for r in (coarse, made)]
    assert sizes[1] == pytest.approx(sizes[0], rel=0.1)  # rounding is not counted twice
    assert cm.made(PLAIN, TRUE, np.random.default_rng(0)).step == 0.0


def test_natural_parameters_have_their_names():
    assert list(cm.numbers_of(PLAIN, TRUE).items())[:4] == [("a_2", 2.2), ("b_1", 1.0), ("b_2", 0.5), ("viscous", 0.05)]
    assert record().blocks[2] == slice(3, 6)


def test_what_was_not_logged_changes_nothing():
    seen = np.ones(PLAIN.u.size, dtype=bool)
    seen[400:550] = False
    rng = np.random.default_rng(1)
    found = []
    for scale in (1.0, 1e6):
        y = np.where(seen, PLAIN.y, scale * rng.normal(size=seen.size))
        s = cm.Record.of(PLAIN.u, y, 1.0, PLAIN.dims, PLAIN.law, seen)
        m = coloured(s, TRUE)
        found.append(
            (m.ar, cm.left(s, m), cost(s, m), cm.sizes(s, m).y, cm.made(s, m, np.random.default_rng(0)).y[seen])
        )
    for a, b in zip(*found, strict=True):
        np.testing.assert_array_equal(a, b)
    assert not found[0][1][400:550].any()
    assert int(s.fit.sum()) == PLAIN.u.size - 150 - 2 * cm.SKIP
    np.testing.assert_array_equal(cm.left(s, m)[-300:], cm.left(PLAIN, m)[-300:])  # time goes on in a hole


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

    assert (found().free, found().n_numbers, found().scanned) == ((0, 1, 2), 3, "")
    bump.held, bump.aliases = ("centre",), ("end_stop",)
    bump.quantities["width"] = Quantity("rad", 0.01, 20.0, log=True, scan="step")
    assert (found().free, found().n_numbers, found().scanned) == ((0,), 2, "step")
    plant = ChainPlant(np.zeros(9), np.zeros(9), (None, (2, 2, 2, 2), 0), tolerance=0.004)
    assert plant.aliases("bump") == ("end_stop",)
    assert plant.aliases("end_stop") == ()


def test_it_is_named_where_it_is_and_not_where_it_is_not(bump):
    rng = np.random.default_rng(1)
    u = rng.normal(size=600)
    hidden = WienerHammersteinSystem(**PARTS, effects=[bump(0.6, 2.0, 1.5)])
    y = hidden.simulate(u, 0.02 * rng.normal(size=u.size))
    finder = GapFinder("wiener-hammerstein").fit(pd.DataFrame({"u": u, "y": y}))
    assert (finder.verdict_, [e.name for e in finder.effects_]) == ("named", ["bump"])
    assert finder.effects_[0].effect.torque == pytest.approx(0.6, rel=0.1)
    assert [e.name for e in finder.model_.effects] == ["bump"]
    y = WienerHammersteinSystem(**PARTS).simulate(u, 0.02 * rng.normal(size=u.size))
    assert GapFinder("wiener-hammerstein").fit(pd.DataFrame({"u": u, "y": y})).verdict_ == "no_gap"


LINE = as_law("linear")
TABLE = [*catalogue(as_law(None)), *(k for k in catalogue(LINE) if k.at == "middle" and k.cls.port == "input")]


def filled(k):
    """A term of a candidate in the middle of its first shape, of a size that shows."""
    # a spring on the mass of a chain is unstable where it is stiff within a sample, as at 0.01 on this white input
    size = {0: (), 1: (0.002 if k.pulls and k.name == "hardening_spring" else 0.05,), 2: (0.05, -0.03)}[k.linear]
    shapes = k.shapes(SIZES)
    return ChainTerm(k, (*size, *(shapes[len(shapes) // 2] if shapes else (0.1,))))


@pytest.mark.parametrize("k", TABLE, ids=lambda k: f"{k.name}{k.options}")
def test_every_candidate_is_in_the_system_that_is_handed_back_saved_and_loaded(k, tmp_path):
    one = filled(k)
    assert one.row()[: len(one.q)] == pytest.approx(one.effect.row)
    assert one.effect.name == k.name
    system = WienerHammersteinSystem(**PARTS, effects=[one.effect])
    np.testing.assert_allclose(system.simulate(U), chain_free_run(PLAIN, TRUE.with_term(one)), atol=1e-9)
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
