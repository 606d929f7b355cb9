"""`reference.c` compiled in a temporary folder, where there is a compiler, and called through ctypes."""

from __future__ import annotations

import ctypes
import functools
import itertools
import shutil
import subprocess
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks._peers import P0, Answer, Array

FLAGS = ("-O3", "-march=native", "-ffp-contract=off", "-shared", "-fPIC")  # no fused products: the same rounding


class NoCompiler(ImportError):
    """Neither cc nor gcc is there."""

    name = "a C compiler"


@functools.cache
def library(*more: str) -> Any:
    """The compiled reference; ``more`` flags."""
    compiler = shutil.which("gcc") or shutil.which("cc")
    if compiler is None:
        raise NoCompiler
    with tempfile.TemporaryDirectory() as folder:
        target = Path(folder, "reference.so")
        source = Path(__file__).with_name("reference.c")
        subprocess.run([compiler, *FLAGS, *more, str(source), "-o", str(target), "-lm"], check=True)
        return ctypes.CDLL(str(target))  # stays mapped when the folder goes


def _at(array: Array) -> ctypes.c_void_p:
    assert array.flags.c_contiguous
    return ctypes.c_void_p(array.ctypes.data)


def c_calls(X: Array, y: Array) -> Answer:
    """A call of C for each row, as a Python program would make it with its pointers at hand."""
    lib, n = library(), X.shape[1]
    theta, ud = np.zeros(n), P0 * np.eye(n)
    state = _at(theta), _at(ud)
    rows = [(row.copy(), np.array([target])) for row, target in zip(X, y, strict=True)]
    one, columns, run = ctypes.c_long(1), ctypes.c_int(n), lib.rls_rows
    began = time.process_time()
    for row, target in rows:
        run(*state, row.ctypes.data_as(ctypes.c_void_p), target.ctypes.data_as(ctypes.c_void_p), one, columns)
    return theta, time.process_time() - began


def c_rows(X: Array, y: Array) -> Answer:
    """One call of C for all rows: the arithmetic alone."""
    lib, n = library(), X.shape[1]
    theta, ud = np.zeros(n), P0 * np.eye(n)
    began = time.process_time()
    lib.rls_rows(_at(theta), _at(ud), _at(X), _at(y), ctypes.c_long(len(y)), ctypes.c_int(n))
    return theta, time.process_time() - began


def c_rmils(u: Array, y: Array, start: Array, *, at_run_time: bool = False) -> Answer:
    """RMILS, p = 4, exact gradient, from one start; orders fixed when it is compiled, or known at run time only."""
    lib, theta, u = library(*["-DAT_RUN_TIME"] * at_run_time), start.copy(), np.ascontiguousarray(u)
    began = time.process_time()
    lib.rmils(_at(theta), ctypes.c_double(1.0), _at(u), _at(y), ctypes.c_long(len(y)))
    return theta, time.process_time() - began


def c_axes(X: Array, y: Array, threads: int, *, abreast: bool) -> Answer:
    """Many axes on some threads: one after another, or eight abreast; seconds of CPU over threads."""
    lib, (axes, count, n) = library(), X.shape
    theta, ud = np.zeros((axes, n)), np.repeat(P0 * np.eye(n)[None], axes, axis=0)
    cuts = [8 * (axes // 8 * i // threads) for i in range(threads)] + [axes]

    def some(piece: slice) -> None:
        t, x, targets = theta[piece], X[piece], y[piece]
        size = ctypes.c_long(len(t)), ctypes.c_long(count)
        if abreast:
            lib.rls_axes_abreast(_at(t), _at(x), _at(targets), *size, ctypes.c_double(P0))
        else:
            lib.rls_axes(_at(t), _at(ud[piece]), _at(x), _at(targets), *size, ctypes.c_int(n))

    began = time.process_time()
    with ThreadPoolExecutor(threads) as pool:
        list(pool.map(some, [slice(a, b) for a, b in itertools.pairwise(cuts)]))
    return theta, (time.process_time() - began) / threads
