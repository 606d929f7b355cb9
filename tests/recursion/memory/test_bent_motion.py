"""Second derivatives of dx."""

from __future__ import annotations

import numpy as np
from scipy.signal import lfilter

from whsklearn.recursion.memory.bent_motion import curvature_steps
from whsklearn.recursion.memory.steps import in_one

N, CUT = 1300, 700


def gradients(a, b, u):
    """d dx / d(a, b) of two experiments."""

    def one(u):
        x = lfilter(np.append(0.0, np.append(1.0, a)), np.append(1.0, b), u)
        held = [lfilter([1.0], np.append(1.0, b), np.append(np.zeros(k), u)[: u.size]) for k in range(2, 2 + a.size)]
        held += [-lfilter([1.0], np.append(1.0, b), np.append(np.zeros(k), x)[: x.size]) for k in range(1, 1 + b.size)]
        return np.diff(np.array(held), prepend=0.0, axis=1).T

    return np.vstack([one(u[:CUT]), one(u[CUT:])])


def test_they_are_the_slopes_of_the_gradients():
    u = np.random.default_rng(0).standard_normal(N)
    a, b = np.array([0.7, -0.2]), np.array([-1.1, 0.5, -0.1])
    gradient = gradients(a, b, u)
    restart = np.zeros(N, dtype=bool)
    restart[[0, CUT]] = True
    chosen = np.array([0, 1, 5, 511, 512, 513, 699, 700, 701, 1299])
    bent = in_one(curvature_steps(gradient, restart, np.cumsum(restart), b, chosen))
    for k in range(5):
        step = 1e-6 * np.eye(5)[k]
        slope = (gradients(a + step[:2], b + step[2:], u) - gradients(a - step[:2], b - step[2:], u))[chosen] / 2e-6
        np.testing.assert_allclose(bent[:, :, k], slope, atol=1e-6)
    np.testing.assert_array_equal(bent, bent.transpose(0, 2, 1))


def test_without_a_denominator_nothing_is_bent():
    bent = in_one(
        curvature_steps(np.ones((9, 2)), np.zeros(9, dtype=bool), np.zeros(9, dtype=int), np.zeros(0), np.arange(3))
    )
    assert bent.shape == (3, 2, 2)
    assert not bent.any()
