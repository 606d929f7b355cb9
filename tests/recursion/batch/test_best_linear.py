"""The best linear model of a linear record is that record's system."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest
from scipy.signal import lfilter

from whsklearn.recursion.batch.best_linear import (
    IOData,
    Ratio,
    best_linear,
    damped_step,
    delayed_rows,
    descend,
    filter_rows,
    least_squares_arx,
)

ROWS = np.random.default_rng(0).normal(size=(2, 50))
BOUNDS = np.array([0, 20, 50])


def test_each_experiment_is_filtered_from_rest():
    b, a = np.array([0.0, 1.0, 0.3]), np.array([1.0, -0.8, 0.2, 0.05])
    out = filter_rows(b, a, ROWS, BOUNDS)
    expected = np.hstack([lfilter(b, a, ROWS[:, :20]), lfilter(b, a, ROWS[:, 20:])])
    np.testing.assert_allclose(out, expected, atol=1e-12)


def test_without_poles_the_sums_are_the_same_to_the_last_bit_also_in_pieces_shorter_than_the_filter():
    b, bounds = np.random.default_rng(1).normal(size=7), np.array([0, 3, 20, 50])
    np.testing.assert_array_equal(
        filter_rows(b, np.ones(1), ROWS, bounds), filter_rows(b, np.array([1.0, 0.0]), ROWS, bounds)
    )


def test_delays_do_not_reach_over_the_border_of_an_experiment():
    out = delayed_rows(ROWS[0], 3, BOUNDS)
    np.testing.assert_array_equal(out[0], ROWS[0])
    np.testing.assert_array_equal(out[2, [0, 1, 20, 21]], 0.0)
    np.testing.assert_array_equal(out[2, 22:], ROWS[0, 20:-2])


class Point(NamedTuple):
    x: np.ndarray

    @property
    def error(self):
        return np.array([1.0 - self.x[0], 10.0 * (self.x[1] - self.x[0] ** 2)])  # Rosenbrock's valley

    @property
    def cost(self):
        return float(self.error @ self.error)


def equations(at):
    rows = np.array([[1.0, 20.0 * at.x[0]], [0.0, -10.0]])  # by x, of minus the error
    return rows @ rows.T, rows @ at.error


def moved(at, step):
    return Point(at.x + step)


def test_a_bent_valley_is_followed_to_its_end():
    end = descend(Point(np.array([-1.2, 1.0])), equations, moved, 100, enough=1e-12)
    assert end.x == pytest.approx([1.0, 1.0], abs=1e-6)


@pytest.mark.parametrize("start", [(-1.2, 1.0), (-2.0, 3.0), (3.0, -2.0), (0.0, 5.0)])
def test_along_a_bent_valley_most_steps_lower_the_cost(start):
    lower = []

    def counted(at, step):
        lower.append(moved(at, step).cost < at.cost)
        return moved(at, step)

    descend(Point(np.array(start)), equations, counted, 100, enough=1e-12)
    assert 2 * sum(lower) > len(lower)


def test_no_step_raises_the_cost_and_refused_steps_are_not_taken():
    seen = []

    def within(at, step):
        seen.append(at.cost)
        trial = moved(at, step)
        return trial if trial.x[0] < 0.5 else None

    end = descend(Point(np.array([-1.2, 1.0])), equations, within, 100, enough=1e-12)
    assert end.x[0] < 0.5
    assert all(np.diff(seen) <= 0)
    assert end.cost < seen[0]


def test_where_there_is_nothing_to_go_on_from_the_start_is_the_end():
    start = Point(np.array([-1.2, 1.0]))
    assert descend(start, lambda at: None, moved, 100, enough=0.0) is start


def test_without_damping_a_step_solves_the_normal_equations_in_any_unit():
    rng = np.random.default_rng(0)
    rows = rng.normal(size=(3, 20)) * np.array([[1e-6], [1.0], [1e6]])
    target = rng.normal(size=20)
    wanted = np.linalg.lstsq(rows.T, target)[0]
    np.testing.assert_allclose(damped_step(rows @ rows.T, rows @ target, 0.0), wanted, rtol=1e-8)


B, A = np.array([0.0, 1.0, 0.4]), np.array([1.0, -1.2, 0.5])


def record(noise, n=2000):
    rng = np.random.default_rng(0)
    u = rng.normal(size=n)
    y = lfilter(B, A, u) + noise * rng.normal(size=n)
    return IOData(u[None], y, np.array([0, n]), np.arange(n) > 50)


def test_an_exact_record_gives_its_own_ratio():
    found = least_squares_arx(record(0.0), 2, 2)
    np.testing.assert_allclose(found.b[:3], B, atol=1e-8)
    np.testing.assert_allclose(found.a, A, atol=1e-8)


def test_output_noise_biases_arx_and_not_the_free_run():
    data = record(0.5)
    arx, best = least_squares_arx(data, 2, 2), best_linear(data, 2, 2)
    error = [np.linalg.norm(r.a - A) for r in (arx, best)]
    assert error[1] < 0.3 * error[0]
    assert np.abs(np.roots(best.a)).max() < 1.0


def test_a_run_is_the_filter_and_the_head_is_a_shorter_record():
    data = record(0.0)
    np.testing.assert_allclose(Ratio(B, A).run(data), data.y, atol=1e-12)
    head = data.head(100)
    assert (head.u.shape, head.y.size, head.bounds.tolist()) == ((1, 100), 100, [0, 100])
    np.testing.assert_array_equal(data.scale, data.counts.astype(float))
