"""A window of p samples as one update."""

from __future__ import annotations

import numpy as np

from tests.recursion.windows import LINEAR, example_problem, one_sample_on, run
from whsklearn.recursion.rows.covariance import covariance
from whsklearn.recursion.rows.least_squares import block_update
from whsklearn.recursion.rows.predictor import by_block, past_of, predict, state_size


def test_frozen_and_sub_innovations_agree_where_no_row_depends_on_theta(linear):
    dims, X, y, _ = linear
    a, b = (run(dims, LINEAR, np.zeros(3), X, y, frozen=f) for f in (True, False))
    np.testing.assert_allclose(a["theta"], b["theta"], rtol=1e-9)
    np.testing.assert_allclose(covariance(a["ud"][0]), covariance(b["ud"][0]), rtol=1e-9)


def test_the_frozen_window_is_the_literal_block_update():
    """(7)-(9) with rows psi at theta(t-1), linearised there, weight 1/p."""
    dims, law, theta, X, y = example_problem(40)
    p, kappa = 3, 3.0
    got = run(dims, law, theta, X, y, p=p, frozen=True, p0=0.01, kappa=kappa)
    P, state = np.eye(9) * 0.01, np.zeros(state_size(dims))
    u_pad, y_pad = np.zeros(p + 2), np.zeros(p + 2)  # newest first
    for t in range(len(y)):
        u_pad, y_pad = np.r_[X[t], u_pad[:-1]], np.r_[y[t], y_pad[:-1]]
        window, work, rows, targets = min(p, t + 1), state.copy(), [], []
        blocks = by_block(theta, dims)
        for i in range(window):
            now = window - 1 - i
            if i:
                one_sample_on(blocks, law.codes, law.shapes, kappa, past_of(work, dims), u_pad[now + 2 :])
            psi = np.empty(9)
            e = y_pad[now] - predict(blocks, past_of(work, dims), 0, y_pad[now + 1 :], psi, by_block(psi, dims))
            rows.append(psi)
            targets.append(e + psi @ theta)
        theta, P = block_update(theta, P, np.array(rows).T, np.array(targets), float(p))
        if t + 1 >= p:
            blocks = by_block(theta, dims)
            one_sample_on(blocks, law.codes, law.shapes, kappa, past_of(state, dims), u_pad[p:])
    np.testing.assert_allclose(got["theta"][0], theta, rtol=1e-9)
    np.testing.assert_allclose(covariance(got["ud"][0]), P, rtol=1e-8)
