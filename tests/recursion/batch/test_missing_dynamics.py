"""The score test finds a pole that a chain lacks, in its block and near its place, and none where none is missing."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from whsklearn.effects import as_law
from whsklearn.recursion.batch import missing_dynamics
from whsklearn.recursion.batch.missing_dynamics import improved, missing_poles, with_pole
from whsklearn.recursion.batch.simulation_error import FittedChain, refine, run
from whsklearn.recursion.batch.simulation_search import record

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
    first = missing_poles(short, data, 8, 2)[0]
    grown = (first.chain.a1, first.chain.a2)[block]
    assert grown.size == (a1, a2)[block].size + 2
    refined = refine(first.chain, data, 40)
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
    for promise in promises:
        fall = fitted.cost - refine(promise.chain, data, 40).cost
        assert 0.5 * promise.gain < fall < 3 * promise.gain


def test_nothing_is_promised_where_nothing_is_missing():
    """One grid in a hundred may; more than two of thirty would have a chance of 0.3 %."""
    truth = chain(A1, A2)
    records = [answered(truth, seed, n=1500) for seed in range(30)]
    assert sum(bool(missing_poles(refine(truth, data, 30), data, 8, 1)) for data in records) <= 2


def test_no_block_outgrows_what_it_may_have():
    data = answered(chain(A1, A2), 1)
    short = refine(chain(np.array([1.0, -0.5]), A2), data, 40)
    for promise in missing_poles(short, data, 2, 3):
        assert max(promise.chain.a1.size, promise.chain.a2.size) - 1 <= 2


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
    assert improved(refine(wrong, data, 40), data).cost < 1.05 * noise


@pytest.mark.parametrize(
    ("true", "wrong"),
    [(([0.0, -0.6], [1.88, 0.32]), ([0.0, -0.6], [0.25 + 0.2j, 0.25 - 0.2j])),
     (([1.67, -0.15], [-1.47, 0.57]), ([0.67, 0.4], [2.37, 0.05]))],
    ids=["of the first block", "of the second"],
)  # fmt: skip
def test_a_zero_crosses_the_circle_without_a_further_pole(monkeypatch, true, wrong):
    """The one that has to cross is not the one that began on the wrong side."""
    monkeypatch.setattr(missing_dynamics, "missing_poles", lambda *_: [])
    (b1, b2), (c1, c2) = ([np.poly(zeros).real for zeros in blocks] for blocks in (true, wrong))
    data, noise = saturated(b1=b1, b2=b2)
    fitted = refine(start(c1, WRONG_MINIMUM_A1, c2, WRONG_MINIMUM_A2), data, 40)
    assert fitted.cost > 2.0 * noise
    assert improved(fitted, data).cost < 1.05 * noise


def test_what_is_right_stays():
    data, _ = saturated()
    fitted = refine(start(B1, WRONG_MINIMUM_A1, B2, WRONG_MINIMUM_A2), data, 40)
    assert improved(fitted, data) is fitted


def test_it_never_ends_worse():
    data, _ = saturated(n=800)
    for seed in range(4):
        rng = np.random.default_rng(seed)
        fitted = refine(
            start(rng.standard_normal(2), WRONG_MINIMUM_A2[:2], rng.standard_normal(3), WRONG_MINIMUM_A2), data, 5
        )
        assert improved(fitted, data).cost <= fitted.cost


def test_two_gains_about_a_law_have_no_move():
    data, _ = saturated(n=800)
    one = np.ones(1)
    data = data._replace(y=np.tanh(data.u[0]) + 0.1 * np.random.default_rng(0).standard_normal(800))
    fitted = refine(start(one, one, one, one), data, 10)
    assert improved(fitted, data) is fitted
