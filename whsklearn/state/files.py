"""State files of streams: atomic, versioned, checked, and without pickle.

A state file is three lines of text and the arrays' bytes, so ``head -3 FILE`` shows what it is::

    whsklearn-state 2
    <SHA-256 of all that is not this line, in hex>
    {"kind": "RMILSRegressor", "parameters": {...}, "state": {...}, "arrays": [["<f8", [9]], ...]}
    <the arrays one after another, little-endian, C order>

Nothing is parsed before the checksum holds, and nothing in the file is ever executed.
The layout follows safetensors' idea: sizes are known from the header, so a forged one
can make the reader neither allocate nor loop beyond the file's own length.
"""

from __future__ import annotations

import hashlib
import json
import math
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from whsklearn.logs.files import atomic_write
from whsklearn.state.encoding import decode, encode

FORMAT_VERSION = 2
_MAGIC = b"whsklearn-state "
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
        Constructor parameters and learned state: numbers, strings, None, arrays of numbers,
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
        If the file is not a state file, was cut or edited, is of a newer format or another kind.
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
    """The kind of a state file, such as ``"RMILSRegressor"``; raises as `read_state` does.

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


def _header(data: bytes) -> tuple[dict[str, Any], bytes]:
    """The header, upgraded to the present format, and the arrays' bytes."""
    first, _, rest = data.partition(b"\n")
    number = first[len(_MAGIC) :]
    if not first.startswith(_MAGIC) or not number.isdigit() or len(number) > 9:
        raise ValueError("this is not a whsklearn state file; give one that save() or a checkpoint wrote.")
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
