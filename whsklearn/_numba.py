"""Numba's ``njit`` with a cache that also sees a change in the files that a kernel calls.

Numba keys its cache on the file of the function itself; what that function inlines from other files may
change without it, and yesterday's physics is run.  Here every module's kernels are cached in a folder named
by a fingerprint of that file and of all files of the package that it imports, directly or not, so a change
anywhere below gives another folder.  Only documented means are used: ``numba.config.CACHE_DIR`` (the setting
behind ``NUMBA_CACHE_DIR``) is set while a kernel is declared and put back after.
"""

from __future__ import annotations

import contextlib
import functools
import gc
import hashlib
import logging
import os
import re
import stat
import tempfile
import time
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import Any

import numba
from numba.core import event

from whsklearn._numba_pipelines import KERNEL, LINKED, SHORT

# Of Python's garbage collection while a kernel is compiled, which makes millions of small objects that nobody drops
# before its end: looking through them again and again was a tenth of the time.
THRESHOLDS = 50_000, 50, 50
_settings: Any = numba.config  # its attributes are made at run time
_declare: Any = numba.njit
_ROOT = Path(__file__).resolve().parent
_IMPORT = re.compile(r"^\s*from\s+(whsklearn[\w.]*)\s+import\s+(\([^)]*\)|[^\n]*)|^\s*import\s+(whsklearn[\w.]*)", re.M)


class _Compiling(event.Listener):
    """CPU seconds that this process has spent compiling kernels of the package; the first of them is announced."""

    WORTH_A_WORD = 1.0  # seconds: an odd law costs a tenth, a first run ten

    def __init__(self) -> None:
        self.seconds, self.told = 0.0, False
        self.kept = True  # for the next process
        self._depth, self._began = 0, 0.0

    def on_start(self, _: Any) -> None:
        """A function begins; those that it calls are compiled inside."""
        if not self._depth:
            self._threshold = gc.get_threshold()
            gc.set_threshold(*THRESHOLDS)
            self._began = time.process_time()
        self._depth += 1

    def on_end(self, e: Any) -> None:
        """It ends."""
        self._depth -= 1
        if not self._depth:
            gc.set_threshold(*self._threshold)
        # a function of a user's own may stand in no module
        if self._depth or not (e.data["dispatcher"].py_func.__module__ or "").startswith("whsklearn."):
            return
        self.seconds += time.process_time() - self._began
        if self.seconds > self.WORTH_A_WORD and not self.told:
            self.told = True
            logging.getLogger("whsklearn").warning(
                "compiling once on this machine, some 5 to 30 s; later runs load it"
                if self.kept
                else "compiling, some 5 to 30 s in every process, as no folder can be written to that would keep it; "
                "set NUMBA_CACHE_DIR to one"
            )


_compiling = _Compiling()
event.register("numba:compile", _compiling)


def compiling_seconds() -> float:
    """CPU seconds that went into compiling kernels, in this process so far: they are nobody's fit."""
    return _compiling.seconds


class Part:
    """A function that kernels call; called from Python it is a kernel of its own, which is made when that happens.

    Parameters
    ----------
    function : function
    **options
        Of `numba.njit`.
    """

    def __init__(self, function: Callable[..., Any], **options: Any):
        functools.update_wrapper(self, function)
        self.py_func = function
        self._options = options
        self._linked = _declare(pipeline_class=LINKED, no_cpython_wrapper=True, no_cfunc_wrapper=True, **options)(
            function
        )

    @property
    def _numba_type_(self) -> Any:
        """By which Numba knows what a kernel calls (as it knows its own functions)."""
        return numba.types.Dispatcher(self._linked)

    @functools.cached_property
    def _alone(self) -> Any:
        return njit(**self._options)(self.py_func)

    def __call__(self, *args: Any) -> Any:
        return self._alone(*args)

    def __reduce__(self) -> str:
        return self.py_func.__qualname__


def njit(*signature: Any, cache: bool = True, short: bool = False, **options: Any) -> Any:
    """`numba.njit` with the cache on and keyed on all that is inlined; used in the same ways.

    Parameters
    ----------
    *signature : function, or a Numba signature
        The function itself where the decorator has no brackets.
    cache : bool
        False for functions that kernels call: they are compiled within them and live in their entries (`Part`).
    short : bool
        True for kernels whose inner loops are short, over a handful of parameters (`_numba_pipelines`).
    **options
        Of `numba.njit`.
    """
    if len(signature) == 1 and callable(signature[0]) and hasattr(signature[0], "__code__"):
        return njit(cache=cache, short=short, **options)(signature[0])

    def decorate(function: Callable[..., Any]) -> Any:
        if not cache and LINKED is not None and not _settings.DISABLE_JIT:
            return Part(function, **options)
        # nothing here is called through a C pointer (`effects.own` makes its own), and the wrapper for it is a sixth of
        # the time that compiling takes
        pipeline = SHORT if short else KERNEL
        folder = _folder(Path(function.__code__.co_filename)) if cache else None
        declare = _declare(
            *signature, cache=folder is not None, no_cfunc_wrapper=True, pipeline_class=pipeline, **options
        )
        if folder is None:
            return declare(function)
        before = _settings.CACHE_DIR
        _settings.CACHE_DIR = str(folder)
        try:
            return declare(function)
        finally:
            _settings.CACHE_DIR = before

    return decorate


def part(function: Callable[..., Any]) -> Any:
    """A function that kernels call, as `Part`: compiled within them, and kept in their cache entries."""
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


def _folder(path: Path) -> Path | None:
    """Where the kernels of a file are cached: where the user says, else beside it, or in the user's cache.

    The temporary folder where none of these can be written to, as in a container; None where that cannot either.
    """
    for base in _bases(path.parent / "__pycache__"):
        if _writable(base):
            return base / fingerprint(path.resolve())
    _compiling.kept = False
    return None


def _bases(beside: Path) -> Iterator[Path]:
    """Folders to try, the best first."""
    if _settings.CACHE_DIR:
        yield Path(_settings.CACHE_DIR)
    else:
        yield beside
        with contextlib.suppress(RuntimeError):  # no home at all
            yield Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "whsklearn"
    with contextlib.suppress(FileNotFoundError):  # no temporary folder either
        yield _own_temporary_folder()


@cache
def _own_temporary_folder() -> Path:
    """One that only this user can write to: what is in a cache is run as code."""
    user = os.getuid() if hasattr(os, "getuid") else ""
    folder = Path(tempfile.gettempdir(), f"whsklearn-{user}")
    with contextlib.suppress(OSError):
        folder.mkdir(mode=0o700, exist_ok=True)
        found = folder.lstat()
        if stat.S_ISDIR(found.st_mode) and (user == "" or (found.st_uid == user and not found.st_mode & 0o022)):
            return folder
    raise FileNotFoundError(f"{folder} is not this user's own.")


@cache
def _writable(folder: Path) -> bool:
    """Whether files can be made in a folder, by making one, which is what Numba will do."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=folder).close()
    except OSError:
        return False
    return True
