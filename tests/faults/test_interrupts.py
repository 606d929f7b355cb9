"""A call that an exception or a signal ends has learnt nothing, or whole rows that it tells of; the end is the same."""

from __future__ import annotations

import copy
import inspect
import signal
import sys
import threading
import time

import numpy as np
import pytest

from whsklearn import InverseDynamicsLags, MILSRegressor, RLSRegressor, RMILSRegressor, WienerHammersteinLags
from whsklearn.checks import state_difference
from whsklearn.datasets import make_wiener_hammerstein
from whsklearn.recursion.memory.blocks import increment_rms

# a record of a dynamic system stands in for rows here
pytestmark = pytest.mark.filterwarnings("ignore:X has one column")

LAGS = WienerHammersteinLags()
X, Y = make_wiener_hammerstein(400, random_state=0)
MODELS = {
    "RLS on rows": RLSRegressor(),
    "MILS on rows": MILSRegressor(p=3),
    "RMILS": RMILSRegressor(LAGS, n_starts=2, memory=64, random_state=0),
    "RMILS, pure": RMILSRegressor(LAGS, n_starts=2, memory=0, random_state=0),
    "MILS, published": MILSRegressor(LAGS, gradient="pseudolinear"),
}


class Stopped(BaseException):
    """Neither an Exception nor a KeyboardInterrupt, as the time limit of a tool may be."""


class At:
    """Raise at the k-th call or return in the library's own code: that is where Python takes signals."""

    def __init__(self, k, error):
        self.left, self.error = k, error

    def __call__(self, frame, event, argument):
        generator = frame.f_code.co_flags & inspect.CO_GENERATOR  # what is raised while one is closed, Python drops
        if "/whsklearn/" in frame.f_code.co_filename and not generator:
            self.left -= 1
            if self.left == 0:
                sys.setprofile(None)
                raise self.error


def interrupted(call, k, error):
    """Whether the call has a k-th such place; it is interrupted there."""
    sys.setprofile(At(k, error))
    try:
        call()
    except type(error):
        return True
    finally:
        sys.setprofile(None)
    return False


def learnt(model, stop, start=0, size=7):
    for at in range(start, stop, size):
        piece = slice(at, min(at + size, stop))
        model.partial_fit(X[piece], Y[piece])
    return model


def every_place(begin, call, error, most=16):
    """The model after an interrupt at each of the first places and at ever sparser ones after that."""
    k, step = 1, 1
    while True:
        model = begin()
        if not interrupted(lambda model=model: call(model), k, error):
            break
        yield model
        k += step
        step += max(k - most, 0) // 4
    assert k > 3


@pytest.mark.parametrize(
    ("name", "error"),
    [*((name, KeyboardInterrupt()) for name in MODELS), ("RMILS", Stopped()), ("MILS on rows", MemoryError())],
)
def test_interrupted_anywhere_it_holds_whole_rows_and_goes_on_to_the_same_end(name, error):
    """One row after others, rows beyond a re-run of the memory, more rows than are noted; and marked experiments."""
    calls = {
        (60, 61): {}, (63, 67): {}, (90, 190): {}, (80, 85): {"groups": np.repeat("b", 5)},
    }  # fmt: skip
    for (begun, stop), more in calls.items():
        piece = slice(begun, stop)

        def call(model, piece=piece, more=more):
            model.partial_fit(X[piece], Y[piece], **more)

        base = learnt(copy.deepcopy(MODELS[name]), begun - 9)

        def begin(base=base, begun=begun):
            return learnt(copy.deepcopy(base), begun, begun - 9, 3)  # so that there are rows to be learnt anew

        before, after = begin().get_state(), begin()
        call(after)
        for model in every_place(begin, call, error):
            seen = model.state_["seen"]
            assert seen in (begun, stop)  # all rows of the call, or none
            assert state_difference(model.get_state(), before if seen == begun else after.get_state()) == 0.0
            if seen == begun:
                call(model)
            assert state_difference(model.get_state(), after.get_state()) == 0.0


