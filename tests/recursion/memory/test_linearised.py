"""The memory linearised with its signs frozen, and what a page leaves of itself."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from tests.recursion.reruns import replay
from whsklearn import WienerHammersteinSystem
from whsklearn.datasets import make_wiener_hammerstein
from whsklearn.recursion.memory.gauss_newton import Memory, new_work
from whsklearn.recursion.memory.linearised import (
    Linearisation,
    Signs,
    curvature,
    deviation,
    filtered,
    flattened,
    has_posterior,
    initial_past,
    jumps,
    moved,
    stored,
    unpacked,
)
from whsklearn.recursion.memory.settings import Settings
from whsklearn.recursion.rows.predictor import record_errors, state_size

EXAMPLE = WienerHammersteinSystem.example()
DIMS = np.array([2, 2, 2, 2, 3])
LAW = DIMS, EXAMPLE.law.codes, EXAMPLE.law.shapes
TRUTH = np.concatenate([EXAMPLE.a[1:], EXAMPLE.b, EXAMPLE.law.weights, EXAMPLE.c[1:], EXAMPLE.d])
N, HISTORY = 300, 2
READING = Settings(
    dims=DIMS, codes=LAW[1], shapes=LAW[2], p=4, p0=1e6, forgetting=1.0, n_starts=4, memory=256, frozen=False, seed=0
)


@pytest.fixture(scope="module")
def record():
    X, y = make_wiener_hammerstein(N, snr_db=20, random_state=0)
    restart = np.zeros(N, dtype=bool)
    restart[[0, 140]] = True
    u = np.concatenate([np.zeros((HISTORY, 1)), X])
    y = np.concatenate([np.zeros(HISTORY), y])
    return Memory(np.zeros(state_size(DIMS)), u, y, restart, N, HISTORY, 1, np.ones(N))


def listed(page, record, chosen, theta=TRUTH, first=0):
    """The signs of the samples ``chosen``."""
    experiment = np.cumsum(record.restart)
    bent = curvature(filtered(page.gradient, record.restart, LAW, theta), experiment, LAW, chosen)
    return page.entries(chosen, experiment, bent, page.heights(chosen), first)


def linearised(record, theta):
    memory = Linearisation(theta, LAW, record, new_work(DIMS, 1))
    while memory.done < N:
        memory.read_segment()
    return memory


def test_errors_are_those_of_the_true_sign_and_gradients_those_of_the_smooth_part(record):
    page = linearised(record, TRUTH)
    errors = np.empty(N)
    record_errors(
        TRUTH, *LAW, np.inf, record.u[HISTORY:], record.y[HISTORY:], record.restart, errors, np.empty((0, TRUTH.size))
    )
    np.testing.assert_allclose(page.rows[:, -1], errors, atol=1e-12)
    step = 1e-7
    for k in range(TRUTH.size):
        there = linearised(record, TRUTH + step * np.eye(TRUTH.size)[k])
        same = np.sign(there.motion[:, 1]) == np.sign(page.motion[:, 1])
        assert same.all()
        np.testing.assert_allclose((page.rows[:, -1] - there.rows[:, -1]) / step, page.rows[:, k], atol=1e-4)
        if k < 3:
            slope = (there.motion[:, 1] - page.motion[:, 1]) / step
            np.testing.assert_allclose(slope, page.gradient[:, k], atol=1e-4)


def test_it_goes_on_from_a_state_as_if_it_had_read_what_came_before(record):
    cut, system = 150, linearised(record, TRUTH)
    state, work = np.zeros(state_size(DIMS)), np.zeros((9, 9))
    replay(TRUTH, LAW, np.inf, record._replace(fill=cut), work, np.zeros(9), state)
    rest = Memory(state, record.u[cut:], record.y[cut:], record.restart[cut:], N - cut, HISTORY, 1, np.ones(N - cut))
    later = Linearisation(TRUTH, LAW, rest, new_work(DIMS, 1))
    while later.done < N - cut:
        later.read_segment()
    for name in ("rows", "motion", "gradient"):
        np.testing.assert_allclose(getattr(later, name), getattr(system, name)[cut:], atol=1e-12)


def test_a_sign_enters_the_rows_after_it_but_for_those_of_another_experiment(record):
    page = linearised(record, TRUTH)
    signs = listed(page, record, np.array([10, 138, 139, N - 1]), first=1000)
    # the last one enters rows of the next page, 1300 and 1301, which are not known yet
    assert signs.at.tolist() == [[1011, 1012], [1139, -1], [-1, -1], [-1302, -1303]]
    np.testing.assert_array_equal(signs.rows[0], page.rows[11:13])
    assert not signs.rows[1, 1].any()
    assert signs.height[0].tolist() == [0.0, 1.0, 0.0]  # of the three terms only Coulomb friction jumps


def test_the_last_sign_of_a_page_enters_the_first_rows_of_the_next_one(record):
    page = linearised(record, TRUTH)
    signs = listed(page, record, np.array([10, N - 2, N - 1]))
    psi, restart = np.random.default_rng(0).standard_normal((4, TRUTH.size + 1)), np.zeros(4, dtype=bool)
    met = signs.met(psi, restart, N)
    assert met.at.tolist() == [[11, 12], [N - 1, N], [N, N + 1]]
    np.testing.assert_array_equal(met.rows[2], psi[:2])
    np.testing.assert_array_equal(met.rows[1], [page.rows[N - 1], psi[0]])
    np.testing.assert_array_equal(met.rows[0], signs.rows[0])
    restart[1] = True
    assert signs.met(psi, restart, N).at.tolist() == [[11, 12], [N - 1, N], [N, -1]]
    assert signs.met(psi[:0], restart[:0], N).at.tolist() == signs.at.tolist()


@pytest.mark.parametrize("theta", [TRUTH, np.concatenate([[0.5], [0.4, -0.3], TRUTH[3:]])])
def test_signs_move_with_the_parameters_to_second_order(record, theta):
    chosen = np.arange(N)
    here = linearised(record, theta)
    signs = listed(here, record, chosen, theta)
    errors = []
    for size in (4e-3, 2e-3):
        delta = np.zeros(theta.size)
        delta[:3] = size * np.array([1.0, 0.6, -0.8])
        there = linearised(record, theta + delta)
        shifted = signs.shifted(delta)
        errors.append(np.abs(shifted.dx - there.motion[:, 1]).max())
        slope = np.abs(shifted.gradient - there.gradient).max()
        assert slope < 0.05 * np.abs(here.gradient - there.gradient).max()
        assert errors[-1] < 0.02 * np.abs(signs.dx + signs.gradient @ delta[:3] - there.motion[:, 1]).max()
    assert errors[1] < 0.2 * errors[0]  # of third order


def test_which_terms_jump():
    assert jumps(EXAMPLE.law.codes).tolist() == [False, True, False]


def test_deviation_is_the_root_of_the_quadratic_form():
    g = np.array([[1.0, 2.0], [0.0, 3.0]])
    covariance = np.array([[1.0, 0.5], [0.5, 2.0]])
    expected = np.sqrt(np.diag(g @ covariance @ g.T))
    np.testing.assert_allclose(deviation(g, covariance), expected)


LONG, CUT = 1300, 700


def gradients(a, b, u):
    """d dx / d(a, b) of two experiments."""

    def one(u):
        x = lfilter(np.append(0.0, np.append(1.0, a)), np.append(1.0, b), u)
        held = [lfilter([1.0], np.append(1.0, b), np.append(np.zeros(k), u)[: u.size]) for k in range(2, 2 + a.size)]
        held += [-lfilter([1.0], np.append(1.0, b), np.append(np.zeros(k), x)[: x.size]) for k in range(1, 1 + b.size)]
        return np.diff(np.array(held), prepend=0.0, axis=1).T

    return np.vstack([one(u[:CUT]), one(u[CUT:])])


def test_curvatures_are_the_slopes_of_the_gradients():
    u = np.random.default_rng(0).standard_normal(LONG)
    a, b = np.array([0.7, -0.2]), np.array([-1.1, 0.5, -0.1])
    gradient = gradients(a, b, u)
    restart = np.zeros(LONG, dtype=bool)
    restart[[0, CUT]] = True
    chosen = np.array([0, 1, 5, 511, 512, 513, 699, 700, 701, 1299])
    law = np.array([3, 3, 1, 0, 1]), LAW[1], LAW[2]
    bent = curvature(filtered(gradient, restart, law, np.concatenate([a, b])), np.cumsum(restart), law, chosen)
    for k in range(5):
        step = 1e-6 * np.eye(5)[k]
        slope = (gradients(a + step[:2], b + step[2:], u) - gradients(a - step[:2], b - step[2:], u))[chosen] / 2e-6
        np.testing.assert_allclose(bent[:, :, k], slope, atol=1e-6)
    np.testing.assert_array_equal(bent, bent.transpose(0, 2, 1))


def test_without_a_denominator_nothing_is_bent():
    law = np.array([3, 0, 1, 0, 1]), LAW[1], LAW[2]
    f = filtered(np.ones((9, 2)), np.zeros(9, dtype=bool), law, np.ones(2))
    bent = curvature(f, np.zeros(9, dtype=int), law, np.arange(3))
    assert bent.shape == (3, 2, 2)
    assert not bent.any()


def test_moved_is_the_matrix_of_the_moved_rows():
    rows = np.random.default_rng(0).standard_normal((30, 4))
    delta = np.array([0.3, -0.1, 0.2])
    after = rows.copy()
    after[:, -1] -= rows[:, :-1] @ delta
    np.testing.assert_allclose(moved(rows.T @ rows, delta), after.T @ after)


def test_the_state_keeps_signs_as_they_are():
    state, rng = initial_past(READING), np.random.default_rng(0)
    signs = Signs(
        rng.standard_normal(5), np.array([1.0, -1, 1, 1, -1]), np.ones(5), rng.standard_normal((5, 3)),
        rng.standard_normal((5, 3, 3)), rng.standard_normal((5, 3)), rng.standard_normal((5, 2, 10)),
        np.arange(10).reshape(5, 2),
    )  # fmt: skip
    for a, b in zip(signs, unpacked(stored(flattened(signs), signs.at, state), READING), strict=True):
        np.testing.assert_array_equal(a, b)


def test_only_a_law_that_jumps_behind_an_unknown_block_has_signs_in_doubt():
    assert has_posterior(READING)
    assert not has_posterior(replace(READING, memory=0))
    assert not has_posterior(replace(READING, codes=np.zeros(3, dtype=int)))
    assert not has_posterior(replace(READING, dims=np.array([1, 0, 2, 2, 3])))
