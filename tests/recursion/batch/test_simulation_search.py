"""The search for a chain's structure and its least simulation error."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import freqz, lfilter

from whsklearn.effects import FrictionLaw, Power, as_law
from whsklearn.recursion.batch.best_linear import Ratio
from whsklearn.recursion.batch.simulation_error import Fitted, FittedChain, refine, run
from whsklearn.recursion.batch.simulation_search import (
    LARGEST_LINEAR,
    Orders,
    SearchedOrders,
    best_in_turn,
    divisions,
    grown,
    improved,
    missing_poles,
    of_orders,
    padded,
    record,
    reflected,
    reflections,
    search,
    simplest,
    square,
    squared_error,
    with_pole,
)

RATIO = Ratio(np.poly([0.3, 0.5 + 0.2j, 0.5 - 0.2j]).real, np.poly([0.9, 0.7 + 0.4j, 0.7 - 0.4j, -0.2]).real)


def test_every_division_multiplies_back_to_the_ratio():
    ways = list(divisions(RATIO, Orders(3, 3, 3, 3)))
    assert len(ways) > 4
    for first, second in ways:
        np.testing.assert_allclose(np.trim_zeros(np.convolve(first.b, second.b)), RATIO.b, atol=1e-9)
        np.testing.assert_allclose(np.convolve(first.a, second.a), RATIO.a, atol=1e-9)
        assert np.isrealobj(first.a)  # conjugate pairs were kept together


def test_no_block_gets_more_than_it_can_hold():
    for first, second in divisions(RATIO, Orders(1, 2, 2, 2)):
        assert (first.b.size - 1, first.a.size - 1) <= (1, 2)
        assert second.a.size - 1 <= 2
    assert not list(divisions(RATIO, Orders(0, 1, 0, 1)))


def test_a_pair_that_no_block_can_hold_becomes_two_real_roots():
    ratio = Ratio(np.poly([-0.5 + 0.3j, -0.5 - 0.3j]).real, np.poly([0.6 + 0.3j, 0.6 - 0.3j, 0.7, 0.1]).real)
    ways = list(divisions(ratio, Orders(1, 2, 1, 2)))
    assert ways
    for block in (b for way in ways for b in way):
        np.testing.assert_allclose(block.b, [1.0, 0.5])
        assert block.a.size == 3
    odd = Ratio(np.ones(1), np.poly([0.6 + 0.3j, 0.6 - 0.3j]).real)
    for first, second in divisions(odd, Orders(0, 1, 0, 1)):
        np.testing.assert_allclose([*first.a, *second.a], [1.0, -0.6, 1.0, -0.6])


@pytest.mark.parametrize("size", [3, 5])
def test_padding_does_not_change_the_ratio(size):
    block = Ratio(np.array([1.0, 0.5]), np.array([1.0, -0.3]))
    wide = padded(block, size, size)
    assert wide.b.size == wide.a.size == size + 1
    np.testing.assert_array_equal(np.trim_zeros(wide.b), block.b)
    np.testing.assert_array_equal(np.trim_zeros(wide.a), block.a)


@pytest.mark.parametrize("lead", [0, 2])
def test_a_reflected_zero_changes_the_phase_and_not_the_gain(lead):
    b = np.concatenate([np.zeros(lead), -2.0 * RATIO.b, [0.0]])
    found = reflections(b)
    assert len(found) == 2  # a real zero and a pair
    for image in found:
        assert image.size == b.size
        _, before = freqz(b)
        _, after = freqz(image)
        np.testing.assert_allclose(np.abs(after), np.abs(before), rtol=1e-9)
        assert np.max(np.abs(np.angle(after / before))) > 0.1
        assert any(np.allclose(back, b) or np.allclose(back, -b) for back in reflections(image))


def test_a_numerator_without_zeros_has_no_reflection():
    assert reflections(np.array([0.0, 2.0])) == reflections(np.zeros(2)) == []


# --- Exchange of roots between blocks: what a linear model of the chain sees stays the same -------------------------
DIMS = (2, 2, 2, 2, 3)


A1, A2 = np.array([1.0, -1.2, 0.5]), np.poly([0.8 + 0.4j, 0.8 - 0.4j]).real
LAW = as_law("cubic_spline")


def chain(a1, a2, b1=(1.0, 0.4), b2=(1.0, -0.3)):
    pad = [np.append(b, np.zeros(a.size - len(b))) for b, a in ((b1, a1), (b2, a2))]
    return FittedChain(pad[0][None, :], a1, pad[1], a2, LAW, LAW.weights)


def answered(truth, seed, noise=0.05, n=2500):
    """A record of the two blocks about a saturation, and noise of that share of its size."""
    u = np.random.default_rng(seed).standard_normal(n)
    x = lfilter(truth.b1[0], truth.a1, u)
    clean = lfilter(truth.b2, truth.a2, np.tanh(2 * x / np.std(x)))
    y = clean + noise * np.std(clean) * np.random.default_rng(seed + 1000).standard_normal(n)
    return record(u[:, None], y, np.arange(n) == 0)


@pytest.mark.parametrize("block", [0, 1])
def test_a_pole_with_a_zero_on_it_changes_nothing(block):
    truth = chain(A1, A2)
    data = answered(truth, 0)
    np.testing.assert_allclose(
        run(with_pole(truth, block, np.array([1.0, -1.0, 0.6])), data).y, run(truth, data).y, atol=1e-9
    )


@pytest.mark.parametrize(("block", "a1", "a2"), [(0, np.array([1.0, -0.5]), A2), (1, A1, np.array([1.0, -0.5]))])
def test_a_missing_resonance_is_seen_in_its_block_and_near_its_place(block, a1, a2):
    data = answered(chain(A1, A2), 1)
    short = refine(chain(a1, a2), data, 40)
    _, first = missing_poles(short, data, 8, 2)[0]
    grown = (first.a1, first.a2)[block]
    assert grown.size == (a1, a2)[block].size + 2
    refined = refine(first, data, 40)
    noise = 0.05**2 / (1 + 0.05**2) * np.var(data.y) * data.counts.sum()
    assert short.cost > 3 * noise
    assert refined.cost < 1.1 * noise
    angle = np.abs(np.angle(np.roots((refined.chain.a1, refined.chain.a2)[block])))
    assert np.min(np.abs(angle - np.angle(np.roots((A1, A2)[block])[0]))) < 0.1


def test_the_promise_is_the_fall_of_least_squares_to_first_order():
    almost = chain(A1, np.convolve(A2, [1.0, -0.7]), b2=np.convolve([1.0, -0.3, 0.05], [1.0, -0.55]))
    data = answered(almost, 2, noise=0.1)
    fitted = refine(chain(A1, A2, b2=(1.0, -0.3, 0.05)), data, 40)
    promises = missing_poles(fitted, data, 8, 1)
    assert promises
    for gain, promising in promises:
        fall = fitted.cost - refine(promising, data, 40).cost
        assert 0.5 * gain < fall < 3 * gain


def test_nothing_is_promised_where_nothing_is_missing():
    """One grid in a hundred may; more than two of thirty would have a chance of 0.3 %."""
    truth = chain(A1, A2)
    records = [answered(truth, seed, n=1500) for seed in range(30)]
    assert sum(bool(missing_poles(refine(truth, data, 30), data, 8, 1)) for data in records) <= 2


def test_no_block_outgrows_what_it_may_have():
    data = answered(chain(A1, A2), 1)
    short = refine(chain(np.array([1.0, -0.5]), A2), data, 40)
    for _, promising in missing_poles(short, data, 2, 3):
        assert max(promising.a1.size, promising.a2.size) - 1 <= 2


# --- Minima that no descent leaves are left by a pole where one is missing, or a zero across the unit circle --------
LAW = as_law("cubic_spline")
WRONG_MINIMUM_A1, WRONG_MINIMUM_A2 = np.poly([0.9 * np.exp(0.5j), 0.9 * np.exp(-0.5j)]).real, np.poly([0.7, -0.5]).real
B1, B2 = np.array([1.0, 0.6, 0.0]), np.array([1.0, -2.2, 0.6])


def saturated(noise=0.05, n=3000, b1=B1, b2=B2):
    rng = np.random.default_rng(3)
    u = rng.standard_normal(n)
    x = lfilter(b1, WRONG_MINIMUM_A1, u)
    clean = lfilter(b2, WRONG_MINIMUM_A2, np.tanh(1.5 * x / np.std(x)))
    y = clean + noise * np.std(clean) * rng.standard_normal(n)
    data = record(u[:, None], y, np.arange(n) == 0)
    return data, (noise * np.std(clean)) ** 2 * data.counts.sum()


def start(b1, a1, b2, a2):
    return FittedChain(b1[None, :], a1, b2, a2, LAW, LAW.weights)


@pytest.mark.parametrize(
    "wrong",
    [
        start(B1, WRONG_MINIMUM_A1, np.array([1.0, -0.5, 0.1]), WRONG_MINIMUM_A2),
        start(np.array([1.0, 0.2]), np.array([1.0, -0.7]), B2, WRONG_MINIMUM_A2),
        start(B1, WRONG_MINIMUM_A1, np.array([1.0, 0.2]), np.array([1.0, -0.5])),
    ],
    ids=["a zero inside the circle", "a resonance missing before the law", "a pole missing behind it"],
)
def test_it_ends_at_the_noise(wrong):
    data, noise = saturated()
    assert improved(refine(wrong, data, 40), data, grown).cost < 1.05 * noise


@pytest.mark.parametrize(
    ("true", "wrong"),
    [(([0.0, -0.6], [1.88, 0.32]), ([0.0, -0.6], [0.25 + 0.2j, 0.25 - 0.2j])),
     (([1.67, -0.15], [-1.47, 0.57]), ([0.67, 0.4], [2.37, 0.05]))],
    ids=["of the first block", "of the second"],
)  # fmt: skip
def test_a_zero_crosses_the_circle_without_a_further_pole(true, wrong):
    """The one that has to cross is not the one that began on the wrong side."""
    (b1, b2), (c1, c2) = ([np.poly(zeros).real for zeros in blocks] for blocks in (true, wrong))
    data, noise = saturated(b1=b1, b2=b2)
    fitted = refine(start(c1, WRONG_MINIMUM_A1, c2, WRONG_MINIMUM_A2), data, 40)
    assert fitted.cost > 2.0 * noise
    assert improved(fitted, data, reflected).cost < 1.05 * noise


def test_what_is_right_stays():
    data, _ = saturated()
    fitted = refine(start(B1, WRONG_MINIMUM_A1, B2, WRONG_MINIMUM_A2), data, 40)
    assert improved(fitted, data, grown) is fitted


def test_it_never_ends_worse():
    data, _ = saturated(n=800)
    for seed in range(4):
        rng = np.random.default_rng(seed)
        fitted = refine(
            start(rng.standard_normal(2), WRONG_MINIMUM_A2[:2], rng.standard_normal(3), WRONG_MINIMUM_A2), data, 5
        )
        assert improved(fitted, data, grown).cost <= fitted.cost


def test_two_gains_about_a_law_have_no_move():
    data, _ = saturated(n=800)
    one = np.ones(1)
    data = data._replace(y=np.tanh(data.u[0]) + 0.1 * np.random.default_rng(0).standard_normal(800))
    fitted = refine(start(one, one, one, one), data, 10)
    assert improved(fitted, data, grown) is fitted


RNG = np.random.default_rng(0)


@pytest.mark.parametrize("shape", [lambda x: np.minimum(x, 0.4), np.abs, lambda x: x + 0.5 * x**2])
def test_a_chain_is_found_from_the_record_alone(shape):
    u = RNG.standard_normal(2000)
    clean = lfilter([1.0, 0.4], [1.0, -0.5], shape(lfilter([0.5, 0.2], [1.0, -0.6], u)))
    y = clean + 0.02 * np.std(clean) * RNG.standard_normal(2000)
    data = record(u[:, None], y, np.arange(2000) == 0)
    found = search(data, as_law("cubic_spline"), (SearchedOrders(((2, 2),), square(1)),))
    error = (clean - run(found.chain, data).y)[data.counts]
    assert np.std(error) < 0.015 * np.std(clean)
    assert found.chain.stable


def test_a_chain_of_given_orders_leaves_the_wrong_side_of_the_circle():
    """Three slow lags behind a hold have a zero outside it; the divisions led to 3.5 times the noise."""
    rng = np.random.default_rng(7)
    u = np.repeat(rng.normal(size=150), 10)
    poles = np.poly([np.exp(-1.0 / (12.0 * k)) for k in (0.8, 1.0, 1.3)])
    x = lfilter([1.0, 2.7, 0.8], poles, u)
    x /= x.std()
    y = lfilter([0.2], [1.0, -0.8], x + 0.15 * x**2 + 0.2 * x**3)
    noise = 0.03 * y.std() * rng.normal(size=y.size)
    data = record(u[:, None], y + noise, np.arange(y.size) == 0)
    structure = SearchedOrders(((4, 2), (3, 2)), Orders(2, 3, 0, 1), exact=True)
    found = search(data, as_law("polynomial"), (structure,))
    assert squared_error(found.chain, data) < 1.05 * float(noise[data.counts] @ noise[data.counts])


def test_every_way_to_divide_the_poles_goes_on_before_a_second_of_any():
    law = FrictionLaw([Power(1.0, 1.0)])

    def candidate(n1, n2, cost):
        a1, a2 = (np.append(1.0, np.zeros(n)) for n in (n1, n2))
        return Fitted(FittedChain(np.ones((1, 1)), a1, np.ones(1), a2, law, np.ones(1)), np.zeros(1), cost)

    pool = [candidate(3, 5, c) for c in (1.0, 1.1, 1.2)] + [candidate(3, 3, 2.0), candidate(3, 3, 2.5)]
    kept = best_in_turn(pool, 3)
    assert [f.cost for f in kept] == [1.0, 2.0, 1.1]
    assert [f.cost for f in best_in_turn(pool, 9)] == [1.0, 2.0, 1.1, 2.5, 1.2]


# --- Data that no candidate has seen decide, and a simpler one is taken where they do not ---------------------------
LINEAR = FrictionLaw([Power(1.0, 1)])
N = 4000


def gain(k, error, extra=0):
    """y = k u, with surplus zeros that do nothing, and the error that it is said to have left in the fit."""
    one = np.ones(1)
    return Fitted(
        FittedChain(np.append(k, np.zeros(extra))[None, :], one, one, one, LINEAR, one), error, float(error @ error)
    )


@pytest.fixture
def later():
    rng = np.random.default_rng(0)
    u = rng.standard_normal(N)
    data = record(u[:, None], u + 0.1 * rng.standard_normal(N), np.arange(N) == 0)
    return data._replace(counts=np.arange(N) >= N // 2)


ERROR = 0.1 * np.random.default_rng(1).standard_normal(3000)


def test_the_simplest_of_equals(later):
    candidates = [gain(1.0, ERROR), gain(1.0, 0.9999 * ERROR, 2), gain(1.0005, 0.9999 * ERROR, 4)]
    assert simplest(candidates, later) is candidates[0]


@pytest.mark.parametrize("k", [0.96, 0.985, np.inf])
def test_what_is_worse_on_the_held_out_data_is_not_taken(later, k):
    """By more than 3 % of the error, by less but three standard errors, or altogether."""
    candidates = [gain(k, ERROR), gain(1.0, 0.9999 * ERROR, 2)]
    assert simplest(candidates, later) is candidates[1]


def test_one_sample_that_is_missed_by_far_counts_although_it_makes_the_mean_uncertain(later):
    """The standard error of a difference that stands in one batch is as large as the difference."""
    u = later.u.copy()
    u[0, 3000] = 100.0
    y = later.y.copy()
    y[3000] = 100.0
    candidates = [gain(0.985, ERROR), gain(1.0, 0.9999 * ERROR, 2)]
    assert simplest(candidates, later._replace(u=u, y=y)) is candidates[1]


def test_what_further_parameters_gain_in_the_fit_counts_where_held_out_data_agree(later):
    """A gain that chance does not give, and a difference of less than two standard errors on the held-out data."""
    candidates = [gain(0.9985, 1.01 * ERROR), gain(1.0, ERROR, 2)]
    assert simplest(candidates, later) is candidates[1]
    assert simplest([gain(0.9985, 1.0005 * ERROR), candidates[1]], later).chain.b1[0, 0] == 0.9985


def test_orders_are_split_of_linear_models_that_hold_them():
    (small,) = of_orders(np.array([2, 2, 2, 2, 1]))
    assert small.linear[0] == (4, 2)
    (large,) = of_orders(np.array([6, 8, 6, 8, 1]))
    assert max(large.linear[0]) == LARGEST_LINEAR
