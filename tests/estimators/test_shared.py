"""One object, several threads: no row is lost, whichever way it comes, and a saved state is one that was."""

from __future__ import annotations

import copy
import pickle
import sys
import threading

import numpy as np
import pytest
from sklearn.base import clone

from whsklearn import RLSRegressor, RMILSRegressor, StreamingPEMRegressor, WienerHammersteinLags

LAGS = WienerHammersteinLags(1, 1, 1, 1)
ESTIMATORS = [
    RLSRegressor(),
    RLSRegressor(forgetting=0.999),
    RMILSRegressor(p=2),
    RLSRegressor(LAGS, gradient="pseudolinear"),
    RMILSRegressor(LAGS, p=2, n_starts=2, memory=64, random_state=0),
    StreamingPEMRegressor(WienerHammersteinLags(1, 1, 1, 1, law="polynomial"), n_start=50, block=20),
]


@pytest.fixture
def hasty_threads():
    """Threads that change places as often as they can."""
    before = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    yield
    sys.setswitchinterval(before)


def at_once(*tasks):
    """Run tasks in threads of their own, from one moment on; the first error is raised."""
    barrier, errors = threading.Barrier(len(tasks)), []

    def run(task):
        barrier.wait()
        try:
            task()
        except BaseException as error:
            errors.append(error)

    threads = [threading.Thread(target=run, args=(task,)) for task in tasks]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    if errors:
        raise errors[0]


def name_of(model):
    return f"{type(model).__name__}-{model.lags is not None}-{getattr(model, 'gradient', '')}"


@pytest.mark.parametrize("estimator", ESTIMATORS, ids=name_of)
def test_two_threads_lose_no_row(estimator, hasty_threads):
    model = clone(estimator)
    rng = np.random.default_rng(0)
    n = 1000 if model.lags is None else 100
    X = rng.standard_normal((2 * n, 1))
    y = 2.0 * X[:, 0] + 0.1 * rng.standard_normal(2 * n)

    def learn(rows):
        for k in rows:
            model.partial_fit(X[k : k + 1], y[k : k + 1])

    at_once(lambda: learn(range(n)), lambda: learn(range(n, 2 * n)))
    assert model.state_["seen"] == 2 * n


def test_what_rows_teach_is_the_same_in_any_order_of_threads(hasty_threads):
    """Rows alone, chunks, chunks that are refused, saving and asking, all at once."""
    rng = np.random.default_rng(1)
    n = 2000
    X = rng.standard_normal((2 * n, 3))
    y = X @ [1.0, -2.0, 0.5] + 0.1 * rng.standard_normal(2 * n)
    model, states = RLSRegressor(), []

    def one_by_one():
        for k in range(n):
            model.partial_fit(X[k : k + 1], y[k : k + 1])

    def chunks():
        for k in range(n, 2 * n, 10):
            model.partial_fit(X[k : k + 10], y[k : k + 10])

    def refused():
        for _ in range(200):
            with pytest.raises(ValueError, match="NaN"):
                model.partial_fit([[np.nan, 0.0, 0.0]], [1.0])

    def save():
        for _ in range(100):
            states.append(model.get_state()["state"])
            _ = model.theta_, model.standard_errors_

    for k in range(5):  # more than the parameters, or there are no standard errors to ask for
        model.partial_fit(X[k : k + 1], y[k : k + 1])
    at_once(one_by_one, chunks, refused, save)
    whole = RLSRegressor().fit(np.r_[X[:5], X], np.r_[y[:5], y])
    assert model.state_["seen"] == 2 * n + 5
    np.testing.assert_allclose(model.theta_, whole.theta_, rtol=1e-9)
    np.testing.assert_allclose(model.covariance_, whole.covariance_, rtol=1e-9)
    assert all(state["since"] == state["seen"] for state in states)
    assert [s["seen"] for s in states] == sorted(s["seen"] for s in states)


def test_the_lock_is_in_no_copy_and_no_file(tmp_path):
    skops = pytest.importorskip("skops.io", reason="needs the extra mlflow")
    X = np.random.default_rng(0).standard_normal((50, 2))
    model = RLSRegressor().fit(X, X @ [1.0, 2.0])
    model.partial_fit(X[:1], X[:1] @ [1.0, 2.0])
    model.save(tmp_path / "rows.whs")
    copies = [
        copy.deepcopy(model),
        pickle.loads(pickle.dumps(model)),
        skops.loads(skops.dumps(model), trusted=skops.get_untrusted_types(data=skops.dumps(model))),
        RLSRegressor.load(tmp_path / "rows.whs"),
        clone(model).set_state(model.get_state()),
    ]
    for other in copies:
        other.partial_fit(X[1:2], X[1:2] @ [1.0, 2.0])  # with a lock of its own
        assert other._lock is not model._lock
        assert other.state_["seen"] == model.state_["seen"] + 1
