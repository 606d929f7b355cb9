"""Fits of a chain: from nothing to the truth, through wrong signs, beside an effect; base laws and orders."""

from __future__ import annotations

import dataclasses

import numpy as np
import pandas as pd
import pytest
from scipy.signal import lfilter

from benchmarks._twins import make_coupled_drives
from benchmarks.blind_logs import wiener_hammerstein as blind
from tests.gap.plants.example_chain import PLAIN, THETA, TRUE, record, term
from whsklearn import WienerHammersteinSystem
from whsklearn.effects import ActuatorLag, Power, QuadraticDrag, as_law
from whsklearn.effects.law import place_knots, without_knots
from whsklearn.gap import GapFinder
from whsklearn.gap.plants import chain_fit as cf
from whsklearn.gap.plants.chain import ChainPlant
from whsklearn.gap.plants.chain_fit import base_starts, coloured, cost, minima
from whsklearn.gap.plants.chain_model import SKIP, ChainHypothesis, Record, chain_free_run, rms_dx, simulate
from whsklearn.systems.stability import is_stable


def drawn(seed):
    """(record, truth) of a drawn system of another author's equations."""
    case = blind.make_case("none", seed, n=1500)
    u, y = (case.frame[k].to_numpy().copy() for k in ("u", "y"))
    s = {k: np.array(v) for k, v in case.system.items()}
    theta = np.concatenate([s["a"][1:], s["b"], s["law"], s["c"][1:], s["d"]])
    return Record.of(u, y, 1.0, np.array([2, 2, 2, 2, 3]), as_law(None)), ChainHypothesis(theta)


@pytest.mark.parametrize("seed", [8101, 8102, 8103])
def test_the_least_minimum_is_that_of_the_truth(seed):
    s, truth = drawn(seed)
    found = cf.minima(s, cf.base_starts(s, np.random.default_rng(0)))
    # three in a thousand of n = 1460: less than a superfluous number explains by chance
    assert cf.cost(s, found[0]) < 1.003 * cf.cost(s, cf.polished(s, cf.coloured(s, truth)))


def test_without_noise_a_fit_nearby_ends_at_the_truth():
    s = record(noise=0.0)
    near = dataclasses.replace(TRUE, theta=THETA * (1.0 + 0.03 * np.cos(np.arange(9))))
    fitted = cf.sharpened(s, near, (3.0, 30.0, 300.0, 1000.0))
    np.testing.assert_allclose(fitted.theta, THETA, atol=5e-3)  # the last sign is a tanh still


def test_a_fit_never_ends_worse_than_it_began():
    m = cf.coloured(PLAIN, TRUE)
    assert cf.cost(PLAIN, cf.polished(PLAIN, m)) <= cf.cost(PLAIN, m)


@pytest.mark.parametrize("seed", range(3))
def test_behind_an_input_that_is_held_a_fit_leaves_noise_alone(seed):
    # between its steps dx decays to any share of its rms, so no tanh of it is its sign
    rng = np.random.default_rng(seed)
    u = np.repeat(rng.choice([-1.0, 1.0], 200), rng.integers(5, 25, 200))[:2000]
    v = 0.2 / np.std(np.diff(lfilter([0.0, 1.0], [1.0, -0.83], u)))  # viscous friction, for a Coulomb friction of one
    law = as_law("viscous,coulomb").reweighted([v, 1.0])
    y = WienerHammersteinSystem([1.0], [-0.83], [1.0], [-0.69], law, effects=[ActuatorLag(1.2)]).simulate(u)
    noise = 0.03 * np.std(y)
    s = Record.of(u, y + noise * rng.normal(size=u.size), 1.0, np.array([1, 1, 1, 1, 2]), law)
    bare = ChainHypothesis(np.array([-0.83, v, 0.0, -0.69]), (term("actuator_lag", 1.2),))
    assert cf.cost(s, cf.polished(s, bare)) < 1.05 * noise**2 * s.fit.sum()


def test_a_pole_and_a_zero_that_cancel_at_the_unit_circle_are_released():
    stuck = THETA.copy()
    stuck[6:] = [1.004, *np.poly([-1.004, -0.3])[1:]]
    m = cf.sharpened(PLAIN, dataclasses.replace(TRUE, theta=stuck), (3.0, 10.0, 30.0, 1000.0))
    truth = cf.cost(PLAIN, cf.polished(PLAIN, cf.coloured(PLAIN, TRUE)))
    assert cf.cost(PLAIN, m) > 100.0 * truth
    assert cf.cost(PLAIN, cf.polished(PLAIN, m)) < 1.003 * truth


def test_a_pole_and_a_zero_that_the_record_needs_are_not_released():
    assert cf.released(PLAIN, cf.polished(PLAIN, cf.coloured(PLAIN, TRUE))) == []


