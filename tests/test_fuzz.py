"""Fuzzing of every public entry: a clear ValueError or a finite answer, never a crash, a silent NaN or a changed state.

``WHSKLEARN_FUZZ=100`` runs a hundred times as many examples.
"""

from __future__ import annotations

import os
import warnings
from functools import cache

import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays
from sklearn.base import clone

from whsklearn import (
    MILSRegressor,
    PEMRegressor,
    RLSRegressor,
    RMILSRegressor,
    WienerHammersteinLags,
    metrics,
    validation,
)
from whsklearn.change import ChangeAlarm, compare_parameters
from whsklearn.checks import state_difference
from whsklearn.datasets import load_log, make_wiener_hammerstein
from whsklearn.recursion.rows.batched import least_squares_of_many
from whsklearn.state.files import pack_state, unpack_state
from whsklearn.streaming.monitor import Options, StreamMonitor
from whsklearn.streaming.rows import BadRow, CsvParser, JsonParser

FUZZ = settings(
    max_examples=40 * int(os.environ.get("WHSKLEARN_FUZZ", "1")),
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.function_scoped_fixture, HealthCheck.data_too_large],
)
NUMBERS = st.one_of(
    st.floats(-10, 10),
    st.floats(),
    st.sampled_from([0.0, -0.0, 1e-320, 1e-160, 1e30, 1e155, 1e300, -1e300, np.nan, np.inf]),
)
ODD = st.sampled_from([None, "a", [], [[]], [[1], [1, 2]], {"u": 1}, object(), 3, [None, 1.0], ["1", "2"], b"x"])
SHAPES = array_shapes(min_dims=1, max_dims=3, min_side=0, max_side=12)
TYPES = st.sampled_from([np.float64, np.float32, np.int8, np.uint64, np.bool_, np.complex64, "U3", "M8[s]"])
ARRAYS = st.one_of(
    arrays(np.float64, st.tuples(st.integers(0, 12), st.integers(0, 3)), elements=NUMBERS),
    arrays(np.float64, st.integers(0, 12), elements=NUMBERS),
    TYPES.flatmap(lambda dtype: arrays(dtype, SHAPES)),
    ODD,
)

# rows that are taken unless a number of them is refused: of shapes that are drawn apart, none ever fitted together
ROWS = st.integers(1, 4).flatmap(
    lambda n: st.tuples(*(arrays(np.float64, shape, elements=NUMBERS) for shape in ((n, 1), (n,))))
)


