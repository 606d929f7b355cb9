"""Innovations of a stream: errors with the parameters known before, whatever the pieces and stops."""

from __future__ import annotations

import numpy as np

from whsklearn import RLSRegressor
from whsklearn.streaming.innovations import BLOCK, Innovations

RNG = np.random.default_rng(0)
X = RNG.normal(size=(3 * BLOCK, 2))
Y = X @ [1.0, -2.0] + 0.1 * RNG.normal(size=3 * BLOCK)


def taken(pieces, kept=None):
    """Innovations of the three blocks, learnt in these pieces; ``kept`` stops and goes on within the second."""
    model, out = RLSRegressor(), []
    watch = Innovations(model)
    for at in range(0, 3 * BLOCK, pieces):
        part = slice(at, at + pieces)
        model.partial_fit(X[part], Y[part])
        watch.learnt(np.column_stack([X[part], Y[part]]), np.zeros(pieces, dtype=np.int64))
        if (at + pieces) % BLOCK == 0:
            out.append(watch.of_block()[1])
        elif kept and at > BLOCK:
            state, learnt = watch.get_state(), model.get_state()
            model = RLSRegressor().set_state(learnt)
            watch = Innovations(model)
            watch.set_state(state)
    return out


def test_a_block_is_predicted_by_what_was_known_at_its_beginning():
    first, second, third = taken(BLOCK)
    assert np.isnan(first).all()
    for begin, e in ((BLOCK, second), (2 * BLOCK, third)):
        theta = RLSRegressor().partial_fit(X[:begin], Y[:begin]).theta_
        part = slice(begin, begin + BLOCK)
        np.testing.assert_allclose(e[:, 0], Y[part] - X[part] @ theta, atol=1e-9)


def test_pieces_and_stops_change_no_innovation():
    whole = taken(BLOCK)
    for other in (taken(20), taken(20, kept=True)):
        np.testing.assert_allclose(np.concatenate(other)[BLOCK:], np.concatenate(whole)[BLOCK:], atol=1e-12)
