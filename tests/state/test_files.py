"""State files: exact round trips, and nothing but a whole, known file is ever loaded."""

from __future__ import annotations

import hashlib
import json
import pickle
import subprocess
import sys
import warnings
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays
from sklearn.base import BaseEstimator

from whsklearn.effects import (
    Cogging,
    Coulomb,
    Effect,
    FrictionLaw,
    Quantity,
    ReducedStribeck,
    Stribeck,
    Viscous,
    reduced_law,
)
from whsklearn.state.files import (
    FORMAT_VERSION,
    decode,
    encode,
    is_state,
    pack_state,
    read_state,
    unpack_state,
    write_state,
)

keys = st.text(min_size=1, max_size=4).filter(lambda key: key != "$")  # which marks what is no plain value
plain = st.recursive(
    st.none() | st.booleans() | st.integers(-(2**53), 2**53) | st.floats(allow_nan=False) | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(keys, inner, max_size=3),
    max_leaves=8,
)


def back(value):
    arrays = []
    text = json.dumps(encode(value, arrays))
    return decode(json.loads(text), arrays)


@given(plain)
def test_plain_values_come_back(value):
    assert back(value) == value


@pytest.mark.parametrize("dtype", [np.float64, np.int64, np.bool_, np.float32])
@pytest.mark.parametrize("shape", [(), (0,), (3,), (2, 3)])
def test_arrays_keep_dtype_and_shape(dtype, shape):
    array = np.ones(shape, dtype=dtype)
    again = back({"x": array})["x"]
    assert (again.dtype, again.shape) == (array.dtype, array.shape)
    np.testing.assert_array_equal(again, array)


def test_a_generator_goes_on_where_it_stood():
    rng = np.random.default_rng(3)
    rng.normal(size=7)
    again = back(rng)
    np.testing.assert_array_equal(again.normal(size=5), rng.normal(size=5))


def test_an_effect_comes_back_as_itself():
    assert back(Cogging(0.1, 12.0, 0.3)) == Cogging(0.1, 12.0, 0.3)


def test_code_and_objects_are_refused_by_place():
    for bad in (lambda: 0, object(), np.array([object()])):
        with pytest.raises(ValueError, match=r"value\.x"):
            encode({"x": bad}, [])


class Lags(BaseEstimator):
    def __init__(self, n_a=2, law=None):
        self.n_a = n_a
        self.law = law


@dataclass(frozen=True)
class OwnDrag(Effect):
    size_: float = 1.0

    place: ClassVar[str] = "static"
    size: ClassVar[str] = "size_"
    quantities: ClassVar[dict[str, Quantity]] = {"size_": Quantity("1", 0, 1)}


NUMBERS = st.one_of(
    *[
        arrays(dtype, array_shapes(min_dims=0, max_dims=3, min_side=0, max_side=4))
        for dtype in (np.float64, np.float32, np.int64, np.int8, np.uint16, np.bool_, np.complex128)
    ]
)
LEAVES = st.one_of(st.none(), st.booleans(), st.integers(), st.floats(), st.text(max_size=5), NUMBERS)
NAMES = st.text(max_size=4).filter(lambda s: s != "$")
VALUES = st.recursive(
    LEAVES, lambda v: st.one_of(st.lists(v, max_size=3), st.dictionaries(NAMES, v, max_size=3)), max_leaves=8
)


def same(a, b):
    """Equal in type, shape and bits."""
    if isinstance(a, np.ndarray):
        return isinstance(b, np.ndarray) and a.dtype == b.dtype and a.shape == b.shape and a.tobytes() == b.tobytes()
    if isinstance(a, dict):
        return isinstance(b, dict) and list(a) == list(b) and all(same(a[k], b[k]) for k in a)
    if isinstance(a, list | tuple):
        return type(a) is type(b) and len(a) == len(b) and all(same(x, y) for x, y in zip(a, b, strict=True))
    if isinstance(a, float):
        return (isinstance(b, float) and np.float64(a).tobytes() == np.float64(b).tobytes()) or (a != a and b != b)
    return type(a) is type(b) and a == b


