"""State files under threads, links and modes, and forged ones: refused at once, in little memory."""

from __future__ import annotations

import copy
import hashlib
import json
import time
import tracemalloc
from functools import cache

import numpy as np
import pytest

from whsklearn import RMILSRegressor, WienerHammersteinLags
from whsklearn.datasets import make_wiener_hammerstein
from whsklearn.state.files import pack_state, write_state


@cache
def saved():
    """The parameters and the state of a model."""
    model = RMILSRegressor(WienerHammersteinLags(), n_starts=2, memory=64, random_state=0)
    model.partial_fit(*make_wiener_hammerstein(120, random_state=0))
    return model.get_params(deep=False), model.get_state()


def forge(params=None, lags=None, state=None, header=None, **outer):
    """A file of that model with other values, and a checksum that holds."""
    data = pack_state("RMILSRegressor", *saved())
    first, _, line, buffer = data.split(b"\n", 3)
    made = copy.deepcopy(json.loads(line))
    made["parameters"].update(params or {})
    made["parameters"]["lags"]["params"].update(lags or {})
    made["state"]["state"].update(state or {})
    made["state"].update(outer)
    line = header if header is not None else json.dumps(made).encode()
    rest = line + b"\n" + buffer
    return first + b"\n" + hashlib.sha256(first + b"\n" + rest).hexdigest().encode() + b"\n" + rest


def deep(n):
    return b'{"kind":"RMILSRegressor","parameters":{"a":' + b"[" * n + b"]" * n + b'},"state":{},"arrays":[]}'


def many(item, n):
    return b'{"kind":"RMILSRegressor","parameters":{"a":[' + b",".join([item] * n) + b']},"state":{},"arrays":[]}'


ESTIMATOR = b'{"$":"estimator","class":"RLSRegressor","params":{}}'
FORGED = {
    "memory": lambda: forge({"memory": 10**12}),
    "memory that fits the machine": lambda: forge({"memory": 10**8}),
    "p": lambda: forge({"p": 10**9}),
    "starts": lambda: forge({"n_starts": 10**9, "memory": 0}),
    "orders": lambda: forge(lags={"n_a": 10**8}),
    "inputs": lambda: forge(n_features_in=10**9),
    "inputs in words": lambda: forge(n_features_in="one"),
    "NaN": lambda: forge({"forgetting": float("nan")}),
    "newer": lambda: forge({"smoothing": 3}),
    "newer lags": lambda: forge(lags={"smoothing": 3}),
    "a count beyond every stream": lambda: forge(state={"seen": 2**63}),
    "fill": lambda: forge(state={"fill": 10**9}),
    "count below zero": lambda: forge(state={"seen": -5}),
    "no count": lambda: forge(state={"seen": None}),
    "nested": lambda: forge(header=deep(900)),
    "nested deeply": lambda: forge(header=deep(100_000)),
    "many lists": lambda: forge(header=many(b"[]", 3_000_000)),
    "many estimators": lambda: forge(header=many(ESTIMATOR, 15_000)),
}


@pytest.mark.parametrize("name", FORGED)
def test_forged_files_are_refused_within_a_second_and_100_mb(tmp_path, name):
    path = tmp_path / "forged.whs"
    path.write_bytes(FORGED[name]())
    tracemalloc.start()
    began = time.thread_time()
    try:
        with pytest.raises(ValueError, match=r"forged.whs: ") as error:
            RMILSRegressor.load(path)
        _, most = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert "\n" not in str(error.value)
    assert time.thread_time() - began < 2.0  # 1 s, and what tracing every allocation costs
    assert most < 100e6


@pytest.mark.parametrize("name", ["theta", "ud", "loss", "memory_y", "before"])
def test_nan_in_a_state_is_refused(tmp_path, name):
    path = tmp_path / "axis.whs"
    params, state = copy.deepcopy(saved())
    state["state"][name] = np.full_like(state["state"][name], np.nan)
    write_state(path, "RMILSRegressor", params, state)
    with pytest.raises(ValueError, match=f"NaN in {name}"):
        RMILSRegressor.load(path)
