"""State files of streams: atomic, versioned, checked, and without pickle.

A state file is three lines of text and the arrays' bytes, so ``head -3 FILE`` shows what it is::

    whsklearn-state 2
    <SHA-256 of all that is not this line, in hex>
    {"kind": "RMILSRegressor", "parameters": {...}, "state": {...}, "arrays": [["<f8", [9]], ...]}
    <the arrays one after another, little-endian, C order>

Nothing is parsed before the checksum holds, and nothing in the file is ever executed.
The layout follows safetensors' idea: sizes are known from the header, so a forged one
can make the reader neither allocate nor loop beyond the file's own length.

Decoding builds values of a fixed list of types, the only ones that a state can hold.  Classes are looked up among the
effects and estimators that are imported already, so a file can name one but never bring
code along.
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
import math
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sklearn.base import BaseEstimator

from whsklearn.effects.base import Effect
from whsklearn.effects.law import FrictionLaw
from whsklearn.logs.files import atomic_write
from whsklearn.systems.arm import Arm

TAG = "$"  # a dict with this key is a coded value, not a dict of the user's
_ARRAY_KINDS = "biufcU"


class NotImported(ValueError):
    """A file names a class that is not imported here."""


def encode(value: Any, arrays: list[NDArray[Any]], where: str = "value") -> Any:
    """A JSON-able form of ``value``; its arrays are appended to ``arrays``.

    Raises ValueError if a value is of a type that a saved state cannot hold, naming the place.
    """
    if isinstance(value, np.generic) and value.dtype.kind in "biufU":
        value = value.item()
    if value is None or isinstance(value, (bool, int, float, str)):
        return value
    if isinstance(value, np.ndarray):
        return _encode_array(value, arrays, where)
    if isinstance(value, list):
        return [encode(v, arrays, f"{where}[{i}]") for i, v in enumerate(value)]
    if isinstance(value, dict):
        for key in value:
            if not isinstance(key, str) or key == TAG:
                raise ValueError(f"{where} has the key {key!r}; expected strings other than {TAG!r}.")
        return {key: encode(v, arrays, f"{where}.{key}") for key, v in value.items()}
    for tag, (base, key, parts, made) in _CODED.items():
        if isinstance(value, base):
            named = {} if made else {"class": _name(type(value))}
            return {TAG: tag, **named, key: encode(parts(value), arrays, where)}
    raise ValueError(
        f"{where} is of type {type(value).__qualname__}, which a saved state cannot hold; "
        "use numbers, strings, arrays, lists, dicts, effects, laws or estimators."
    )


def decode(coded: Any, arrays: list[NDArray[Any]]) -> Any:
    """The value that `encode` was given.

    Raises ValueError if the coded form is none of `encode`'s, or names a class that is not imported.
    """
    if isinstance(coded, list):
        return [decode(v, arrays) for v in coded]
    if not isinstance(coded, dict):
        return coded
    if TAG not in coded:
        return {key: decode(v, arrays) for key, v in coded.items()}
    try:
        if coded[TAG] == "array":
            return _array(coded, arrays)
        base, key, _, made = _CODED[coded[TAG]]
        value = decode(coded[key], arrays)
        return made(value) if made else _find(base, coded["class"])(**value)
    except (KeyError, IndexError, TypeError, AttributeError) as error:
        raise ValueError(f"a coded {str(coded[TAG])[:40]!r} cannot be read: {error}") from None


def _encode_array(value: NDArray[Any], arrays: list[NDArray[Any]], where: str) -> dict[str, Any]:
    """Put an array aside and refer to it."""
    if value.dtype.kind not in _ARRAY_KINDS:
        raise ValueError(f"{where} is an array of dtype {value.dtype}; a saved state holds numbers and text only.")
    # np.array, not ascontiguousarray: the latter turns a 0-d array into one of shape (1,)
    arrays.append(np.array(value, dtype=value.dtype.newbyteorder("<"), order="C"))
    return {TAG: "array", "index": len(arrays) - 1}


def _name(cls: type) -> str:
    """Bare for the library's own classes, so that they may move between its files."""
    own = cls.__module__.split(".")[0] == "whsklearn"
    return cls.__qualname__ if own else f"{cls.__module__}.{cls.__qualname__}"