@pytest.mark.parametrize("name", ["RLS on rows", "RMILS"])
@pytest.mark.parametrize("method", ["consolidate", "forget_past", "fit", "first partial_fit", "set_state"])
def test_other_calls_do_all_or_nothing(name, method):
    other = learnt(copy.deepcopy(MODELS[name]), 80).get_state()

    def call(model):
        arguments = {"fit": (X[:90], Y[:90]), "partial_fit": (X[:90], Y[:90]), "set_state": (other,)}
        getattr(model, method.split()[-1])(*arguments.get(method.split()[-1], ()))

    begin = {True: lambda: copy.deepcopy(MODELS[name]), False: lambda: learnt(copy.deepcopy(MODELS[name]), 70)}
    begin = begin[method.startswith("first")]
    after = begin()
    call(after)
    for model in every_place(begin, call, KeyboardInterrupt(), most=6):
        if not hasattr(model, "state_"):
            assert not hasattr(model, "n_features_in_")
            continue
        same = [state_difference(model.get_state(), m.get_state()) for m in (begin(), after) if hasattr(m, "state_")]
        assert 0.0 in same


def test_lags_that_carry_a_motion_go_back_too():
    t = 0.001 * np.arange(300)
    X, y = np.sin(9 * t + np.sin(40 * t))[:, None], np.cos(7 * t)
    begun = RLSRegressor(InverseDynamicsLags(sample_rate=1000, cutoff=100, causal=True)).partial_fit(X[:200], y[:200])
    after = copy.deepcopy(begun).partial_fit(X[200:250], y[200:250])
    for model in every_place(
        lambda: copy.deepcopy(begun), lambda m: m.partial_fit(X[200:250], y[200:250]), MemoryError()
    ):
        if model.state_["seen"] != after.state_["seen"]:
            assert state_difference(model.get_state(), begun.get_state()) == 0.0
            model.partial_fit(X[200:250], y[200:250])
        assert state_difference(model.get_state(), after.get_state()) == 0.0


@pytest.mark.skipif(threading.current_thread() is not threading.main_thread(), reason="signals go to the main thread")
def test_an_interrupt_in_a_long_kernel_arrives_as_one():
    """It is pending when the kernel's answer is boxed, which made a SystemError of it."""
    theta, dims = np.array([0.5, -0.5]), np.array([2, 1, 1, 1, 0])
    u, restart = np.ones((3_000_000, 1)), np.zeros(3_000_000, dtype=np.bool_)
    increment_rms(theta, dims, u[:2], restart[:2])  # compiled, or from the cache

    def ring(number, frame):
        raise KeyboardInterrupt

    def ask():
        signal.setitimer(signal.ITIMER_REAL, 0.005)
        while True:
            increment_rms(theta, dims, u, restart)

    before = signal.signal(signal.SIGALRM, ring)
    try:
        with pytest.raises(KeyboardInterrupt):
            ask()
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)


# Hypothesis, where it has run before in the process, times garbage collection in a callback; an interrupt there is lost
@pytest.mark.filterwarnings("ignore:Exception ignored in.*gc_callback:pytest.PytestUnraisableExceptionWarning")
@pytest.mark.skipif(threading.current_thread() is not threading.main_thread(), reason="signals go to the main thread")
@pytest.mark.parametrize("name", MODELS)
def test_interrupted_by_a_clock_again_and_again(name):
    """Real signals, wherever they fall, one row or a few at a time: 0 rows lost, 0 learnt twice."""
    undisturbed = learnt(copy.deepcopy(MODELS[name]), 400, size=2)
    model, rng, hits = learnt(copy.deepcopy(MODELS[name]), 20), np.random.default_rng(0), 0

    def ring(number, frame):
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGALRM, ring)
    end = time.monotonic() + 20
    try:
        while (at := model.state_["seen"]) < 400:
            assert time.monotonic() < end
            piece = slice(at, at + 2 - at % 2)
            try:
                signal.setitimer(signal.ITIMER_REAL, 10 ** rng.uniform(-5.7, -1.5))
                model.partial_fit(X[piece], Y[piece])
                signal.setitimer(signal.ITIMER_REAL, 0)
            except KeyboardInterrupt:
                hits += 1
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)
    assert state_difference(model.get_state(), undisturbed.get_state()) <= 1e-12
    assert hits > 0
