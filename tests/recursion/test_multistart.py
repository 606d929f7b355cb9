"""The default reading as a stream: starts side by side and a memory of bounded length."""

from __future__ import annotations

import numpy as np
import pytest

from whsklearn import WienerHammersteinSystem
from whsklearn.datasets import make_wiener_hammerstein
from whsklearn.effects.law import polynomial_law
from whsklearn.recursion import multistart
from whsklearn.recursion.covariance import covariance
from whsklearn.recursion.predictor import record_errors

LINEAR = WienerHammersteinSystem([1.0], [], [1.0], [0.3, -0.2], polynomial_law([0.0, 1.0, 0.5]))
EXAMPLE = WienerHammersteinSystem.example()


def reading(system, **settings):
    dims = np.array([system.a.size, system.b.size, system.c.size, system.d.size, len(system.law)], dtype=np.int64)
    defaults = {"p": 4, "p0": 100.0, "forgetting": 1.0, "n_starts": 4, "memory": 256, "frozen": False, "seed": 0}
    return multistart.Reading(dims=dims, codes=system.law.codes, shapes=system.law.shapes, **defaults | settings)


def streamed(r, X, y, chunks=1, restart_at=()):
    restart = np.zeros(len(y), dtype=bool)
    restart[[0, *restart_at]] = True
    state = multistart.initial_state(r)
    for part in np.array_split(np.arange(len(y)), chunks):
        multistart.run(state, r, X[part], y[part], restart[part])
    return state


def sizes(state):
    return {name: np.shape(value) for name, value in state.items()}


def rows_of(system, X, y):
    r = reading(system)
    rows = np.empty((len(y), r.size))
    record_errors(np.zeros(r.size), *r.law, 1.0, X, y, np.arange(len(y)) == 0, np.empty(len(y)), rows)
    return rows


@pytest.fixture(scope="module")
def linear_record():
    return make_wiener_hammerstein(700, snr_db=20, random_state=0, system=LINEAR)


def test_a_memory_re_run_of_a_linear_model_is_batch_least_squares(linear_record):
    X, y = (v[:200] for v in linear_record)
    r = reading(LINEAR, memory=256)
    state = streamed(r, X, y)
    multistart.consolidate(state, r)
    rows = rows_of(LINEAR, X, y)
    weights = np.minimum(np.arange(len(y), 0, -1) / r.p, 1.0)  # the windows of p to come count the rest
    information = (rows * weights[:, None]).T @ rows + state["prior_information"][0]
    expected = np.linalg.solve(information, rows.T @ (weights * y) + state["prior_information"][0] @ np.zeros(4))
    np.testing.assert_allclose(state["theta"][0], expected, rtol=1e-5, atol=1e-9)
    np.testing.assert_allclose(np.linalg.inv(covariance(state["ud"][0])), information, rtol=1e-6, atol=1e-9)


