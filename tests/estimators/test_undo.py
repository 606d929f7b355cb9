"""Going back to the state before a call, to the bit."""

from __future__ import annotations

import copy

import numpy as np
import pytest

from whsklearn import RMILSRegressor, WienerHammersteinLags
from whsklearn.checks import state_difference
from whsklearn.datasets import make_wiener_hammerstein
from whsklearn.estimators._streams import RowsStream
from whsklearn.estimators._undo import REPLACED, ROWS, Undo, copied

RNG = np.random.default_rng(0)
U, Y = RNG.normal(size=(300, 2)), RNG.normal(size=300)
STREAM = RowsStream(2, 3, 1e6, 0.99, np.zeros(2), True, False)


def learn(state, undo, start, stop):
    rows = slice(start, stop)
    undo.before(state, U[rows], Y[rows])
    STREAM.run(state, U[rows], Y[rows], np.zeros(stop - start, dtype=bool))
    undo.done(stop - start)


@pytest.mark.parametrize("sizes", [(1, 1, 1), (5, 40, 30, 7), (ROWS, 1), (ROWS + 1, 2), (ROWS - 1, 1, 1)])
def test_after_a_spoilt_call_the_state_is_the_one_before_it(sizes):
    state, undo, at = STREAM.initial(), Undo(), 0
    for n in sizes:
        learn(state, undo, at, at + n)
        at += n
    wanted = copied(state)
    undo.before(state, U[at : at + 4], Y[at : at + 4])
    STREAM.run(state, U[at : at + 2], Y[at : at + 2], np.zeros(2, dtype=bool))  # half of the rows, then an interrupt
    assert state_difference(state, wanted) > 0.0
    assert state_difference(undo.restored(STREAM.run), wanted) == 0.0


def test_a_copy_shares_nothing_that_can_change():
    state = STREAM.initial()
    kept, before = copied(state), copy.deepcopy(state)
    STREAM.run(state, U[:5], Y[:5], np.zeros(5, dtype=bool))
    assert state_difference(kept, before) == 0.0


def test_a_state_that_others_put_in_its_place_is_copied_anew():
    state, undo = STREAM.initial(), Undo()
    learn(state, undo, 0, 10)
    other = STREAM.initial()
    undo.before(other, U[:3], Y[:3])
    assert undo.restored(STREAM.run)["seen"] == 0
    learn(state, undo, 10, 12)
    undo.clear()
    undo.before(state, U[12:13], Y[12:13])
    assert undo.restored(STREAM.run)["seen"] == 12


def test_what_a_note_does_not_copy_is_replaced_and_not_changed():
    """Through re-runs while the memory fills, and pages that are turned; the memory itself only grows."""
    X, y = make_wiener_hammerstein(1500, snr_db=20, random_state=0)
    model = RMILSRegressor(lags=WienerHammersteinLags(), memory=400, n_starts=4, random_state=0)
    model.partial_fit(X[:1], y[:1])
    for begin in range(1, 1500, ROWS):
        state = model.state_
        shared = [name for name, value in copied(state, REPLACED).items() if value is state[name] and np.ndim(value)]
        assert {"memory_u", "prior_information"} <= set(shared)
        before = {name: (state[name], state[name].copy()) for name in shared}
        fill = state["fill"]
        for i in range(begin, min(begin + ROWS, 1500)):
            model.partial_fit(X[i : i + 1], y[i : i + 1])
        for name, (now, then) in before.items():
            n = fill if name.startswith("memory_") else len(now)
            np.testing.assert_array_equal(now[:n], then[:n], err_msg=name)
    assert model.state_["blocks"] >= 2
