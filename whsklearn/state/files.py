"""What a stream carries, on disk: atomic, versioned, checked, and without pickle.

A state file is three lines of text and the arrays' bytes, so ``head -3 FILE`` tells what it is::

    whsklearn-state 2
    <SHA-256 of all that is not this line, in hex>
    {"kind": "RMILSRegressor", "parameters": {...}, "state": {...}, "arrays": [["<f8", [9]], ...]}
    <the arrays one after another, little-endian, C order>

Nothing is parsed before the checksum holds, and nothing in the file is ever executed.
The layout follows safetensors' idea: sizes are known from the header, so a forged one
can make the reader neither allocate nor loop beyond the file's own length.

Files are replaced in one step (written beside, flushed to the disk, renamed): whoever is killed, and when,
there is the old file or the new one.
"""

from __future__ import annotations

import contextlib
import glob
import hashlib
import json
import math
import os
import stat
import threading
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from whsklearn.state.encoding import decode, encode

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

__all__ = [
    "FORMAT_VERSION",
    "atomic_write",
    "check_writable",
    "pack_state",
    "read_kind",
    "read_state",
    "unpack_state",
    "write_state",
]

FORMAT_VERSION = 2
_MAGIC = b"whsklearn-state "
_STALE_SECONDS = 600.0
# A header holds names and numbers that are no arrays: that of a stream takes 10 kB.  JSON takes some 60 bytes of
# memory for three of text, so this bounds what a forged one can ask for to some 60 MB, read in a tenth of a second.
_LONGEST_HEADER = 1 << 20


def write_state(path: str | os.PathLike[str], kind: str, params: dict[str, Any], state: dict[str, Any]) -> None:
    """Write a state file, replacing the one of that name in a single step.

    Parameters
    ----------
    path : str or path
        The file; its folder must exist.
    kind : str
        What the state is of, such as the estimator's class name; `read_state` asks for it.
    params, state : dict
        Constructor parameters and learnt state: numbers, strings, None, arrays of numbers,
        lists, tuples, dicts with string keys, effects, friction laws, estimators (by their
        parameters) and NumPy random generators, nested at will.

    Raises
    ------
    ValueError
        If a value is of another type; nothing is written then.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> import numpy as np
    >>> from whsklearn.state.files import read_state, write_state
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = pathlib.Path(folder, "axis.whs")
    ...     write_state(path, "demo", {"p": 4}, {"theta": np.array([0.5, 2.0])})
    ...     read_state(path, "demo")
    ({'p': 4}, {'theta': array([0.5, 2. ])})
    """
    atomic_write(path, pack_state(kind, params, state))


def read_state(path: str | os.PathLike[str], kind: str | None = None) -> tuple[dict[str, Any], dict[str, Any]]:
    """Read a state file: its parameters and its state.

    Parameters
    ----------
    path : str or path
        A file that `write_state` wrote, of this or an older format.
    kind : str, optional
        Refuse the file if it is not of this kind.

    Raises
    ------
    ValueError
        If the file is no state file, was cut or edited, is of a newer format or another kind.
    OSError
        If it cannot be opened.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> from whsklearn.state import read_state, write_state
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = pathlib.Path(folder, "axis.whs")
    ...     write_state(path, "Mine", {"p": 4}, {})
    ...     read_state(path, kind="Mine")[0]
    {'p': 4}
    """
    try:
        return unpack_state(Path(path).read_bytes(), kind)
    except ValueError as error:
        raise ValueError(f"{os.fspath(path)}: {error}") from None


def read_kind(path: str | os.PathLike[str]) -> str:
    """What a state file is of, such as ``"RMILSRegressor"``; raises as `read_state` does.

    Parameters
    ----------
    path : str or path

    Examples
    --------
    >>> import pathlib, tempfile
    >>> from whsklearn.state import read_kind, write_state
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = pathlib.Path(folder, "axis.whs")
    ...     write_state(path, "Mine", {"p": 4}, {})
    ...     read_kind(path)
    'Mine'
    """
    try:
        return str(_header(Path(path).read_bytes())[0]["kind"])
    except ValueError as error:
        raise ValueError(f"{os.fspath(path)}: {error}") from None


