"""A page re-run in parts: the same whatever the parts, and nobody waits for it."""

from __future__ import annotations

import ast
import copy
from pathlib import Path

import numpy as np
import pytest

from whsklearn import RMILSRegressor, WienerHammersteinLags, WienerHammersteinSystem
from whsklearn.datasets import make_wiener_hammerstein
from whsklearn.metrics import nmse
from whsklearn.recursion.memory import multistart
from whsklearn.recursion.memory import schedule as schedule_module
from whsklearn.recursion.memory.schedule import BackgroundRefit, schedule

MEMORY = 120
SYSTEM = WienerHammersteinSystem.example()
LAW = SYSTEM.law


def reading(**settings):
    dims = np.array([2, 2, 2, 2, len(LAW)], dtype=np.int64)
    defaults = {"p": 4, "p0": 100.0, "forgetting": 0.999, "n_starts": 4, "memory": MEMORY, "frozen": False, "seed": 0}
    return multistart.Settings(dims=dims, codes=LAW.codes, shapes=LAW.shapes, **defaults | settings)


def record(n=600, begins=(0, 310, 311)):
    X, y = make_wiener_hammerstein(n, snr_db=30, random_state=0)
    restart = np.zeros(n, dtype=bool)
    restart[list(begins)] = True
    return X, y, restart


def assert_same(a, b):
    for name in a:
        np.testing.assert_array_equal(a[name], b[name], err_msg=name)


@pytest.fixture(scope="module", params=[MEMORY, 500], ids=["pages", "filling, then a page"])
def whole(request):
    r = reading(memory=request.param)
    state = multistart.initial_state(r)
    multistart.run(state, r, *record())
    return r, state


def test_sample_by_sample_with_work_carried_on_it_is_the_same_to_the_bit(whole):
    r, expected = whole
    state, page = multistart.initial_state(r), None
    for row in zip(*(np.split(v, 600) for v in record()), strict=True):
        page = multistart.run(state, r, *row, page)
    assert_same(state, expected)


def test_work_that_is_lost_is_done_again(whole):
    """As after a restart from a checkpoint, which does not hold it."""
    r, expected = whole
    state, page = multistart.initial_state(r), None
    for i, row in enumerate(zip(*(np.split(v, 600) for v in record()), strict=True)):
        if i % 17 == 0:
            state, page = copy.deepcopy(state), None
        page = multistart.run(state, r, *row, page)
    assert_same(state, expected)


def test_work_that_is_put_off_for_a_row_is_done_in_the_next(whole):
    """As where the estimator notes its state, in every 64th row."""
    r, expected = whole
    state, page = multistart.initial_state(r), None
    for i, row in enumerate(zip(*(np.split(v, 600) for v in record()), strict=True)):
        if page is not None and i % 5 == 0:
            page.put_off()
        page = multistart.run(state, r, *row, page)
    assert_same(state, expected)


def test_a_row_that_is_put_off_does_no_work_and_several_rows_at_once_do(monkeypatch):
    X, y, restart = record(begins=(0,))
    r = reading(memory=500)
    state = multistart.initial_state(r)
    page = multistart.run(state, r, X[:150], y[:150], restart[:150])
    assert isinstance(page, BackgroundRefit)
    done, work = [], BackgroundRefit._go_on
    monkeypatch.setattr(BackgroundRefit, "_go_on", lambda self: done.append(len(done)) or work(self))
    counts = []
    for rows in (slice(150, 151), slice(151, 152), slice(152, 158)):
        if rows.start != 151:
            page.put_off()
        page = multistart.run(state, r, X[rows], y[rows], restart[rows], page)
        counts.append(len(done))
    assert counts[0] == 0 < counts[1] < counts[2]


@pytest.mark.parametrize("memory", [200, 256])
def test_a_re_run_that_has_no_time_for_its_starts_is_not_begun(memory):
    """The page that follows tries them."""
    errors = []
    for seed in range(4):
        X, y = make_wiener_hammerstein(1000, snr_db=20, random_state=seed)
        model = RMILSRegressor(WienerHammersteinLags(), memory=memory, random_state=seed).partial_fit(X, y)
        X, y = make_wiener_hammerstein(1000, snr_db=None, random_state=[seed, 1])
        errors.append(nmse(y, model.predict(X)))
    assert max(errors) < 0.05


