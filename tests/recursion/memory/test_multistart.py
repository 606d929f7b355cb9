"""The default reading as a stream: starts side by side and a memory of bounded length."""

from __future__ import annotations

import numpy as np
import pytest

from tests.recursion.starts_side_by_side import EXAMPLE, LINEAR, reading, sizes, streamed
from whsklearn.datasets import make_wiener_hammerstein
from whsklearn.recursion.memory import multistart
from whsklearn.recursion.memory.schedule import schedule


@pytest.mark.parametrize("memory", [0, 128])
def test_the_state_is_of_one_size_whatever_the_length(memory):
    X, y = make_wiener_hammerstein(3000, random_state=1)
    r = reading(EXAMPLE, memory=memory, n_starts=2)
    early, late = streamed(r, X[:1000], y[:1000]), streamed(r, X, y)
    assert sizes(early) == sizes(late)


@pytest.mark.parametrize("memory", [0, 96, 200])
@pytest.mark.parametrize("frozen", [True, False])
def test_chunks_make_no_difference(memory, frozen):
    X, y = make_wiener_hammerstein(420, random_state=2)
    r = reading(EXAMPLE, memory=memory, frozen=frozen, n_starts=3)
    whole = streamed(r, X, y, restart_at=(70, 71, 200))
    for chunks in (3, 420):
        cut = streamed(r, X, y, chunks, restart_at=(70, 71, 200))
        for name in whole:
            np.testing.assert_array_equal(whole[name], cut[name], err_msg=name)


def test_poor_starts_are_dropped_as_the_memory_fills():
    r = reading(EXAMPLE, n_starts=8, memory=1024)
    X, y = make_wiener_hammerstein(r.page_end, random_state=3)
    instants = [end for _, end in schedule(r, filling=True)]
    counts = [len(streamed(r, X[:n], y[:n])["theta"]) for n in (instants[0] - 1, *instants)]
    assert len(counts) == 4
    assert counts[0] == 1  # silent until the first re-run takes over
    assert 1 == counts[3] <= counts[2] <= counts[1] <= 8


def test_the_answer_is_the_model_with_the_least_innovation_variance():
    loss = np.array([[4.0, 2.0], [9.0, 9.0], [5.0, 1.0]])
    assert multistart.answer({"loss": loss}) == 1


def test_p0_is_a_prior_in_the_units_of_the_log():
    """Ten times the output, the same estimate in other units."""
    X, y = make_wiener_hammerstein(100, random_state=4, system=LINEAR)
    r = reading(LINEAR, p0=1.0)
    a, b = streamed(r, X, y), streamed(r, X, 10.0 * y)
    for state in (a, b):
        multistart.consolidate(state, r)
    scale = np.array([10.0, 10.0, 1.0, 1.0])  # the weights carry the unit of y
    np.testing.assert_allclose(b["theta"][0], scale * a["theta"][0], rtol=1e-4)


@pytest.mark.parametrize("memory", [0, 100])
@pytest.mark.parametrize("forgetting", [0.9, 1.0])
def test_an_idle_axis_does_no_harm(memory, forgetting):
    """Zeros for a long time: P neither overflows nor dies, and the axis is found again."""
    X, y = make_wiener_hammerstein(600, snr_db=30, random_state=5, system=LINEAR)
    idle = np.zeros((8_000, 1))  # 0.9 ** -8000 is beyond the floats
    r = reading(LINEAR, memory=memory, forgetting=forgetting, n_starts=2)
    state = streamed(r, np.vstack([X, idle, X]), np.concatenate([y, idle[:, 0], y]))
    assert all(np.isfinite(v).all() for v in state.values() if isinstance(v, np.ndarray))
    assert (np.diagonal(state["ud"], axis1=1, axis2=2) > 0).all()
    truth = np.concatenate([LINEAR.law.weights, LINEAR.d])
    np.testing.assert_allclose(state["theta"][multistart.answer(state)], truth, atol=0.1)


def test_an_output_that_stands_still_is_taken():
    """Nothing to learn and nothing to trip over."""
    X = np.random.default_rng(0).standard_normal((300, 1))
    for level in (0.0, 5.0):
        r = reading(EXAMPLE, n_starts=2, memory=128)
        state = streamed(r, X, np.full(300, level))
        multistart.consolidate(state, r)
        assert all(np.isfinite(v).all() for v in state.values() if isinstance(v, np.ndarray))