def answers(function, *args, **kwargs):
    """What a call returns, or None if it refused in a sentence."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)
            return function(*args, **kwargs)
    except (ValueError, TypeError):  # scikit-learn says TypeError for objects that are no arrays at all
        return None


MODELS = "mils", "pem", "rmils", "rows"


@cache
def fitted(kind):
    """A model that learns no more: what a test changes is a clone."""
    lags = WienerHammersteinLags()
    quick = {"n_starts": 2, "memory": 64, "random_state": 0}
    model = {
        "rows": RLSRegressor(),
        "mils": MILSRegressor(lags, gradient="pseudolinear"),
        "rmils": RMILSRegressor(lags, p=2, **quick),
        "pem": PEMRegressor(lags, n_starts=1, random_state=0),
    }[kind]
    X, y = make_wiener_hammerstein(n_samples=120, snr_db=20, random_state=0)
    return answers(model.fit, X, y)  # rows of a dynamic system are warned of


@pytest.mark.parametrize("kind", ["rows", "mils", "rmils"])
@given(rows=st.one_of(st.tuples(ARRAYS, ARRAYS), ROWS), groups=st.one_of(st.none(), ARRAYS))
@example(rows=([[1e30]], [-1e30]), groups=None)
@FUZZ
def test_partial_fit_learns_finite_numbers_or_nothing(kind, rows, groups):
    X, y = rows
    model = clone(fitted(kind)).set_state(fitted(kind).get_state())
    before = model.get_state()
    done = answers(model.partial_fit, X, y, groups=groups)
    if done is None:
        assert state_difference(before, model.get_state()) == 0.0
        return  # whose answer is the one that the model had
    for value in model.get_state()["state"].values():
        if isinstance(value, np.ndarray) and value.dtype.kind == "f":
            assert not np.isnan(value).any()
    assert np.isfinite(model.theta_).all()
    assert np.isfinite(model.predict(np.ones((5, 1)))).all()


@pytest.mark.parametrize("kind", MODELS)
@given(X=ARRAYS, y=ARRAYS, horizon=st.one_of(st.integers(-2, 20), ODD))
@FUZZ
def test_predictions_are_finite_or_refused(kind, X, y, horizon):
    for y_hat in (answers(fitted(kind).predict, X), answers(fitted(kind).predict_ahead, X, y, horizon=horizon)):
        assert y_hat is None or (np.isfinite(y_hat).all() and y_hat.shape == (np.shape(X)[0],))


@pytest.mark.parametrize("name", ["nmse", "mu_e", "rmse", "parameter_error"])
@given(a=ARRAYS, b=ARRAYS, skip=st.one_of(st.integers(-3, 15), ODD))
@example(a=np.array([[1.8961e154], [0.0]]), b=np.zeros((2, 1)), skip=0)  # its square overflows, the ratio does not
@FUZZ
def test_metrics_are_no_nan(name, a, b, skip):
    more = {} if name == "parameter_error" else {"skip": skip}
    with np.errstate(over="ignore", invalid="ignore"):
        value = answers(getattr(metrics, name), a, b, **more)
    assert value is None or not np.isnan(value)


@given(phi=ARRAYS, p=st.one_of(st.integers(-1, 9), ODD))
@FUZZ
def test_excitation(phi, p):
    found = answers(validation.excitation, phi, p=p)
    assert found is None or (0 <= found.rank <= found.n_params and not np.isnan([found.alpha, found.beta]).any())


@given(e=st.one_of(ARRAYS, arrays(np.float64, 80, elements=NUMBERS)), u=arrays(np.float64, 80, elements=NUMBERS))
@FUZZ
def test_residual_tests(e, u):
    for test in (answers(validation.whiteness_test, e, 3), answers(validation.cross_correlation_test, e, u, 3)):
        assert test is None or (0 <= test.p_value <= 1 and np.isfinite(test.r).all())


@given(blocks=st.lists(ARRAYS, max_size=5))
@FUZZ
def test_alarm(blocks):
    alarm = ChangeAlarm(n_reference=300, n_settle=0)
    alarm.update(np.random.default_rng(0).normal(size=400))
    for e in blocks:
        before = alarm.get_state()
        if answers(alarm.update, e) is None:
            assert state_difference(before, alarm.get_state()) == 0.0
        assert not np.isnan(alarm.evidence_)


@given(before=ARRAYS, variances=ARRAYS, after=ARRAYS)
@FUZZ
def test_comparison_of_parameters(before, variances, after):
    found = answers(compare_parameters, ["a", "b"], before, variances, after, variances)
    assert found is None or len(found) == 2


@given(X=ARRAYS, y=ARRAYS)
@FUZZ
def test_many(X, y):
    found = answers(least_squares_of_many, X, y)
    assert found is None or np.isfinite(found[0]).all()


VALUES = st.recursive(
    st.one_of(st.none(), st.booleans(), st.integers(), st.floats(), st.text(max_size=9), ARRAYS),
    lambda v: st.one_of(st.lists(v, max_size=3), st.dictionaries(st.text(max_size=6), v, max_size=3)),
    max_leaves=6,
)


@given(state=st.dictionaries(st.sampled_from(["n_features_in", "state", "theta", "ud", "seen"]), VALUES, max_size=4))
@FUZZ
def test_foreign_states_are_refused_and_change_nothing(state):
    model = clone(fitted("rmils")).set_state(fitted("rmils").get_state())
    before = model.get_state()
    if answers(model.set_state, state) is None:
        assert state_difference(before, model.get_state()) == 0.0


@cache
def saved():
    """The bytes of a file."""
    return pack_state("RMILSRegressor", fitted("rmils").get_params(deep=False), fitted("rmils").get_state())


@given(data=st.binary(max_size=300), at=st.deferred(lambda: st.integers(0, len(saved()))), cut=st.integers(0, 300))
@FUZZ
def test_files_that_were_changed_are_refused(data, at, cut):
    changed = saved()[:at] + data + saved()[at + cut :]
    loaded = answers(unpack_state, changed)
    assert (loaded is None) == (changed != saved())
    assert answers(unpack_state, data) is None


@given(text=st.one_of(st.binary(max_size=80), st.text("tuy,;\t\n\r\"'0123456789.eE+-nainf_{}[]: ", max_size=80)))
@FUZZ
def test_lines_are_numbers_or_bad_rows(text):
    line = text if isinstance(text, bytes) else text.encode()
    for parse in (CsvParser(b"t,u,y", ["t", "u", "y"]), JsonParser(["t", "u", "y"])):
        try:
            row = parse(line)
        except BadRow:
            continue
        assert len(row) == 3
        assert np.isfinite(row).all()


@given(
    lines=st.lists(
        st.one_of(st.binary(max_size=30), st.text("0123456789.,-e", max_size=30).map(str.encode)), max_size=30
    )
)
@FUZZ
def test_a_stream_takes_any_lines(lines):
    out = []
    stream = StreamMonitor(clone(fitted("mils")), ChangeAlarm(), Options(every=7), out.append)
    parse = CsvParser(b"u,y", ["u", "y"])
    stream.feed([b"%d,%d" % (i % 3, i % 5) for i in range(10)], parse, 2)
    stream.feed(lines, parse, 12)
    bad = [r["line"] for r in out if r["kind"] == "bad_row"]
    assert bad == sorted(bad)
    assert 10 <= stream.carried.rows <= 10 + len(lines)
    assert np.isfinite(stream.model.theta_).all()


@given(text=st.text("time_s,uy\n\r0123456789.-e\"'#;nai ", max_size=200), data=st.binary(max_size=200))
@FUZZ
def test_logs_are_finite_or_refused(tmp_path, text, data):
    for content in (text.encode(), b"time_s,u,y\n" + text.encode(), data):
        path = tmp_path / "log.csv"
        path.write_bytes(content)
        found = answers(load_log, path, time="time_s", input="u", output="y", return_X_y=True)
        if found is not None:
            assert all(np.isfinite(np.asarray(v)).all() for v in found)