@given(st.dictionaries(NAMES, VALUES, max_size=4), st.dictionaries(NAMES, VALUES, max_size=4))
@settings(max_examples=150)
def test_round_trip_is_exact_to_the_bit(params, state):
    assert same(unpack_state(pack_state("k", params, state), "k"), (params, state))


def test_parameters_of_every_kind_come_back(tmp_path):
    path = tmp_path / "axis.whs"
    law = FrictionLaw([Viscous(0.1), Coulomb(0.7), ReducedStribeck(0.2), Stribeck(0.1, 0.02, 1.5), OwnDrag(0.3)][:4])
    params = {
        "lags": Lags(n_a=3, law=law),
        "law": law,
        "terms": [Coulomb(0.5), OwnDrag(0.25)],
        "orders": (1, 2),
        "theta0": np.arange(3.0),
        "p": np.int64(4),
        "names": np.array(["u", "x_hat"]),
    }
    write_state(path, "RMILSRegressor", params, {})
    loaded, _ = read_state(path, "RMILSRegressor")
    assert loaded["lags"].get_params(deep=False) == {"n_a": 3, "law": law}
    assert (loaded["law"], loaded["terms"], loaded["orders"], loaded["p"]) == (law, params["terms"], (1, 2), 4)
    np.testing.assert_array_equal(loaded["theta0"], params["theta0"])
    np.testing.assert_array_equal(loaded["names"], params["names"])
    assert is_state(path)


@pytest.mark.parametrize("kind", [np.random.PCG64, np.random.PCG64DXSM, np.random.MT19937, np.random.Philox])
def test_random_numbers_go_on_where_they_stood(kind):
    generator = np.random.Generator(kind(3))
    generator.normal(size=7)
    legacy = np.random.RandomState(3)
    legacy.normal(size=7)
    _, state = unpack_state(pack_state("k", {}, {"new": generator, "old": legacy}))
    np.testing.assert_array_equal(state["new"].normal(size=5), generator.normal(size=5))
    np.testing.assert_array_equal(state["old"].normal(size=5), legacy.normal(size=5))


def test_loaded_arrays_are_writable_and_native():
    big = np.arange(4, dtype=">f8")
    _, state = unpack_state(pack_state("k", {}, {"theta": big}))
    state["theta"][0] = 5.0
    assert state["theta"].dtype.isnative


@pytest.mark.parametrize(
    "value",
    [lambda: 0, object(), {1: 2}, {"$": 1}, np.array([object()]), 1j, {1.5}, type, b"bytes", np.datetime64("2020")],
)
def test_what_cannot_be_held_is_refused_and_nothing_is_written(tmp_path, value):
    path = tmp_path / "axis.whs"
    write_state(path, "k", {}, {"n": 1})
    with pytest.raises(ValueError, match=r"parameters\.deep"):
        write_state(path, "k", {"deep": {"er": [value]}}, {})
    assert read_state(path, "k") == ({}, {"n": 1})
    assert [p.name for p in tmp_path.iterdir()] == ["axis.whs"]


@pytest.fixture(scope="module")
def sample():
    return pack_state("k", {"p": 4, "law": reduced_law()}, {"theta": np.arange(9.0), "P": np.eye(3)})


def test_every_truncation_is_refused(sample):
    for n in range(len(sample)):
        with pytest.raises(ValueError, match="state file"):
            unpack_state(sample[:n])


@given(st.data())
@settings(max_examples=300)
def test_every_edit_is_refused(sample, data):
    at = data.draw(st.integers(0, len(sample) - 1))
    new = data.draw(st.integers(0, 255).filter(lambda b: b != sample[at]))
    with pytest.raises(ValueError, match="state file"):
        unpack_state(sample[:at] + bytes([new]) + sample[at + 1 :])


def test_appended_bytes_are_refused(sample):
    with pytest.raises(ValueError, match="checksum"):
        unpack_state(sample + b"\0")


class _Bomb:
    """Shows whether a reader unpickles."""

    def __reduce__(self):
        return (warnings.warn, ("executed",))


@pytest.mark.parametrize(
    "foreign", [b"", b"\n", b"PK\x03\x04", b"whsklearn-state x\n", pickle.dumps(_Bomb()), b"a,b\n1,2\n"]
)
def test_foreign_files_are_refused_and_not_executed(tmp_path, foreign):
    path = tmp_path / "foreign"
    path.write_bytes(foreign)
    with pytest.raises(ValueError, match=r"foreign: this is not a whsklearn state file"):
        read_state(path)


