"""Strong effects fitted with the effect inside: from starts of their own to their true numbers."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks._evidence import record_of, term_of
from benchmarks.blind_logs import filtered_chain, mass_on_spring, wiener_hammerstein
from tests.gap.plants.example_chain import PLAIN, TRUE, kind, record, term
from whsklearn.effects import ChainDeadZone, ParameterChange, Stribeck, as_law
from whsklearn.effects.base import rms
from whsklearn.gap.plants import chain_anew as anew
from whsklearn.gap.plants.chain import ChainPlant
from whsklearn.gap.plants.chain_fit import base_starts, coloured, cost, minima, polished, sharpened
from whsklearn.gap.plants.chain_looks import gained, look
from whsklearn.gap.plants.chain_model import ChainHypothesis, ChainTerm, Record, chain_free_run

RNG = np.random.default_rng


def logged(effect, seed):
    """A record of another author's filters, and its base model's minima."""
    case = filtered_chain.record(effect, seed, n=1200)
    u, y = (case.frame[k].to_numpy().copy() for k in ("u", "y"))
    s = Record.of(u, y, 1.0, np.array([2, 2, 2, 2, 3]), as_law(None))
    return s, minima(s, base_starts(s, RNG(0))), case.numbers


@pytest.mark.parametrize(
    ("effect", "name", "at", "number"),
    [
        ("backlash", "backlash", "middle", "gap"), ("input_play", "backlash", "input", "gap"),
        ("flexible_coupling", "flexible_coupling", "middle", "frequency"), ("dead_zone", "dead_zone", "input", "width"),
        ("output_coupling", "flexible_coupling", "output", "frequency"), ("saturation", "saturation", "input", "limit"),
        ("sensor_rectification", "sensor_rectification", "", "fraction"),
        ("folded_below_noise", "sensor_rectification", "", "fraction"),
    ],
)  # fmt: skip
def test_a_strong_effect_is_found_with_its_number(effect, name, at, number):
    s, (base, *others), numbers = logged(effect, 31)
    k = kind(name, at)
    assert anew.is_strong(k, s)
    ((_, grown),) = anew.fitted_anew(s, base, others, [k], RNG(0))
    grown = polished(s, anew.nudged(s, grown))
    assert grown.terms[-1].q[k.fields.index(number)] == pytest.approx(numbers[number], rel=0.05)
    # what is left is the noise of the record, 30 dB below the output, before a sign is lost
    output = rms(chain_free_run(s, grown.without(0) if k.folds else grown))
    assert np.sqrt(cost(s, grown) / s.fit.sum()) < 1.06 * 10 ** (-30 / 20) * output
    assert cost(s, grown) < 0.3 * cost(s, base)


@pytest.mark.parametrize(("name", "seed", "first"), [("backlash", 1154940, 0.03), ("input_delay", 1274649, 0.00047)])
def test_a_shape_in_a_false_minimum_leaves_as_little_as_from_its_true_number(name, seed, first):
    """A play came back from softer signs to three quarters of itself, and a tone was named for the rest."""
    case = wiener_hammerstein.make_case("named", seed, effects=(name,), n=1500)
    s, truth = record_of(case), case.system
    theta = np.concatenate([truth["a"][1:], truth["b"], truth["law"], truth["c"][1:], truth["d"]])
    one = term_of(name, case.parameters[0])
    best = polished(s, coloured(s, ChainHypothesis(theta, (one,))))
    base = minima(s, base_starts(s, RNG(0)))[0]
    grown = anew.fitted(s, [base], ChainTerm(one.kind, (first,)))
    assert cost(s, polished(s, anew.nudged(s, grown))) < 1.01 * cost(s, best) < 0.9 * cost(s, base)


def test_the_input_behind_an_effect_is_the_effects_own():
    u = anew.applied(PLAIN, term("dead_zone", 0.3, at="input"))
    np.testing.assert_allclose(u, PLAIN.u - np.clip(PLAIN.u, -0.3, 0.3), atol=1e-12)
    late = anew.applied(PLAIN, term("input_delay", 2.5))
    np.testing.assert_allclose(late[3:], 0.5 * (PLAIN.u[1:-2] + PLAIN.u[:-3]), atol=1e-12)


def test_a_sign_that_is_there_is_not_looked_for():
    assert not anew.is_strong(kind("sensor_rectification"), PLAIN)
    assert anew.is_strong(kind("sensor_rectification"), PLAIN.with_output(np.abs(PLAIN.y)))


def test_the_pairs_of_poles_that_ring_become_resonances_with_their_numbers():
    pole = np.exp(2j * np.pi * 0.1 * (1j * 0.05 + np.sqrt(1 - 0.05**2)))  # f = 0.1, zeta = 0.05
    found = list(anew.resonances(PLAIN, TRUE, np.array([pole, np.conj(pole), 0.3]), kind("flexible_coupling")))
    assert len(found) == 1
    np.testing.assert_allclose(found[0][1].q, (0.1, 0.05), rtol=1e-9)


def test_an_instant_is_walked_to():
    s = record(ParameterChange(0.3, 503.0, "coulomb"))
    k = next(k for k in anew.kinds(s, TRUE) if k.options.get("parameter") == "coulomb")
    m = sharpened(s, coloured(s, TRUE).with_term(anew.ChainTerm(k, (0.3, 450.0))), (1000.0,))
    found = anew.walked(s, m).terms[-1].q
    assert found[1] == pytest.approx(503.0, abs=5.0)
    assert found[0] == pytest.approx(0.3, rel=0.1)


def test_all_strong_candidates_and_the_best_of_the_rest_start_from_the_model():
    m = coloured(s := record(ChainDeadZone(0.3)), TRUE)
    starts = anew.promising(s, m, [])
    strong = {k.code for k in anew.kinds(s, m) if anew.is_strong(k, s)}
    assert strong <= {t.kind.code for t in starts}
    weak = [t for t in starts if t.kind.code not in strong]
    assert 0 < len(weak) <= anew.KEPT  # of one look
    assert {t.kind.name for t in anew.promising(s, m, [], among=("dead_zone", "cogging"))} == {"dead_zone", "cogging"}


def test_a_small_dead_zone_is_fitted_from_where_the_model_is():
    s = record(ChainDeadZone(0.05))
    m = coloured(s, TRUE)
    starts = [t for t in anew.promising(s, m, [], among=("dead_zone",)) if t.kind.at == "input"]
    best = min((anew.fitted(s, [m], t) for t in starts), key=lambda g: cost(s, g))
    assert best.terms[-1].q[0] == pytest.approx(0.05, rel=0.2)
    assert gained(s, m, best) > 20.0


def test_an_additive_effect_starts_from_both_looks():
    """Of a broad Stribeck curve the softer look knows a narrow one only, from which no fit leads to it."""
    s = record(Stribeck(0.15, 3.0, 2.0))
    m = coloured(s, TRUE)
    starts = [t for t in anew.promising(s, m, look(s, m, RNG(0)).looks) if t.kind.name == "stribeck"]
    assert len(starts) == 2


def test_a_spring_that_pulls_on_a_mass_is_fitted_from_every_division_of_a_linear_model():
    log = mass_on_spring.record(0, 2000)
    plant = ChainPlant(*(log[k].to_numpy() for k in ("u", "y")), ("linear", (2, 2, 2, 2), 1), tolerance=0.004)
    base = plant.base(RNG(0))
    ((_, grown),) = anew.fitted_anew(plant.record, base, [], [kind("hardening_spring", "input")], RNG(0))
    before, after = (np.std((plant.y - chain_free_run(plant.everything, m))[plant.record.fit]) for m in (base, grown))
    assert after < 0.1 * before
    assert grown.terms[-1].q[0] > 0.0


def test_a_rival_starts_from_the_blocks_of_the_best():
    s = PLAIN.with_output(
        PLAIN.y + chain_free_run(PLAIN, TRUE.with_term(term("input_delay", 0.1))) - chain_free_run(PLAIN, TRUE)
    )
    lag = sharpened(s, TRUE.with_term(term("actuator_lag", 0.3)))
    rivals = {k.name: m for k, m in anew.beside_the_best(s, [(lag.terms[0].kind, lag)])}
    assert rivals["input_delay"].terms[0].q[0] == pytest.approx(0.1, rel=0.2)
    assert cost(s, rivals["input_delay"]) < cost(s, lag)


def test_the_best_candidate_gets_no_rivals_if_it_leaves_the_blocks_as_they_are():
    m = sharpened(PLAIN, TRUE.with_term(term("quadratic_drag", 0.01)))
    assert list(anew.beside_the_best(PLAIN, [(m.terms[0].kind, m)])) == []
    assert list(anew.beside_the_best(PLAIN, [])) == []
