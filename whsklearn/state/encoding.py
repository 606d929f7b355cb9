"""Parameters and states as JSON plus arrays, and back; the only types a saved state can hold.

Decoding builds values of a fixed list of types.  Classes are looked up among the
effects and estimators that are imported already, so a file can name one but never bring
code along.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sklearn.base import BaseEstimator

from whsklearn.effects.base import Effect
from whsklearn.effects.law import FrictionLaw
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
    if isinstance(value, tuple):
        return {TAG: "tuple", "items": encode(list(value), arrays, where)}
    if isinstance(value, dict):
        return _encode_dict(value, arrays, where)
    if isinstance(value, Effect):
        return {TAG: "effect", "class": _name(type(value)), "fields": encode(vars(value), arrays, where)}
    if isinstance(value, FrictionLaw):
        return {TAG: "law", "terms": encode(list(value.terms), arrays, where)}
    if isinstance(value, BaseEstimator) and not isinstance(value, type):
        params = value.get_params(deep=False)
        return {TAG: "estimator", "class": _name(type(value)), "params": encode(params, arrays, where)}
    if isinstance(value, Arm):
        fields = {f.name: getattr(value, f.name) for f in dataclasses.fields(value) if f.init}
        return {TAG: "arm", "fields": encode(fields, arrays, where)}
    if isinstance(value, np.random.Generator):
        return {TAG: "generator", "state": encode(value.bit_generator.state, arrays, where)}
    if isinstance(value, np.random.RandomState):
        return {TAG: "random_state", "state": encode(value.get_state(legacy=False), arrays, where)}
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
        return _DECODERS[coded[TAG]](coded, arrays)
    except (KeyError, IndexError, TypeError, AttributeError) as error:
        raise ValueError(f"a coded {str(coded[TAG])[:40]!r} cannot be read: {error}") from None


def _encode_array(value: NDArray[Any], arrays: list[NDArray[Any]], where: str) -> dict[str, Any]:
    """Put an array aside and refer to it."""
    if value.dtype.kind not in _ARRAY_KINDS:
        raise ValueError(f"{where} is an array of dtype {value.dtype}; a saved state holds numbers and text only.")
    # np.array, not ascontiguousarray: the latter turns a 0-d array into one of shape (1,)
    arrays.append(np.array(value, dtype=value.dtype.newbyteorder("<"), order="C"))
    return {TAG: "array", "index": len(arrays) - 1}


def _encode_dict(value: dict[Any, Any], arrays: list[NDArray[Any]], where: str) -> dict[str, Any]:
    """A dict with string keys, none of them the tag."""
    for key in value:
        if not isinstance(key, str) or key == TAG:
            raise ValueError(f"{where} has the key {key!r}; expected strings other than {TAG!r}.")
    return {key: encode(v, arrays, f"{where}.{key}") for key, v in value.items()}


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


def _generator(coded: dict[str, Any], arrays: list[NDArray[Any]]) -> np.random.Generator:
    """A generator that continues where the saved one stood."""
    state = decode(coded["state"], arrays)
    kinds = {k.__name__: k for k in (np.random.PCG64, np.random.PCG64DXSM, np.random.MT19937, np.random.Philox)}
    generator = np.random.Generator(kinds[state["bit_generator"]]())
    generator.bit_generator.state = state
    return generator


def _random_state(coded: dict[str, Any], arrays: list[NDArray[Any]]) -> np.random.RandomState:
    """A legacy random state that continues where the saved one stood."""
    generator = np.random.RandomState()
    generator.set_state(decode(coded["state"], arrays))
    return generator


def _array(coded: dict[str, Any], arrays: list[NDArray[Any]]) -> NDArray[Any]:
    """The array set aside under that index."""
    index = coded["index"]
    if not isinstance(index, int) or index < 0:
        raise IndexError(f"array index {index!r}")
    return arrays[index]


_DECODERS: dict[str, Callable[[dict[str, Any], list[NDArray[Any]]], Any]] = {
    "array": _array,
    "tuple": lambda c, a: tuple(decode(c["items"], a)),
    "effect": lambda c, a: _find(Effect, c["class"])(**decode(c["fields"], a)),
    "law": lambda c, a: FrictionLaw(decode(c["terms"], a)),
    "estimator": lambda c, a: _find(BaseEstimator, c["class"])(**decode(c["params"], a)),
    "arm": lambda c, a: Arm(**decode(c["fields"], a)),
    "generator": _generator,
    "random_state": _random_state,
}