def _find(base: type, name: str) -> Callable[..., Any]:
    """The imported subclass of ``base`` that has that name."""
    todo, found = [base], None
    while todo:
        cls = todo.pop()
        todo.extend(cls.__subclasses__())
        if _name(cls) == name:
            found = cls
    if found is None:
        raise NotImported(f"No {base.__name__} called {str(name)[:80]!r} is imported here; import its module first.")
    return found


def _generator(state: dict[str, Any]) -> np.random.Generator:
    """A generator that continues where the saved one stood."""
    kinds = {k.__name__: k for k in (np.random.PCG64, np.random.PCG64DXSM, np.random.MT19937, np.random.Philox)}
    generator = np.random.Generator(kinds[state["bit_generator"]]())
    generator.bit_generator.state = state
    return generator


def _random_state(state: dict[str, Any]) -> np.random.RandomState:
    """A legacy random state that continues where the saved one stood."""
    generator = np.random.RandomState()
    generator.set_state(state)
    return generator


def _array(coded: dict[str, Any], arrays: list[NDArray[Any]]) -> NDArray[Any]:
    """The array set aside under that index."""
    index = coded["index"]
    if not isinstance(index, int) or index < 0:
        raise IndexError(f"array index {index!r}")
    return arrays[index]


def _fields(arm: Arm) -> dict[str, Any]:
    return {f.name: getattr(arm, f.name) for f in dataclasses.fields(arm) if f.init}


# By tag: the type, the key and the value of what an object is coded as, and what makes the object of that again; if
# None, the file names its class, which takes it as keywords.
_CODED: dict[str, tuple[type, str, Callable[[Any], Any], Callable[[Any], Any] | None]] = {
    "tuple": (tuple, "items", list, tuple),
    "effect": (Effect, "fields", vars, None),
    "law": (FrictionLaw, "terms", lambda law: list(law.terms), FrictionLaw),
    "estimator": (BaseEstimator, "params", lambda estimator: estimator.get_params(deep=False), None),
    "arm": (Arm, "fields", _fields, lambda fields: Arm(**fields)),
    "generator": (np.random.Generator, "state", lambda generator: generator.bit_generator.state, _generator),
    "random_state": (np.random.RandomState, "state", lambda state: state.get_state(legacy=False), _random_state),
}


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
    >>> from whsklearn.state import read_state, write_state
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


def is_state(path: str | os.PathLike[str]) -> bool:
    """Whether the file of a ``path`` begins as a state file does, even if it is cut off or of another format.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> from whsklearn.state import is_state, write_state
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = pathlib.Path(folder, "axis.whs")
    ...     write_state(path, "Mine", {"p": 4}, {})
    ...     path.write_bytes(path.read_bytes()[:40])
    ...     is_state(path)
    40
    True
    """
    with Path(path).open("rb") as file:
        return file.read(len(_MAGIC)) == _MAGIC


def pack_state(kind: str, params: dict[str, Any], state: dict[str, Any]) -> bytes:
    """The bytes that `write_state` writes."""
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
    """The header, and the arrays' bytes."""
    first, _, rest = data.partition(b"\n")
    number = first[len(_MAGIC) :]
    if not first.startswith(_MAGIC) or not number.isdigit() or len(number) > 9:
        raise ValueError("this is not a whsklearn state file; give one that save() or a checkpoint wrote.")
    if int(number) != FORMAT_VERSION:
        raise ValueError(
            f"this state file has format {int(number)}, and this whsklearn reads {FORMAT_VERSION}; upgrade whsklearn, "
            "or start over."
        )
    digest, _, rest = rest.partition(b"\n")
    if hashlib.sha256(first + b"\n" + rest).hexdigest().encode() != digest:
        raise ValueError("this state file is cut off or was changed, its checksum fails; go back to an earlier one.")
    try:
        line, _, buffer = rest.partition(b"\n")
        if len(line) > _LONGEST_HEADER:
            raise ValueError("too long")
        header = json.loads(line)
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
            if dtype.kind not in _ARRAY_KINDS or dtype.itemsize == 0 or any(type(n) is not int or n < 0 for n in shape):
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
