"""The memory: a window re-run at full length, with what came before as a prior."""

from __future__ import annotations

import numpy as np
import pytest

from tests.recursion.kept_record import KAPPA, Memory, natural
from tests.recursion.reruns import replay
from whsklearn import WienerHammersteinSystem
from whsklearn.effects.law import polynomial_law
from whsklearn.recursion.memory.gauss_newton import BUDGET, COST, Prior, new_work, refine_part, solve_damped
from whsklearn.recursion.memory.gauss_newton import Memory as KeptSamples
from whsklearn.recursion.memory.predictor_block import LENGTH
from whsklearn.recursion.rows.predictor import state_size
from whsklearn.systems.stability import is_stable

LINEAR = WienerHammersteinSystem([1.0], [], [1.0], [0.3, -0.2], polynomial_law([0.0, 1.0, 0.5]))


def test_for_a_linear_model_one_re_run_is_batch_least_squares():
    memory = Memory(LINEAR)
    theta = np.zeros(memory.n)
    _, rows = memory.errors(theta)
    cost, information = memory.refine(theta, np.zeros(memory.n), np.zeros((memory.n, memory.n)))
    batch, residual = np.linalg.lstsq(rows, memory.y, rcond=None)[:2]
    np.testing.assert_allclose(theta, batch, rtol=1e-6)
    assert cost == pytest.approx(residual[0], rel=1e-9)
    np.testing.assert_allclose(information, rows.T @ rows, rtol=1e-9)


def test_the_prior_is_a_gaussian_one():
    memory = Memory(LINEAR)
    rng = np.random.default_rng(1)
    mean, root = rng.standard_normal(memory.n), rng.standard_normal((memory.n, memory.n))
    prior = 40.0 * root @ root.T
    theta = np.zeros(memory.n)
    _, rows = memory.errors(theta)
    cost, information = memory.refine(theta, mean, prior)
    np.testing.assert_allclose(information, rows.T @ rows + prior, rtol=1e-9)
    expected = np.linalg.solve(information, rows.T @ memory.y + prior @ mean)
    np.testing.assert_allclose(theta, expected, rtol=1e-5)
    e = memory.y - rows @ theta
    assert cost == pytest.approx(e @ e + (theta - mean) @ prior @ (theta - mean))


def test_refining_never_makes_it_worse_and_keeps_l1_stable():
    system = WienerHammersteinSystem.example()
    memory = Memory(system)
    nothing = np.zeros((9, 9))
    for seed in range(10):
        theta = np.random.default_rng(seed).normal(0, 0.4, 9)
        theta[1:3] = 0.3, 0.2
        before = memory.replay(theta)[0]
        after = memory.refine(theta, np.zeros(9), nothing)[0]
        assert after <= before
        assert is_stable(theta[1:3].copy(), 0.999)
        assert memory.replay(theta)[0] == pytest.approx(after)


def test_refining_finds_the_truth_from_nearby():
    """Noise-free with a smooth law the re-run converges to the last digits."""
    system = WienerHammersteinSystem([1.0, 0.5], [-0.4], [1.0, 0.3], [0.2], polynomial_law([0.0, 1.0, 0.3, -0.1]))
    memory = Memory(system, snr_db=None)
    theta = natural(system) * 1.1
    assert memory.refine(theta, np.zeros(memory.n), np.zeros((memory.n, memory.n)))[0] < 1e-18
    np.testing.assert_allclose(theta, natural(system), rtol=1e-7)


def test_the_damped_solve():
    rng = np.random.default_rng(0)
    root = rng.standard_normal((5, 5))
    a, right, solution = root @ root.T + 0.1 * np.eye(5), rng.standard_normal(5), np.empty(5)
    assert solve_damped(a, right, 0.5, solution, np.empty((5, 5)))
    np.testing.assert_allclose(solution, np.linalg.solve(a + 0.5 * np.diag(np.diag(a)), right), rtol=1e-9)
    assert not solve_damped(-a, right, 0.0, solution, np.empty((5, 5)))


@pytest.mark.parametrize("budget", [1, 37, 1000])
def test_in_parts_it_is_the_same_to_the_bit(budget):
    memory = Memory(WienerHammersteinSystem.example(), n=400, restart_at=(50, 300))
    nothing, theta = np.eye(9), np.full(9, 0.2)
    whole = theta.copy()
    cost, information = memory.refine(whole, np.zeros(9), nothing, 3)
    got, state = np.zeros((9, 9)), np.zeros(state_size(memory.dims))
    work, parts = new_work(memory.dims, 1), 1
    work.at[BUDGET] = budget
    prior = Prior(np.zeros(9), nothing)
    while not refine_part(theta, memory.kernel, KAPPA, memory.shared(), prior, 3, got, state, work):
        work.at[BUDGET], parts = budget, parts + 1
    assert parts >= 400 * 2 / (budget + LENGTH)  # a part is one segment at least, and ends with the segment it is in
    assert work.at[COST] == cost
    np.testing.assert_array_equal(theta, whole)
    np.testing.assert_array_equal(got, information)


# --- The replay of a memory: cost, gradient and information of a plain run, weighted --------------------------------
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
