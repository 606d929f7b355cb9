"""The replay of a memory: cost, gradient and information of a plain run, weighted."""

from __future__ import annotations

import numpy as np
import pytest

from tests.recursion.kept_record import KAPPA, Memory, natural
from tests.recursion.reruns import replay
from whsklearn import WienerHammersteinSystem
from whsklearn.recursion.memory.cost import Memory as KeptSamples


@pytest.mark.parametrize("tail", [1, 4])
@pytest.mark.parametrize("forgetting", [1.0, 0.97])
def test_a_replay_is_the_plain_run_weighted(tail, forgetting):
    memory = Memory(WienerHammersteinSystem.example(), restart_at=(50,))
    theta = natural(WienerHammersteinSystem.example()) * 0.9
    e, rows = memory.errors(theta)
    age = np.arange(e.size)[::-1]
    weights = np.minimum((age + 1) / tail, 1.0) * forgetting**age
    cost, information, slope, _ = memory.replay(theta, tail=tail, forgetting=forgetting)
    assert cost == pytest.approx(weights @ e**2)
    np.testing.assert_allclose(information, (rows * weights[:, None]).T @ rows, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(slope, rows.T @ (weights * e), rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("tail", [1, 4])
def test_the_state_handed_over_is_where_the_next_window_starts(tail):
    """A run over all is a run over the first part, then one from the state handed over."""
    system = WienerHammersteinSystem.example()
    theta = natural(system) * 0.9
    whole = Memory(system, n=100)
    e, _ = whole.errors(theta)
    first = Memory(system, n=100)
    cut = 60
    first.X, first.y, first.restart = whole.X[:cut], whole.y[:cut], whole.restart[:cut]
    _, _, _, state = first.replay(theta, tail=tail)
    begin = cut - tail + 1
    rest = Memory(system, n=100)
    h = rest.history
    information, slope, end = np.zeros((9, 9)), np.zeros(9), np.zeros_like(state)
    left = 100 - begin
    kept = KeptSamples(
        state, whole.X[begin - h :], whole.y[begin - h :], np.zeros(left, dtype=bool), left, h, 1, np.ones(left)
    )
    cost = replay(theta, rest.kernel, KAPPA, kept, information, slope, end)
    assert cost == pytest.approx(np.sum(e[begin:] ** 2))


def test_what_stands_still_weighs_nothing():
    memory = Memory(WienerHammersteinSystem.example())
    theta = natural(WienerHammersteinSystem.example()) * 0.9
    e, rows = memory.errors(theta)
    memory.still[40:70] = True
    moving = np.r_[0:40, 70:120]
    cost, information, _, _ = memory.replay(theta)
    assert cost == pytest.approx(np.sum(e[moving] ** 2))
    np.testing.assert_allclose(information, rows[moving].T @ rows[moving], rtol=1e-9, atol=1e-12)