def pack_state(kind: str, params: dict[str, Any], state: dict[str, Any]) -> bytes:
    """The bytes of a state file, for those who keep states elsewhere than in files.

    Parameters
    ----------
    kind : str
        What it is of, such as ``"RMILSRegressor"``.
    params, state : dict
        As `get_params` and `get_state` give them.

    Examples
    --------
    >>> import numpy as np
    >>> from whsklearn.state import pack_state, unpack_state
    >>> params, state = unpack_state(pack_state("Mine", {"p": 4}, {"theta": np.ones(2)}), kind="Mine")
    >>> params["p"], state["theta"].tolist()
    (4, [1.0, 1.0])
    """
    arrays: list[NDArray[Any]] = []
    header = {
        "kind": kind,
        "parameters": encode(params, arrays, "parameters"),
        "state": encode(state, arrays, "state"),
        "arrays": [[a.dtype.str, list(a.shape)] for a in arrays],
    }
    first = _MAGIC + b"%d\n" % FORMAT_VERSION
    line = json.dumps(header).encode()
    if len(line) > _LONGEST_HEADER:
        raise ValueError(
            f"parameters and state take {len(line)} bytes of text, expected at most {_LONGEST_HEADER}; "
            "put long lists of numbers into arrays."
        )
    rest = line + b"\n" + b"".join(a.tobytes() for a in arrays)
    return first + hashlib.sha256(first + rest).hexdigest().encode() + b"\n" + rest


def unpack_state(data: bytes, kind: str | None = None) -> tuple[dict[str, Any], dict[str, Any]]:
    """The parameters and state that `pack_state` was given; raises as `read_state` does.

    Parameters
    ----------
    data : bytes
    kind : str, optional
        What it must be of.

    Examples
    --------
    >>> from whsklearn.state import pack_state, unpack_state
    >>> try:
    ...     unpack_state(pack_state("Mine", {}, {})[:-1] + b"?")
    ... except ValueError as error:
    ...     print("refused")
    refused
    """
    header, buffer = _header(data)
    if kind is not None and header["kind"] != kind:
        raise ValueError(f"this is the state of a {header['kind']}, expected one of a {kind}; load it with that class.")
    arrays = _arrays(header["arrays"], buffer)
    try:
        params, state = decode(header["parameters"], arrays), decode(header["state"], arrays)
    except (RecursionError, OverflowError, MemoryError):
        raise ValueError("this state file holds what no state has; go back to an earlier one.") from None
    if not isinstance(params, dict) or not isinstance(state, dict):
        raise ValueError("this state file holds no parameters or no state; go back to an earlier one.")
    return params, state


def atomic_write(path: str | os.PathLike[str], data: bytes) -> None:
    """Put ``data`` at ``path`` so that a crash at any instant leaves the old file or the new one.

    The bytes go to a hidden file in the same folder, are forced to the disk, and take the
    name in one `os.replace`; then the folder is forced to the disk too.  A file that is replaced
    keeps its mode, a symbolic link goes on pointing to the file that is replaced, and of several threads or
    processes that write at once the last one stands.

    Parameters
    ----------
    path : str or path
    data : bytes

    Raises
    ------
    OSError
        If the folder or the disk does not take it; it names ``path``, which is as it was.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> from whsklearn.state import atomic_write
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = pathlib.Path(folder, "note.txt")
    ...     atomic_write(path, b"old")
    ...     atomic_write(path, b"new")
    ...     path.read_bytes()
    b'new'
    """
    target = Path(os.path.realpath(path))
    # every writer has a file of its own; a long name is cut, as names have at most 255 bytes
    aside = target.with_name(f".{target.name[:150]}.{os.getpid()}.{threading.get_ident()}.tmp")
    try:
        with open(aside, "wb") as file:
            if hasattr(os, "fchmod") and target.exists():
                os.fchmod(file.fileno(), stat.S_IMODE(target.stat().st_mode))
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        os.replace(aside, target)
    except OSError as error:
        _remove(aside)
        raise type(error)(error.errno, error.strerror or str(error), os.fspath(path)) from None
    except BaseException:
        _remove(aside)
        raise
    _sync_folder(target.parent)
    _sweep(target)


