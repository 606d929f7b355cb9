"""The memory: a window re-run at full length, with what came before as a prior."""

from __future__ import annotations

import numpy as np
import pytest

from whsklearn import WienerHammersteinSystem
from whsklearn.datasets import make_wiener_hammerstein
from whsklearn.effects.law import polynomial_law
from whsklearn.recursion.gauss_newton import Prior, refine, refine_part, solve_damped
from whsklearn.recursion.memory_cost import BUDGET, COST, replay, work_size
from whsklearn.recursion.memory_cost import Memory as KeptSamples
from whsklearn.recursion.predictor import record_errors, state_size
from whsklearn.recursion.predictor_block import LENGTH
from whsklearn.systems.stability import is_stable

KAPPA = 3.0


def natural(system):
    return np.concatenate([system.a[1:], system.b, system.law.weights, system.c[1:], system.d])


class Memory:
    """A record in the form that `replay` takes, and what a plain run over it gives."""

    def __init__(self, system, n=120, seed=0, snr_db=15.0, restart_at=()):
        self.law = system.law
        self.dims = np.array(
            [system.a.size, system.b.size, system.c.size, system.d.size, len(system.law)], dtype=np.int64
        )
        self.X, self.y = make_wiener_hammerstein(n, snr_db=snr_db, random_state=seed, system=system)
        self.restart = np.zeros(n, dtype=bool)
        self.restart[[0, *restart_at]] = True
        self.still = np.zeros(n, dtype=bool)
        self.history = int(max(self.dims[0], self.dims[3], 1))
        self.n = natural(system).size

    @property
    def kernel(self):
        return self.dims, self.law.codes, self.law.shapes

    def padded(self, values):
        return np.concatenate([np.zeros((self.history, *values.shape[1:])), values])

    def shared(self, tail=1, forgetting=1.0, origin=None):
        origin = np.zeros(state_size(self.dims)) if origin is None else origin
        return KeptSamples(
            origin, self.padded(self.X), self.padded(self.y), self.restart, self.y.size, self.history, tail,
            forgetting ** np.arange(self.y.size)[::-1] * ~self.still[: self.y.size],
        )  # fmt: skip

    def replay(self, theta, kappa=KAPPA, **settings):
        information, slope = np.zeros((self.n, self.n)), np.zeros(self.n)
        state = np.zeros(state_size(self.dims))
        cost = replay(theta, self.kernel, kappa, self.shared(**settings), information, slope, state)
        return cost, information, slope, state

    def errors(self, theta, kappa=KAPPA):
        e, rows = np.empty(self.y.size), np.empty((self.y.size, self.n))
        law = self.law.codes, self.law.shapes
        record_errors(theta, self.dims, *law, kappa, self.X, self.y, self.restart, e, rows)
        return e, rows

    def refine(self, theta, prior_theta, prior_information, iterations=30, **settings):
        information, state = np.zeros((self.n, self.n)), np.zeros(state_size(self.dims))
        prior = Prior(prior_theta, prior_information)
        cost = refine(theta, self.kernel, KAPPA, self.shared(**settings), prior, iterations, information, state)
        return cost, information


LINEAR = WienerHammersteinSystem([1.0], [], [1.0], [0.3, -0.2], polynomial_law([0.0, 1.0, 0.5]))


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
    assert solve_damped(a, right, 0.5, solution)
    np.testing.assert_allclose(solution, np.linalg.solve(a + 0.5 * np.diag(np.diag(a)), right), rtol=1e-9)
    assert not solve_damped(-a, right, 0.0, solution)


@pytest.mark.parametrize("budget", [1, 37, 1000])
def test_in_parts_it_is_the_same_to_the_bit(budget):
    memory = Memory(WienerHammersteinSystem.example(), n=400, restart_at=(50, 300))
    nothing, theta = np.eye(9), np.full(9, 0.2)
    whole = theta.copy()
    cost, information = memory.refine(whole, np.zeros(9), nothing, 3)
    got, state = np.zeros((9, 9)), np.zeros(state_size(memory.dims))
    work, parts = np.zeros(work_size(memory.dims, state.size)), 1
    work[BUDGET] = budget
    prior = Prior(np.zeros(9), nothing)
    while not refine_part(theta, memory.kernel, KAPPA, memory.shared(), prior, 3, got, state, work):
        work[BUDGET], parts = budget, parts + 1
    assert parts >= 400 * 2 / (budget + LENGTH)  # a part is one stretch at least, and ends with the stretch it is in
    assert work[COST] == cost
    np.testing.assert_array_equal(theta, whole)
    np.testing.assert_array_equal(got, information)


def test_what_stands_still_weighs_nothing():
    memory = Memory(WienerHammersteinSystem.example())
    theta = natural(WienerHammersteinSystem.example()) * 0.9
    e, rows = memory.errors(theta)
    memory.still[40:70] = True
    moving = np.r_[0:40, 70:120]
    cost, information, _, _ = memory.replay(theta)
    assert cost == pytest.approx(np.sum(e[moving] ** 2))
    np.testing.assert_allclose(information, rows[moving].T @ rows[moving], rtol=1e-9, atol=1e-12)
