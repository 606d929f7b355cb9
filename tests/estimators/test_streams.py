"""The ways of learning behind one interface."""

from __future__ import annotations

import copy

import numpy as np
import pytest

from whsklearn.effects.law import reduced_law
from whsklearn.estimators._model import Structure
from whsklearn.estimators._streams import FullStream, PublishedStream, RowsStream, noise_variance, pieces
from whsklearn.recursion.memory.settings import Settings
from whsklearn.recursion.rows.pseudolinear import BLOCK, GRADIENT, REEVALUATED

LAW = reduced_law()
DIMS = np.array([2, 2, 2, 2, 3], dtype=np.int64)
STRUCTURE = Structure(DIMS, 1, LAW, LAW.key)


def full(**settings):
    defaults = {"p": 4, "p0": 100.0, "forgetting": 1.0, "n_starts": 2, "memory": 64, "frozen": False, "seed": 0}
    return FullStream(STRUCTURE, Settings(dims=DIMS, codes=LAW.codes, shapes=LAW.shapes, **defaults | settings))


STREAMS = {
    "rows": RowsStream(1, 4, 1e6, 0.99, np.zeros(1), True, False),
    "gradient on rows": RowsStream(1, 4, 1e6, 1.0, np.zeros(1), True, True),
    "block": PublishedStream(STRUCTURE, 4, 1e6, 1.0, np.full(9, 0.01), BLOCK),
    "sub-innovations": PublishedStream(STRUCTURE, 4, 1e6, 0.99, np.full(9, 0.01), REEVALUATED),
    "gradient": PublishedStream(STRUCTURE, 4, 1e6, 1.0, np.full(9, 0.01), GRADIENT),
    "full": full(),
    "pure": full(memory=0),
}


@pytest.mark.parametrize("name", list(STREAMS))
def test_a_stream_learns_into_the_state_alone(name):
    """State in, state out: the object holds settings, so that any copy of a state goes on the same."""
    stream = STREAMS[name]
    rng = np.random.default_rng(0)
    u, y = rng.standard_normal((120, 1)), rng.standard_normal(120)
    restart = np.arange(120) == 0
    state = stream.initial()
    stream.run(state, u[:70], y[:70], restart[:70])
    twin = copy.deepcopy(state)
    stream.run(state, u[70:], y[70:], restart[70:])
    stream.run(twin, u[70:], y[70:], restart[70:])
    for key in state:
        np.testing.assert_array_equal(state[key], twin[key], err_msg=key)
    assert state["seen"] == 120
    stream.settle(state)
    n = stream.theta(state).size
    assert stream.covariance(state).shape == (n, n)
    assert np.isfinite(stream.theta(state)).all()
    np.testing.assert_array_equal(stream.initial()["theta"], stream.initial()["theta"])


def test_reading_theta_gives_no_handle_on_the_state():
    for stream in STREAMS.values():
        state = stream.initial()
        stream.theta(state)[:] = 99.0
        assert not (np.asarray(state["theta"]) == 99.0).any()


def test_variance_needs_degrees_of_freedom():
    assert noise_variance(np.array([10.0, 7.0]), 2) == 2.0
    assert np.isnan(noise_variance(np.array([10.0, 2.0]), 2))


@pytest.mark.parametrize(
    ("marks", "expected"),
    [([0, 0, 0], [(0, 3)]), ([1, 0, 0], [(0, 3)]), ([0, 1, 1], [(0, 1), (1, 2), (2, 3)]), ([], [])],
)
def test_pieces_are_cut_where_experiments_begin(marks, expected):
    assert [(s.start, s.stop) for s in pieces(np.array(marks, dtype=bool))] == expected


@pytest.mark.parametrize("p", [1, 3])
def test_a_row_by_itself_and_rows_in_one_call_give_the_same_bits(p):
    """`step` keeps what a row changes in one array of its own: a state that somebody else changes must stay in step."""
    rng = np.random.default_rng(0)
    rows, y = rng.standard_normal((40, 3)), rng.standard_normal(40)
    fast, slow = (RowsStream(3, p, 1e6, 0.99, np.zeros(3), True, False) for _ in range(2))
    state, other = fast.initial(), slow.initial()
    began = np.zeros(40, dtype=bool)
    for t in range(40):
        began[t] = t == 20
        if t in (10, 20):  # rows in one call between, with a new experiment at the second
            fast.run(state, rows[t : t + 1], y[t : t + 1], began[t : t + 1])
        else:
            if t == 30:
                state = copy.deepcopy(state)
            if t == 35:  # an array that was put in another's place
                state["theta"] = state["theta"].copy()
            fast.pack(state)
            assert fast.step(state, rows[t : t + 1], y[t : t + 1])
    slow.run(other, rows, y, began)
    for name, value in other.items():
        np.testing.assert_array_equal(state[name], value)


def test_a_row_that_needs_a_check_changes_nothing():
    stream = RowsStream(2, 1, 1e6, 1.0, np.zeros(2), True, False)
    state = stream.initial()
    assert not stream.step(state, np.ones((1, 2)), np.ones(1))  # before `pack`
    stream.pack(state)
    assert stream.step(state, np.ones((1, 2)), np.ones(1))
    before = copy.deepcopy(state)
    locked = np.ones((1, 2))
    locked.flags.writeable = False
    odd = [
        np.ones((1, 3)),
        np.ones((2, 2)),
        np.ones((1, 2), dtype=int),
        np.full((1, 2), np.nan),
        np.ones((1, 4))[:, ::2],
    ]
    for row in [*odd, locked]:
        assert not stream.step(state, row, np.ones(1))
    assert not stream.step(state, np.ones((1, 2)), np.ones(2))
    for name, value in before.items():
        np.testing.assert_array_equal(state[name], value)