def slow_record(bend, unit=1.0, out=1.0, lag=12.0, n=1500, noise=0.03):
    """(record, noise of y): three lags of ``lag`` samples, a bend of x in its own rms, and one lag, in any units."""
    rng = np.random.default_rng(7)
    u = np.repeat(rng.normal(size=n // 10), 10)
    poles = np.poly([np.exp(-1.0 / (lag * k)) for k in (0.8, 1.0, 1.3)])
    x = lfilter([0.0, 1.0, 2.7, 0.8], poles, u)  # about the zeros of three lags behind a hold
    y = lfilter([0.0, 0.2], [1.0, -0.8], bend(x / x.std()))
    e = noise * y.std() * rng.normal(size=n)
    law = as_law("polynomial")
    return Record.of(unit * u, out * (y + e), 1.0, np.array([3, 3, 1, 1, len(law)]), law), out * e


def cubic(x):
    return x + 0.15 * x**2 + 0.2 * x**3


def test_slow_blocks_whose_cube_is_large_reach_the_noise():
    # a_1 = 1, so x is 1e4 times u here; its cube and the poles of L1 are columns of sizes that are 1e12 apart
    s, e = slow_record(cubic, unit=300.0)
    found = cf.minima(s, cf.base_starts(s, np.random.default_rng(0)))[0]
    assert np.sqrt(cf.cost(s, found) / s.fit.sum()) < 1.02 * np.std(e[s.fit])


@pytest.mark.parametrize(("unit", "out"), [(1e6, 1.0), (1e-6, 1.0), (1.0, 1e9), (1.0, 1e-9)])
def test_minima_are_the_same_in_any_units(unit, out):
    costs = []
    for by, far in ((1.0, 1.0), (unit, out)):
        s, _ = slow_record(cubic, by, far, lag=4.0, n=800)
        found = cf.minima(s, cf.base_starts(s, np.random.default_rng(0)))
        costs.append(cf.cost(s, found[0]) / far**2)
    assert costs[1] == pytest.approx(costs[0], rel=1e-3)


def test_an_effect_is_fitted_together_with_the_blocks():
    s = record(QuadraticDrag(0.1))
    fitted = cf.sharpened(s, TRUE.with_term(term("quadratic_drag", 0.01)), (30.0, 300.0, 1000.0))
    assert fitted.terms[0].q[0] == pytest.approx(0.1, rel=0.1)
    assert cf.cost(s, fitted) < 0.5 * cf.cost(s, cf.polished(s, TRUE))


def test_weights_come_from_least_squares_beside_effects():
    one = term("output_offset", 0.4)
    s = PLAIN.with_output(chain_free_run(PLAIN, TRUE.with_term(one)))
    m = ChainHypothesis(cf.weighed(s, THETA[:3], THETA[6:], (one,)), (one,))
    np.testing.assert_array_equal(np.delete(m.theta, [3, 4, 5]), np.delete(THETA, [3, 4, 5]))
    kappa = 1.0 / rms_dx(s, m)  # the weights are those of the softest sign

    def rest(model):
        return np.std((s.y - simulate(s, model, kappa)[2])[s.fit])

    assert rest(m) < 0.5 * np.std(s.y[s.fit])
    assert rest(m) < rest(TRUE.with_term(one))


def test_the_divisions_of_the_linear_model_have_all_its_poles():
    for theta in cf.divided(PLAIN, cf.linear_model(PLAIN, PLAIN.u)):
        poles = np.concatenate([np.roots([1.0, *theta[1:3]]), np.roots([1.0, *theta[7:]])])
        ratio = cf.linear_model(PLAIN, PLAIN.u)
        np.testing.assert_allclose(np.sort(np.abs(poles)), np.sort(np.abs(np.roots(ratio.a))), atol=1e-6)


def static_record(bend, n=1500, seed=5, noise=0.01):
    """u -> second-order block -> a static bend of x -> first-order block with a direct path, by SciPy alone."""
    rng = np.random.default_rng(seed)
    u = rng.normal(size=n)
    x = lfilter([0.0, 1.0, 0.4], [1.0, -0.9, 0.4], u)
    v = bend(x)
    clean = lfilter([1.0, 0.3], [1.0, -0.5], v)
    y = clean + lfilter([1.0], [1.0, -0.5], noise * clean.std() * rng.normal(size=n))
    return pd.DataFrame({"u": u, "y": y}), x


def plant_with(law):
    """A plant of noise with this law."""
    return ChainPlant(*np.random.default_rng(0).normal(size=(2, 400)), (law, (2, 2, 2, 2), 0), tolerance=0.004)


@pytest.mark.parametrize("text", ["linear:x", "polynomial:0", "no_such_law", " , "])
def test_a_law_that_is_none_is_refused_in_one_sentence(text):
    with pytest.raises(ValueError, match=r"law|effect"):
        plant_with(text)


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
    assert (finder.effects_[0].effect.at, finder.model_.effects[0].at) == ("middle", "middle")
    assert finder.effects_[0].effect.limit == pytest.approx(limit, rel=0.05)
    d = finder.diagnosis_
    assert d.closure > 0.9
    y_hat = finder.model_.simulate(frame["u"])
    assert np.std(frame["y"] - y_hat) < 1.5 * d.after["rmse"]


def test_a_free_law_leaves_nothing_of_a_bend_that_no_effect_has():
    frame, _ = static_record(lambda x: np.where(x > 0, x, 0.3 * x) + 0.1 * x**2, n=500, noise=0.02)
    settings = {"orders": (2, 2, 2, 1), "direct": 1, "max_effects": 1}
    u, y = frame["u"].to_numpy(), frame["y"].to_numpy()
    plant = ChainPlant(u, y, ("piecewise_linear:10", (2, 2, 2, 1), 1), tolerance=0.004)
    base = plant.base(np.random.default_rng(0))
    left = (y - chain_free_run(plant.record, base))[SKIP:]
    assert np.mean(left**2) < 2e-3 * np.var(y)  # without a search: the base model itself leaves nothing
    line = GapFinder("wiener-hammerstein", law="linear", **settings).fit(frame)
    assert line.verdict_ != "named"
    assert "law has another shape" in line.diagnosis_.sentence


@pytest.mark.parametrize("more", [1, 2])
def test_more_poles_and_zeros_of_size_zero_change_nothing(more):
    s, m = cf.raised(PLAIN, TRUE, more)
    assert m.theta.size == TRUE.theta.size + 4 * more
    np.testing.assert_allclose(chain_free_run(s, m), chain_free_run(PLAIN, TRUE), atol=1e-12)


def test_a_free_law_of_weight_zero_changes_nothing_and_any_weight_does():
    s, m = cf.freed(PLAIN, TRUE)
    np.testing.assert_allclose(chain_free_run(s, m), chain_free_run(PLAIN, TRUE), atol=1e-12)
    for i in range(6, s.blocks[2].stop):
        theta = m.theta.copy()
        theta[i] = 0.5
        moved = chain_free_run(s, type(m)(theta))
        assert np.abs(moved - chain_free_run(PLAIN, TRUE)).max() > 1e-3


def test_knots_are_placed_by_x_and_a_law_with_them_explains_as_much():
    frame, _ = static_record(np.tanh)
    asked = as_law("piecewise_linear:6")
    u, y = (frame[k].to_numpy().copy() for k in ("u", "y"))
    law = without_knots(asked)
    s = Record.of(u, y, 1.0, np.array([2, 2, 2, 1, len(law)]), law)
    start = minima(s, base_starts(s, np.random.default_rng(0)))[0]
    at, (model,) = cf.with_knots(s, start, asked)
    knots = [t.knot for t in at.law.terms if hasattr(t, "knot")]
    np.testing.assert_allclose(knots, place_knots(simulate(s, start)[0], 8)[1:-1])
    assert int(at.dims[4]) == len(at.law) == 8
    assert cost(at, model) < 1.1 * cost(s, start)


def test_a_pole_too_few_is_told_and_an_effect_is_not_taken_for_it():
    rng = np.random.default_rng(3)
    u = rng.normal(size=1500)
    big = WienerHammersteinSystem([1.0, 0.5], [-1.2, 0.7, -0.1], [1.0], [-0.5, 0.3, -0.2, 0.4])
    y = big.simulate(u, 0.01 * rng.normal(size=u.size))
    law = as_law(None)
    s = Record.of(u, y, 1.0, np.array([2, 1, 1, 2, len(law)]), law)
    base = minima(s, base_starts(s, np.random.default_rng(0)))[0]
    said = cf.falls_short(s, base, base)
    assert "linear dynamics are missing" in said
    assert "orders 2,1,1,2 were given" in said
    assert cf.falls_short(PLAIN, coloured(PLAIN, TRUE), coloured(PLAIN, TRUE)) == ""


def test_a_short_record_of_a_slow_pole_has_stable_minima():
    # 500 samples of a sensor that reads |speed| are followed better by poles outside the unit circle
    u, y = make_coupled_drives(kind="prbs", random_state=40)
    y = np.asarray(y, dtype=float).reshape(-1)
    s = Record.of(np.asarray(u, dtype=float).reshape(-1), y, 1.0, np.array([2, 2, 2, 2, 1]), as_law([Power(1.0, 1.0)]))
    found = minima(s, base_starts(s, np.random.default_rng(0)))
    assert found
    for m in found:
        assert is_stable(m.theta[s.blocks[1]], 1.0)
        assert is_stable(m.theta[s.blocks[4]], 1.0)
