"""Runs exported C code: a compiler and ctypes."""

from __future__ import annotations

import ctypes
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

REPLAY = """
#include "model.h"
void replay(const {real} *u, {real} *y, int *held, long n)
{{
    model_state s;
    long i;
    model_init(&s);
    for (i = 0; i < n; ++i) {{
        y[i] = model_step(&s, u[i]);
        held[i] = s.held;
    }}
}}
"""
FLAGS = ["-std=c99", "-O1", "-Wall", "-Wextra", "-Wconversion", "-Werror", "-pedantic", "-shared", "-fPIC"]


@pytest.fixture
def compiler():
    found = shutil.which("gcc") or shutil.which("cc")
    if found is None:
        pytest.skip("no C compiler on this machine")
    return found


@pytest.fixture
def replay(compiler, tmp_path):
    """Compile what was written into ``tmp_path`` and replay a drive; ``replay.flags`` tells which of it was held."""

    def both(u, real="double"):
        Path(tmp_path, "replay.c").write_text(REPLAY.format(real=real))
        subprocess.run([compiler, *FLAGS, "model.c", "replay.c", "-o", "model.so", "-lm"], cwd=tmp_path, check=True)
        kind = ctypes.c_double if real == "double" else ctypes.c_float
        u = np.ascontiguousarray(u, dtype=kind)
        y = np.empty_like(u)
        pointer = ctypes.POINTER(kind)
        library = ctypes.CDLL(str(tmp_path / "model.so"))
        held = np.empty(u.size, dtype=ctypes.c_int)
        numbers = held.ctypes.data_as(ctypes.POINTER(ctypes.c_int))
        library.replay.argtypes = [pointer, pointer, type(numbers), ctypes.c_long]
        library.replay(u.ctypes.data_as(pointer), y.ctypes.data_as(pointer), numbers, u.size)
        return y.astype(float), held.astype(bool)

    def run(u, real="double"):
        return both(u, real)[0]

    run.flags = lambda u, real="double": both(u, real)[1]
    return run


@pytest.fixture
def drive():
    t = np.arange(3000) / 1000.0
    noise = np.random.default_rng(1).standard_normal(t.size)
    return 0.9 * np.sin(2 * np.pi * 0.7 * t) + 0.4 * np.sin(2 * np.pi * 3.1 * t + 1.0) + 0.1 * noise