@pytest.mark.parametrize(("memory", "ends"), [(4096, 3), (512, 2), (640, 2), (768, 3)])
def test_the_work_is_done_before_a_filling_memory_s_models_take_over(memory, ends):
    """Else the row in which they do waits for the rest: with 32 starts, one row in 64 put off.

    A short memory's first page begins with as many models as the first samples left.
    """
    r = reading(memory=memory, n_starts=32, forgetting=1.0)
    X, y = make_wiener_hammerstein(2000, snr_db=20, random_state=0)
    state, page, left = multistart.initial_state(r), None, []
    nothing = np.zeros(1, dtype=bool)
    for i in range(2000):
        if i + 1 in [end for _, end in schedule(r, filling=True)]:
            left.append((i - page.size - page._caught_up, next(page._steps, "done")))
        if page is not None and i % 64 == 1:
            page.put_off()
        page = multistart.run(state, r, X[i : i + 1], y[i : i + 1], nothing, page)
    assert len(left) == ends
    assert all(rows <= 1 and steps == "done" for rows, steps in left), left


def test_work_for_another_state_is_not_taken():
    X, y, restart = record()
    a, b = multistart.initial_state(reading()), multistart.initial_state(reading())
    page = multistart.run(a, reading(), X[:270], y[:270], restart[:270])
    assert isinstance(page, BackgroundRefit)
    multistart.run(b, reading(), X[:270], -y[:270], restart[:270])
    expected = copy.deepcopy(b)
    multistart.run(expected, reading(), X[270:], -y[270:], restart[270:])
    multistart.run(b, reading(), X[270:], -y[270:], restart[270:], page)
    assert_same(b, expected)


def test_the_work_is_done_before_the_half_page_is_over():
    """Else the sample that turns the page waits for the rest of it."""
    X, y, restart = record(begins=(0,))
    state, page, left = multistart.initial_state(reading()), None, []
    for row in zip(*(np.split(v, 600) for v in (X, y, restart)), strict=True):
        if state["blocks"] and state["fill"] == MEMORY + MEMORY // 2 - 1:
            left.append(state["fill"] - MEMORY - page._caught_up)
        page = multistart.run(state, reading(), *row, page)
    assert len(left) >= 3
    assert max(left) <= 1


def test_a_re_run_asked_for_on_the_way_turns_the_page_first():
    X, y, restart = record()
    state = multistart.initial_state(reading())
    page = multistart.run(state, reading(), X[:270], y[:270], restart[:270])
    assert (state["blocks"], state["fill"]) == (1, 150)
    with_work, without = copy.deepcopy(state), copy.deepcopy(state)
    multistart.consolidate(state, reading(), page)
    multistart.consolidate(without, reading())
    assert (state["blocks"], state["fill"]) == (2, 30)
    assert_same(state, without)
    multistart.run(with_work, reading(), X[270:], y[270:], restart[270:])
    assert np.isfinite(with_work["theta"]).all()


@pytest.mark.parametrize("level", [0.0, 3.0])
def test_pages_of_rest_leave_estimate_and_covariance_as_they_were(level):
    """Whatever level the axis rests at, once it is at rest: no wind-up, no false certainty."""
    X, y, restart = record(begins=(0,))
    r = reading()
    state = multistart.initial_state(r)
    multistart.run(state, r, X, y, restart)

    def rest(n):
        nothing = np.zeros(n, dtype=bool)
        multistart.run(state, r, np.full((n, 1), level / 10), np.full(n, level), nothing)

    rest(2 * MEMORY)  # the page of the last motion is turned
    before = copy.deepcopy(state)
    rest(100 * MEMORY)
    for name in ("theta", "ud", "loss", "prior_information", "ceiling"):
        np.testing.assert_array_equal(state[name], before[name], err_msg=name)


def test_nothing_else_in_the_recursions_is_scheduled():
    """The mathematics takes a state and returns a state; work in pieces stands in one module."""
    folder = Path(schedule_module.__file__).parents[1]
    pieces = (ast.Yield, ast.YieldFrom)
    yields = {
        path.name
        for path in folder.rglob("*.py")
        if any(isinstance(node, pieces) for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))))
    }
    assert yields - {"simulation_search.py"} == {"schedule.py"}  # divisions are listed one by one, not scheduled
