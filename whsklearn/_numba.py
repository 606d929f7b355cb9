"""Numba's ``njit`` with a cache that also sees a change in the files that a kernel calls.

Numba keys its cache on the file of the function itself; what that function inlines from other files may
change without it, and yesterday's physics is run.  Here every module's kernels are cached in a folder named
by a fingerprint of that file and of all files of the package that it imports, directly or not, so a change
anywhere below gives another folder.  Only documented means are used: ``numba.config.CACHE_DIR`` (the setting
behind ``NUMBA_CACHE_DIR``) is set while a kernel is declared and put back after.
"""

from __future__ import annotations

import hashlib
import logging
import os
import re
import time
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numba
from numba.core import event

_settings: Any = numba.config  # its attributes are made at run time
_declare: Any = numba.njit
_ROOT = Path(__file__).resolve().parent
_IMPORT = re.compile(r"^\s*from\s+(whsklearn[\w.]*)\s+import\s+(\([^)]*\)|[^\n]*)|^\s*import\s+(whsklearn[\w.]*)", re.M)


class _Compiling(event.Listener):
    """CPU seconds that this process has spent compiling kernels of the package; the first of them is announced."""

    WORTH_A_WORD = 1.0  # seconds: an odd law costs a tenth, a first run ten

    def __init__(self) -> None:
        self.seconds, self.told = 0.0, False
        self._depth, self._began = 0, 0.0

    def on_start(self, _: Any) -> None:
        """A function begins; those that it calls are compiled inside."""
        if not self._depth:
            self._began = time.process_time()
        self._depth += 1

    def on_end(self, e: Any) -> None:
        """It ends."""
        self._depth -= 1
        # a function of a user's own may stand in no module
        if self._depth or not (e.data["dispatcher"].py_func.__module__ or "").startswith("whsklearn."):
            return
        self.seconds += time.process_time() - self._began
        if self.seconds > self.WORTH_A_WORD and not self.told:
            self.told = True
            logging.getLogger("whsklearn").warning("compiling once on this machine, some 5 to 30 s; later runs load it")


_compiling = _Compiling()
event.register("numba:compile", _compiling)


def compiling_seconds() -> float:
    """CPU seconds that went into compiling kernels, in this process so far: they are nobody's fit."""
    return _compiling.seconds


def njit(*signature: Any, cache: bool = True, **options: Any) -> Any:
    """`numba.njit` with the cache on and keyed on all that is inlined; used in the same ways.

    Parameters
    ----------
    *signature : function, or a Numba signature
        The function itself where the decorator has no brackets.
    cache : bool
        False for small functions that only other kernels call: they live in the caller's entry.
    **options
        Of `numba.njit`.
    """
    if len(signature) == 1 and callable(signature[0]) and hasattr(signature[0], "__code__"):
        return njit(cache=cache, **options)(signature[0])

    def decorate(function: Callable[..., Any]) -> Any:
        # nothing here is called through a C pointer (`effects.own` makes its own), and the wrapper for it is a sixth of
        # the time that compiling takes
        declare = _declare(*signature, cache=cache, no_cfunc_wrapper=True, **options)
        if not cache:
            return declare(function)
        before = _settings.CACHE_DIR
        _settings.CACHE_DIR = str(_folder(Path(function.__code__.co_filename)))
        try:
            return declare(function)
        finally:
            _settings.CACHE_DIR = before

    return decorate


def part(function: Callable[..., Any]) -> Any:
    """A function that other kernels call: compiled with them, and kept in their cache entries.

    An entry of its own would cost every first run a third of what compiling it costs, and spare no later run anything.
    """
    return njit(cache=False, error_model="numpy")(function)


@cache
def fingerprint(path: Path) -> str:
    """Hexadecimal digest of a file and of all files of the package below it in the order of imports."""
    seen: dict[Path, bytes] = {}
    waiting = [path]
    while waiting:
        file = waiting.pop()
        if file not in seen:
            seen[file] = file.read_bytes()
            waiting += imported(seen[file].decode())
    digest = hashlib.sha256()
    for file in sorted(seen):
        digest.update(str(file.relative_to(_ROOT) if file.is_relative_to(_ROOT) else file).encode())
        digest.update(seen[file])
    return digest.hexdigest()[:16]


def imported(source: str) -> list[Path]:
    """Files of the package that a source imports, by their names in its import statements."""
    files = []
    for package, names, module in _IMPORT.findall(source):
        base = _file(package or module)
        files += [base] if base is not None else []
        for name in re.findall(r"\w+", re.sub(r"#[^\n]*|\bas\s+\w+", "", names)):
            part = _file(f"{package}.{name}")
            files += [part] if part is not None else []
    return files


def _file(module: str) -> Path | None:
    """The file of a module of the package, None if there is no such module; ``__init__`` files hold no kernel."""
    file = _ROOT.joinpath(*module.split(".")[1:]).with_suffix(".py") if "." in module else None
    return file if file is not None and file.is_file() else None


def _folder(path: Path) -> Path:
    """Where the kernels of a file are cached: beside it, or where the user says, or in the user's cache."""
    chosen = _settings.CACHE_DIR
    beside = path.parent / "__pycache__"
    if chosen:
        base = Path(chosen)
    elif os.access(beside if beside.is_dir() else path.parent, os.W_OK):
        base = beside
    else:
        base = Path(os.environ.get("XDG_CACHE_HOME", Path.home() / ".cache")) / "whsklearn"
    return base / fingerprint(path.resolve())
