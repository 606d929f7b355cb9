"""The contract of a streaming estimator, as checks that anyone can run on their own.

scikit-learn's ``check_estimator`` knows nothing of streams.  `check_streaming` covers what
it leaves open: that the chunks in which data come make no difference, that predicting
does not learn, that a stream survives being copied, pickled and saved in its midst, and that
a refused call leaves no trace.
"""

from __future__ import annotations

import copy
import pickle
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import joblib
import numpy as np
from numpy.typing import ArrayLike, NDArray
from sklearn.base import clone

CHUNKING_TOLERANCE = 1e-12


def check_streaming(estimator: Any, X: ArrayLike, y: ArrayLike, *, skip: tuple[str, ...] = ()) -> list[str]:
    """Run every check of the streaming contract; raise AssertionError at the first that fails.

    Parameters
    ----------
    estimator : object
        With ``partial_fit``, ``predict``, ``get_state``, ``set_state``, ``save`` and ``load``; it
        is cloned and stays as it is.
    X : array-like of shape (n, n_features)
        Input, n >= 60.
    y : array-like of shape (n,)
        Output.
    skip : tuple of str, optional
        Names of checks left out; `streaming_checks` lists them.

    Returns
    -------
    list of str
        Names of the checks that ran.

    Raises
    ------
    AssertionError
        In one sentence: which check, and by how much it failed.
    ValueError
        If the record is too short or not finite.

    Examples
    --------
    >>> import numpy as np
    >>> from whsklearn import RLSRegressor
    >>> from whsklearn.checks import check_streaming
    >>> X = np.random.default_rng(0).normal(size=(80, 2))
    >>> "chunking" in " ".join(check_streaming(RLSRegressor(), X, X @ [1.0, 2.0]))
    True
    """
    X, y = np.array(X, dtype=np.float64, ndmin=2), np.array(y, dtype=np.float64)
    if len(X) < 60 or y.shape != (len(X),) or not (np.isfinite(X).all() and np.isfinite(y).all()):
        raise ValueError(f"check_streaming: X {X.shape} and y {y.shape}; expected finite (n, k) and (n,) with n >= 60.")
    ran = []
    for name, check in streaming_checks():
        if name not in skip:
            check(estimator, X.copy(), y.copy())
            ran.append(name)
    return ran


def streaming_checks() -> Iterator[tuple[str, Callable[[Any, NDArray[np.float64], NDArray[np.float64]], None]]]:
    """(name, check) of every check; each is called as ``check(estimator, X, y)``, for pytest's parametrize.

    Examples
    --------
    >>> from whsklearn.checks import streaming_checks
    >>> len([name for name, check in streaming_checks()]) > 5
    True
    """
    for name, value in list(globals().items()):
        if name.startswith("_check_"):
            yield name.removeprefix("_check_"), value


def state_difference(a: Any, b: Any) -> float:
    """Largest difference between two states, relative to each array's largest entry; inf if they differ in kind.

    ``a``, ``b``: as `get_state` gives them.

    Examples
    --------
    >>> import numpy as np
    >>> from whsklearn.checks import state_difference
    >>> state_difference({"theta": np.array([1.0, 2.0])}, {"theta": np.array([1.0, 2.1])})
    0.0476...
    >>> state_difference({"theta": np.zeros(2)}, {"theta": "none"})
    inf
    """
    if isinstance(a, dict) and isinstance(b, dict):
        if a.keys() != b.keys():
            return np.inf
        return max((state_difference(a[k], b[k]) for k in a), default=0.0)
    if isinstance(a, list | tuple) and isinstance(b, list | tuple):
        if len(a) != len(b):
            return np.inf
        return max((state_difference(p, q) for p, q in zip(a, b, strict=True)), default=0.0)
    if _is_number(a) and _is_number(b):
        return _numeric_difference(np.asarray(a), np.asarray(b))
    if isinstance(a, np.random.Generator) and isinstance(b, np.random.Generator):
        return state_difference(a.bit_generator.state, b.bit_generator.state)
    if isinstance(a, np.ndarray) and isinstance(b, np.ndarray):
        return 0.0 if np.array_equal(a, b) else np.inf
    return 0.0 if type(a) is type(b) and bool(a == b) else np.inf


def _is_number(value: Any) -> bool:
    """Whether a leaf is a number or an array of numbers."""
    return isinstance(value, bool | int | float | np.generic) or (
        isinstance(value, np.ndarray) and value.dtype.kind in "biufc"
    )


def _numeric_difference(a: NDArray[Any], b: NDArray[Any]) -> float:
    """Largest difference over the largest size; NaN equals NaN, inf equals inf."""
    if a.shape != b.shape:
        return np.inf
    same = (a == b) | ((a != a) & (b != b))
    if bool(np.all(same)):
        return 0.0
    a, b = a[~same].astype(np.float64), b[~same].astype(np.float64)
    if not (np.isfinite(a).all() and np.isfinite(b).all()):
        return np.inf
    return float(np.max(np.abs(a - b)) / max(np.max(np.abs(a)), np.max(np.abs(b))))