def test_missing_file_wrong_kind_and_other_format(tmp_path, sample):
    with pytest.raises(FileNotFoundError):
        read_state(tmp_path / "none", "k")
    with pytest.raises(ValueError, match="state of a k, expected one of a MILS"):
        unpack_state(sample, "MILS")
    for other in (FORMAT_VERSION - 1, FORMAT_VERSION + 1):
        with pytest.raises(ValueError, match="upgrade whsklearn, or start over"):
            unpack_state(sample.replace(b"state %d\n" % FORMAT_VERSION, b"state %d\n" % other, 1))


def forge(header, buffer=b""):
    """A file whose checksum is right, as one who means harm would write it."""
    first = b"whsklearn-state %d\n" % FORMAT_VERSION
    rest = (header if isinstance(header, bytes) else json.dumps(header).encode()) + b"\n" + buffer
    return first + hashlib.sha256(first + rest).hexdigest().encode() + b"\n" + rest


EMPTY = {"kind": "k", "parameters": {}, "state": {}, "arrays": []}


@pytest.mark.parametrize(
    "header",
    [
        b"not json",
        b"[" * 100_000,
        b"[]",
        b"{}",
        {**EMPTY, "kind": 3},
        {**EMPTY, "state": 3},
        {**EMPTY, "arrays": 3},
        {**EMPTY, "arrays": [["<f8", [10**12]]]},
        {**EMPTY, "arrays": [["<f8", [0, 10**40]]]},
        {**EMPTY, "arrays": [["<f8", [-1]]]},
        {**EMPTY, "arrays": [["|O", [1]]]},
        {**EMPTY, "arrays": [["nonsense", [1]]]},
        {**EMPTY, "state": {"a": {"$": "array", "index": 0}}},
        {**EMPTY, "state": {"a": {"$": "array", "index": -1}}},
        {**EMPTY, "state": {"a": {"$": "os.system", "items": ["true"]}}},
        {**EMPTY, "state": {"a": {"$": ["tuple"]}}},
        {**EMPTY, "state": {"a": {"$": "estimator", "class": "subprocess.Popen", "params": {}}}},
        {**EMPTY, "state": {"a": {"$": "effect", "class": "Coulomb", "fields": {"torque": "x"}}}},
        {**EMPTY, "state": {"a": {"$": "effect", "class": "Coulomb", "fields": {"nonsense": 1.0}}}},
        {**EMPTY, "state": {"a": {"$": "generator", "state": {"bit_generator": "nonsense"}}}},
    ],
)
def test_forged_headers_are_refused(header):
    with pytest.raises(ValueError, match=r".+"):
        unpack_state(forge(header, b"\0" * 4))


KILLING = """
import os, random, signal, sys, time
import numpy as np
from whsklearn.state import read_state, write_state

path, kills, seed = sys.argv[1], int(sys.argv[2]), int(sys.argv[3])
random.seed(seed)
write_state(path, "k", {}, {"n": 0, "theta": np.zeros(5000)})
advanced = 0
for kill in range(kills):
    before = read_state(path, "k")[1]["n"]
    child = os.fork()
    if child == 0:
        n = before
        while True:
            n += 1
            write_state(path, "k", {}, {"n": n, "theta": np.full(5000, float(n))})
    while kill % 2 and read_state(path, "k")[1]["n"] == before:  # however busy the machine is, it is killed at work
        time.sleep(0.001)
    time.sleep(random.uniform(0.0, 0.02))
    os.kill(child, signal.SIGKILL)
    os.waitpid(child, 0)
    state = read_state(path, "k")[1]
    assert state["n"] >= before and np.all(state["theta"] == state["n"]), (before, state["n"])
    advanced += state["n"] > before
print(advanced)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="SIGKILL and fork")
def test_whoever_is_killed_and_when_there_is_a_whole_file(tmp_path):
    path = tmp_path / "axis.whs"
    done = subprocess.run(
        [sys.executable, "-c", KILLING, str(path), "60", "7"], check=True, capture_output=True, text=True
    )
    assert int(done.stdout) >= 30  # every second child had written before it died
