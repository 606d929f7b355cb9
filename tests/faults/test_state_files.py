"""State files under threads, links and modes, and forged ones: refused at once, in little memory."""

from __future__ import annotations

import copy
import hashlib
import json
import os
import stat
import threading
import time
import tracemalloc

import numpy as np
import pytest

from whsklearn import RMILSRegressor, WienerHammersteinLags
from whsklearn.datasets import make_wiener_hammerstein
from whsklearn.state import atomic_write, check_writable, pack_state, read_state, write_state

X, Y = make_wiener_hammerstein(120, random_state=0)
MODEL = RMILSRegressor(WienerHammersteinLags(), n_starts=2, memory=64, random_state=0).partial_fit(X, Y)
PARAMS, STATE = MODEL.get_params(deep=False), MODEL.get_state()


def test_threads_that_save_to_one_path_leave_a_whole_file_and_nothing_else(tmp_path):
    path, errors = tmp_path / "axis.whs", []

    def save(value):
        try:
            for _ in range(20):
                write_state(path, "k", {}, {"theta": np.full(3000, value)})
        except Exception as error:
            errors.append(error)

    threads = [threading.Thread(target=save, args=(float(i),)) for i in range(6)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert errors == []
    assert np.ptp(read_state(path, "k")[1]["theta"]) == 0.0
    assert os.listdir(tmp_path) == ["axis.whs"]


def test_mode_and_link_of_a_file_that_is_replaced_stay(tmp_path):
    path, link = tmp_path / "axis.whs", tmp_path / "link.whs"
    write_state(path, "k", {}, {"n": 1})
    path.chmod(0o640)
    link.symlink_to(path)
    write_state(link, "k", {}, {"n": 2})
    assert link.is_symlink()
    assert read_state(path, "k")[1] == {"n": 2}
    assert stat.S_IMODE(path.stat().st_mode) == 0o640


def test_a_long_name_and_a_failing_disk(tmp_path, monkeypatch):
    path = tmp_path / ("n" * 250)
    atomic_write(path, b"old")

    def full(descriptor):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(OSError, match=r"No space left on device: .*nnn"):
        atomic_write(path, b"new")
    assert path.read_bytes() == b"old"
    assert len(os.listdir(tmp_path)) == 1


def test_what_cannot_be_written_is_told_before(tmp_path):
    check_writable(tmp_path / "new")
    assert os.listdir(tmp_path) == []
    with pytest.raises(ValueError, match="is a folder"):
        check_writable(tmp_path)
    with pytest.raises(ValueError, match="does not exist"):
        check_writable(tmp_path / "none" / "file")


def forge(params=None, lags=None, state=None, header=None, **outer):
    """A file of that model with other values, and a checksum that holds."""
    data = pack_state("RMILSRegressor", PARAMS, STATE)
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
    state = copy.deepcopy(STATE)
    state["state"][name] = np.full_like(state["state"][name], np.nan)
    write_state(path, "RMILSRegressor", PARAMS, state)
    with pytest.raises(ValueError, match=f"NaN in {name}"):
        RMILSRegressor.load(path)
