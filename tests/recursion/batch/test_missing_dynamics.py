"""The score test finds a pole that a chain lacks, in its block and near its place, and none where none is missing."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from whsklearn.effects import as_law
from whsklearn.recursion.batch.missing_dynamics import missing_poles, with_pole
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
