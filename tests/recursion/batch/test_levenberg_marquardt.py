"""The loop of the batch fits."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest

from whsklearn.recursion.batch.levenberg_marquardt import damped_step, descend


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