def test_the_recursion_goes_on_from_a_re_run_as_if_it_had_been_linear_all_along(linear_record):
    """One sample on: the windows then count every sample but the last p - 1 in full."""
    X, y = linear_record
    r = reading(LINEAR, memory=256)
    state = streamed(r, X[:150], y[:150])
    multistart.consolidate(state, r)
    multistart.run(state, r, X[150:160], y[150:160], np.zeros(10, dtype=bool))
    rows = rows_of(LINEAR, X[:160], y[:160])
    weights = np.minimum(np.arange(160, 0, -1) / r.p, 1.0)
    information = (rows * weights[:, None]).T @ rows + state["prior_information"][0]
    np.testing.assert_allclose(np.linalg.inv(covariance(state["ud"][0])), information, rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(
        state["theta"][0], np.linalg.solve(information, rows.T @ (weights * y[:160])), rtol=1e-5, atol=1e-9
    )


def test_turning_the_page_loses_nothing_for_a_linear_model(linear_record):
    X, y = (v[:650] for v in linear_record)
    one, many = reading(LINEAR, memory=1024), reading(LINEAR, memory=100)
    whole, paged = streamed(one, X, y), streamed(many, X, y)
    for state, r in ((whole, one), (paged, many)):
        multistart.consolidate(state, r)
    assert paged["blocks"] == 6
    p_whole, p_paged = covariance(whole["ud"][0]), covariance(paged["ud"][0])
    np.testing.assert_allclose(p_paged, p_whole, rtol=0.01, atol=0.003 * np.abs(p_whole).max())
    errors = np.sqrt(np.diag(p_whole) * whole["loss"][0, 0] / whole["loss"][0, 1])
    assert (np.abs(paged["theta"][0] - whole["theta"][0]) / errors).max() < 0.2


@pytest.mark.parametrize("memory", [0, 128])
def test_the_state_is_of_one_size_whatever_the_length(memory):
    X, y = make_wiener_hammerstein(3000, random_state=1)
    r = reading(EXAMPLE, memory=memory, n_starts=2)
    early, late = streamed(r, X[:1000], y[:1000]), streamed(r, X, y)
    assert sizes(early) == sizes(late)


@pytest.mark.parametrize("memory", [0, 96])
@pytest.mark.parametrize("frozen", [True, False])
def test_chunks_make_no_difference(memory, frozen):
    X, y = make_wiener_hammerstein(260, random_state=2)
    r = reading(EXAMPLE, memory=memory, frozen=frozen, n_starts=3)
    whole = streamed(r, X, y, restart_at=(70, 71, 200))
    for chunks in (3, 260):
        cut = streamed(r, X, y, chunks, restart_at=(70, 71, 200))
        for name in whole:
            np.testing.assert_array_equal(whole[name], cut[name], err_msg=name)


def test_poor_starts_are_dropped_as_the_memory_fills():
    r = reading(EXAMPLE, n_starts=8, memory=512)
    X, y = make_wiener_hammerstein(768, random_state=3)
    counts = [len(streamed(r, X[:n], y[:n])["theta"]) for n in (191, 192, 512, 768)]
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


@pytest.mark.parametrize("factors", [(0.995, 0.995), (1.0, 0.99)])
def test_pages_forget_what_the_recursion_forgot(factors, linear_record):
    """A linear model over many pages is weighted least squares, the factors those that held when samples came."""
    X, y = (v[:650] for v in linear_record)
    state = None
    for part, forgetting in zip(np.array_split(np.arange(650), 2), factors, strict=True):
        r = reading(LINEAR, memory=100, forgetting=forgetting, p0=1e6)
        state = state or multistart.initial_state(r)
        multistart.run(state, r, X[part], y[part], part == 0)
    multistart.consolidate(state, r)
    assert state["blocks"] >= 5
    kept = np.repeat(factors, 325)
    weights = np.append(np.cumprod(kept[:0:-1])[::-1], 1.0)
    rows = rows_of(LINEAR, X, y) * np.sqrt(weights)[:, None]
    batch = np.linalg.lstsq(rows, y * np.sqrt(weights), rcond=None)[0]
    covariance_ = np.linalg.inv(rows.T @ rows)
    assert state["known"][0] == pytest.approx(weights.sum())
    np.testing.assert_allclose(covariance(state["ud"][0]), covariance_, rtol=0.1, atol=0.02 * covariance_.max())
    spread = np.sqrt(np.diag(covariance_) * np.mean((y - rows_of(LINEAR, X, y) @ batch) ** 2))
    assert (np.abs(state["theta"][0] - batch) / spread).max() < 0.3


@pytest.mark.parametrize("memory", [0, 100, 1000])
def test_the_past_can_be_let_go_however_long_it_was(memory):
    """A gain that doubles after 1,500 samples is found from 150 more."""
    other = WienerHammersteinSystem(LINEAR.a, LINEAR.b, LINEAR.c, LINEAR.d, polynomial_law([0.0, 2.0, 0.5]))
    (X, y), (X2, y2) = (make_wiener_hammerstein(1500, snr_db=25, random_state=1, system=s) for s in (LINEAR, other))
    r = reading(LINEAR, memory=memory, n_starts=2)
    state = streamed(r, X, y)
    multistart.forget_past(state, 10.0)
    assert state["known"][0] == 10.0
    fresh = np.arange(150) == 0
    multistart.run(state, r, X2[:150], y2[:150], fresh)
    multistart.consolidate(state, r)
    assert state["theta"][multistart.answer(state), 0] == pytest.approx(2.0, abs=0.25)