def check_writable(path: str | os.PathLike[str]) -> None:
    """Raise now if `atomic_write` could not put a file at ``path`` later, before hours of work are spent on it.

    Parameters
    ----------
    path : str or path
        Of a file that there need not be.

    Raises
    ------
    ValueError
        If ``path`` is a folder, its folder is missing, or nothing can be written there.

    Examples
    --------
    >>> import tempfile
    >>> from whsklearn.state import check_writable
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     check_writable(f"{folder}/axis.whs")  # says nothing: it can be written
    """
    target = Path(os.path.realpath(path))
    if target.is_dir():
        raise ValueError(f"{path} is a folder, expected the name of a file; add one.")
    if not target.parent.is_dir():
        raise ValueError(f"The folder of {path} does not exist; make it, or write somewhere else.")
    aside = target.with_name(f".{target.name[:150]}.{os.getpid()}.{threading.get_ident()}.tmp")
    try:
        with open(aside, "wb") as file:
            file.write(b"\0")
    except OSError as error:
        raise ValueError(f"{path} cannot be written ({error.strerror}); write somewhere else.") from None
    finally:
        _remove(aside)


def _remove(file: Path) -> None:
    """Remove a file that may be gone, in a folder that may be."""
    with contextlib.suppress(OSError):
        file.unlink()


def _sync_folder(folder: Path) -> None:
    """Make the rename itself durable, where the system can."""
    with contextlib.suppress(OSError):  # Windows cannot open a folder
        descriptor = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)


def _sweep(target: Path) -> None:
    """Remove what writers of this file that were killed left beside it, if it is old."""
    for left in target.parent.glob(f".{glob.escape(target.name[:150])}.*.tmp"):
        with contextlib.suppress(OSError):
            if time.time() - left.stat().st_mtime > _STALE_SECONDS:
                left.unlink()


def _header(data: bytes) -> tuple[dict[str, Any], bytes]:
    """The header, upgraded to the present format, and the arrays' bytes."""
    first, _, rest = data.partition(b"\n")
    number = first[len(_MAGIC) :]
    if not first.startswith(_MAGIC) or not number.isdigit() or len(number) > 9:
        raise ValueError("this is no whsklearn state file; give one that save() or a checkpoint wrote.")
    version = int(number)
    if version > FORMAT_VERSION:
        raise ValueError(
            f"this state file has format {version}, this whsklearn reads up to {FORMAT_VERSION}; upgrade whsklearn."
        )
    digest, _, rest = rest.partition(b"\n")
    if hashlib.sha256(first + b"\n" + rest).hexdigest().encode() != digest:
        raise ValueError("this state file is cut off or was changed, its checksum fails; go back to an earlier one.")
    try:
        line, _, buffer = rest.partition(b"\n")
        if len(line) > _LONGEST_HEADER:
            raise ValueError("too long")
        header = json.loads(line)
        for older in range(version, FORMAT_VERSION):
            header = _UPGRADES[older](header)
        if not isinstance(header["kind"], str) or not {"parameters", "state", "arrays"} <= header.keys():
            raise KeyError("kind")
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
        raise ValueError("this state file has a header that cannot be read; go back to an earlier one.") from None
    return header, buffer


def _arrays(described: Any, buffer: bytes) -> list[NDArray[Any]]:
    """Cut the buffer into the arrays that the header describes; every byte must be used."""
    arrays, start = [], 0
    try:
        for name, shape in described:
            dtype = np.dtype(name)
            if dtype.kind not in "biufcU" or dtype.itemsize == 0 or any(type(n) is not int or n < 0 for n in shape):
                raise ValueError(f"dtype {name!r}, shape {shape!r}")
            stop = start + math.prod(shape) * dtype.itemsize
            if stop > len(buffer):
                raise ValueError("too short")
            arrays.append(np.frombuffer(buffer[start:stop], dtype=dtype).reshape(shape).astype(dtype.newbyteorder("=")))
            start = stop
        if start != len(buffer):
            raise ValueError("too long")
    except (ValueError, TypeError, OverflowError, MemoryError):
        raise ValueError("this state file's arrays do not fit its header; go back to an earlier one.") from None
    return arrays


def _from_format_1(header: dict[str, Any]) -> dict[str, Any]:
    """Format 1 called the kind ``estimator`` and the parameters ``params``."""
    renamed = {"estimator": "kind", "params": "parameters"}
    return {renamed.get(key, key): value for key, value in header.items()}


_UPGRADES: dict[int, Callable[[dict[str, Any]], dict[str, Any]]] = {1: _from_format_1}