def _assert_same(a: Any, b: Any, what: str, tolerance: float = 0.0) -> None:
    """Fail with the difference of two states."""
    difference = state_difference(a, b)
    assert difference <= tolerance, f"{what}: states differ by {difference:.3g}, expected at most {tolerance:.3g}"


def _streamed(estimator: Any, X: NDArray[np.float64], y: NDArray[np.float64], cuts: list[int]) -> Any:
    """A clone that took the rows in chunks ending at the cuts."""
    model = clone(estimator)
    for start, stop in zip([0, *cuts], [*cuts, len(X)], strict=True):
        model.partial_fit(X[start:stop], y[start:stop])
    return model


def _check_chunking(estimator: Any, X: NDArray[np.float64], y: NDArray[np.float64]) -> None:
    """Rows at once, in odd chunks, or the last thirty one by one: the same state."""
    n = len(X)
    whole = _streamed(estimator, X, y, []).get_state()
    for cuts in ([n // 2], [1, 2, 3, n // 3, n // 3 + 1], list(range(n - 30, n))):
        parts = _streamed(estimator, X, y, cuts).get_state()
        _assert_same(whole, parts, f"chunking: {len(cuts) + 1} chunks against one", CHUNKING_TOLERANCE)


def _check_predict_changes_nothing(estimator: Any, X: NDArray[np.float64], y: NDArray[np.float64]) -> None:
    """Predict, predict_ahead and score read the state and leave it; predicting twice gives the same."""
    model = _streamed(estimator, X, y, [])
    before = model.get_state()
    first = model.predict(X)
    assert np.isfinite(first).all(), "predict_changes_nothing: predict returned values that are not finite"
    model.predict(X[: len(X) // 2])
    model.score(X, y)
    if hasattr(model, "predict_ahead"):
        ahead = model.predict_ahead(X, y, horizon=1)
        assert np.isfinite(ahead).all(), "predict_changes_nothing: predict_ahead returned values that are not finite"
    _assert_same(before, model.get_state(), "predict_changes_nothing")
    np.testing.assert_array_equal(first, model.predict(X), err_msg="predict_changes_nothing: a second predict differs")


def _check_input_is_not_mutated(estimator: Any, X: NDArray[np.float64], y: NDArray[np.float64]) -> None:
    """Read-only rows are taken, and rows stay as they were; later writes to them reach no state."""
    X.flags.writeable = y.flags.writeable = False
    model = _streamed(estimator, X, y, [])
    model.fit(X, y)
    own_X, own_y = X.copy(), y.copy()
    model.partial_fit(own_X, own_y)
    np.testing.assert_array_equal(own_X, X, err_msg="input_is_not_mutated: X was changed")
    np.testing.assert_array_equal(own_y, y, err_msg="input_is_not_mutated: y was changed")
    before = model.get_state()
    own_X[:], own_y[:] = 1e9, 1e9
    _assert_same(before, model.get_state(), "input_is_not_mutated: the state shares memory with the input")


def _check_state_is_a_copy(estimator: Any, X: NDArray[np.float64], y: NDArray[np.float64]) -> None:
    """Going on does not change a state taken before."""
    model = _streamed(estimator, X[:40], y[:40], [])
    taken, kept = model.get_state(), pickle.dumps(model.get_state())
    model.partial_fit(X[40:], y[40:])
    _assert_same(taken, pickle.loads(kept), "state_is_a_copy: partial_fit changed a state taken before")


def _goes_on(model: Any, other: Any, X: NDArray[np.float64], y: NDArray[np.float64], what: str) -> None:
    """Both take the remaining rows and end in bit-identical states."""
    _assert_same(model.get_state(), other.get_state(), f"{what}: right after")
    model.partial_fit(X, y)
    other.partial_fit(X, y)
    _assert_same(model.get_state(), other.get_state(), f"{what}: after going on")
    np.testing.assert_array_equal(model.predict(X), other.predict(X), err_msg=f"{what}: predictions differ")


def _check_same_seed_same_bits(estimator: Any, X: NDArray[np.float64], y: NDArray[np.float64]) -> None:
    """Two streams of the same rows end in bit-identical states."""
    _assert_same(
        _streamed(estimator, X, y, []).get_state(), _streamed(estimator, X, y, []).get_state(), "same_seed_same_bits"
    )


def _check_clone_starts_clean(estimator: Any, X: NDArray[np.float64], y: NDArray[np.float64]) -> None:
    """A clone has the parameters and no learned state; fit discards the state of earlier fits."""
    model = _streamed(estimator, X, y, [])
    again = clone(model)
    assert not hasattr(again, "theta_"), "clone_starts_clean: the clone is fitted"
    again.partial_fit(X, y)
    _assert_same(model.get_state(), again.get_state(), "clone_starts_clean: the same rows after clone")
    fresh = clone(model).fit(X[:50], y[:50])
    _assert_same(fresh.get_state(), model.fit(X[:50], y[:50]).get_state(), "clone_starts_clean: fit after a stream")


def _check_pickle_goes_on(estimator: Any, X: NDArray[np.float64], y: NDArray[np.float64]) -> None:
    """A pickled copy, taken mid-stream, goes on identically, and so does one whose arrays are mapped read-only.

    So joblib hands large arrays to its workers.
    """
    model = _streamed(estimator, X[:40], y[:40], [])
    with tempfile.TemporaryDirectory() as folder:
        joblib.dump(model, Path(folder, "model.joblib"))
        mapped = joblib.load(Path(folder, "model.joblib"), mmap_mode="r")
        _goes_on(copy.deepcopy(model), mapped, X[40:], y[40:], "pickle_goes_on: mapped by joblib")
    _goes_on(model, pickle.loads(pickle.dumps(model)), X[40:], y[40:], "pickle_goes_on")


def _check_state_goes_on(estimator: Any, X: NDArray[np.float64], y: NDArray[np.float64]) -> None:
    """A clone that is given the state goes on identically."""
    model = _streamed(estimator, X[:40], y[:40], [])
    other = clone(estimator)
    other.set_state(model.get_state())
    _goes_on(model, other, X[40:], y[40:], "state_goes_on")


def _check_saved_goes_on(estimator: Any, X: NDArray[np.float64], y: NDArray[np.float64]) -> None:
    """A saved and loaded copy has the same parameters and goes on identically."""
    model = _streamed(estimator, X[:40], y[:40], [])
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "model.whs")
        model.save(path)
        loaded = type(model).load(path)
    assert repr(loaded) == repr(model), f"saved_goes_on: loaded {loaded!r}, saved {model!r}"
    _goes_on(model, loaded, X[40:], y[40:], "saved_goes_on")


def _check_skops_goes_on(estimator: Any, X: NDArray[np.float64], y: NDArray[np.float64]) -> None:
    """A copy through skops goes on identically, trusting the library's own types only; passed over without skops."""
    try:
        from skops.io import dumps, get_untrusted_types, loads
    except ImportError:
        return
    model = _streamed(estimator, X[:40], y[:40], [])
    data = dumps(model)
    trusted = get_untrusted_types(data=data)
    home = type(model).__module__.split(".")[0]
    foreign = [t for t in trusted if t.split(".")[0] not in ("whsklearn", home)]
    assert not foreign, f"skops_goes_on: the state holds types of others that skops does not trust: {foreign}"
    _goes_on(model, loads(data, trusted=trusted), X[40:], y[40:], "skops_goes_on")


def _check_refused_call_changes_nothing(estimator: Any, X: NDArray[np.float64], y: NDArray[np.float64]) -> None:
    """Bad rows raise ValueError, and the state stays as it was to the bit."""
    model = _streamed(estimator, X[:40], y[:40], [])
    before = model.get_state()
    good_X, good_y = X[40:50], y[40:50]
    late_nan, late_inf = good_X.copy(), good_y.copy()
    late_nan[-1, 0], late_inf[-1] = np.nan, np.inf
    bad: dict[str, tuple[Any, Any]] = {
        "NaN in the last row of X": (late_nan, good_y),
        "inf at the end of y": (good_X, late_inf),
        "a column too many": (np.c_[good_X, good_X[:, 0]], good_y),
        "y shorter than X": (good_X, good_y[:-1]),
        "X of one dimension": (good_X[:, 0], good_y),
        "X of three dimensions": (good_X[:, :, None], good_y),
        "text": (np.full(good_X.shape, "a"), good_y),
        "complex numbers": (good_X + 1j, good_y),
        "no rows": (good_X[:0], good_y[:0]),
        "y of two columns": (good_X, np.c_[good_y, good_y]),
        "one row with NaN": (late_nan[-1:], good_y[-1:]),
        "one row with inf": (good_X[-1:], late_inf[-1:]),
    }
    for what, (bad_X, bad_y) in bad.items():
        try:
            model.partial_fit(bad_X, bad_y)
        except ValueError:
            pass
        else:
            raise AssertionError(f"refused_call_changes_nothing: {what} was taken without a ValueError")
        _assert_same(before, model.get_state(), f"refused_call_changes_nothing: {what}")


def _check_groups_restart_the_state(estimator: Any, X: NDArray[np.float64], y: NDArray[np.float64]) -> None:
    """Experiments in one array, or one by one: the same; and the first has no influence on the second."""
    half = len(X) // 2
    groups = np.repeat([0, 1], [half, len(X) - half])
    together = clone(estimator).partial_fit(X, y, groups=groups).get_state()
    apart = clone(estimator)
    for g in (0, 1):
        apart.partial_fit(X[groups == g], y[groups == g], groups=groups[groups == g])
    _assert_same(together, apart.get_state(), "groups_restart_the_state: together and apart", CHUNKING_TOLERANCE)
    if getattr(estimator, "lags", None) is not None:
        glued = clone(estimator).partial_fit(X, y, groups=np.ones(len(X), dtype=int)).get_state()  # the same last label
        assert state_difference(together, glued) > 0, "groups_restart_the_state: groups made no difference"
