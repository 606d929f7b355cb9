"""Statements that `whsklearn.export.specialise.Specialiser` writes, kept as values until it is known which are
needed.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

from whsklearn.export.languages import Language


class Symbol(NamedTuple):
    """An expression whose value is known only at run time; ``kind`` is ``real`` or ``bool``.

    A product with a constant keeps the ``factor`` and the other operand, so that further constant factors are merged.
    """

    text: str
    kind: str = "real"
    factor: float = 1.0
    base: str = ""


class Set(NamedTuple):
    """An assignment; ``kept`` if the name belongs to the state and is kept between samples.

    Examples
    --------
    >>> sorted(used([Set("x", "a * u + x", kept=True)]))
    ['a', 'u', 'x']
    """

    name: str
    text: str
    kept: bool = False


class If(NamedTuple):
    """Two ways."""

    test: str
    yes: list[Any]
    no: list[Any]


@dataclass(frozen=True)
class StateArray:
    """An array of the generated code's state: element (i, j) is called ``name(i, j)``, which is empty if it is never
    read.
    """

    name: Callable[..., str]


@dataclass(frozen=True)
class OneOf:
    """User-defined effects, called with the index of the function first, as in compiled kernels."""

    functions: tuple[Callable[..., float], ...]


def identifiers(text: str) -> set[str]:
    """Every name in an expression."""
    return set(re.findall(r"[A-Za-z_]\w*", text))


def used(statements: list[Any]) -> set[str]:
    """Every name that is read by some expression."""
    out: set[str] = set()
    for s in statements:
        if isinstance(s, Set):
            out |= identifiers(s.text)
        else:
            out |= identifiers(s.test) | used(s.yes) | used(s.no)
    return out


def _pruned(statements: list[Any], used: set[str]) -> list[Any]:
    """Remove assignments that are never read, and empty ifs."""
    out: list[Any] = []
    for s in statements:
        if isinstance(s, Set):
            if s.kept or s.name in used:
                out.append(s)
        else:
            yes, no = _pruned(s.yes, used), _pruned(s.no, used)
            if yes or no:
                out.append(If(s.test, yes, no))
    return out


def needed_only(statements: list[Any], needed: set[str]) -> list[Any]:
    """The statements without what neither the state nor ``needed`` depends on."""
    while True:
        fewer = _pruned(statements, needed | used(statements))
        if fewer == statements:
            return statements
        statements = fewer


def rendered(statements: list[Any], language: Language, pad: str = "") -> list[str]:
    """Lines of code."""
    out: list[str] = []
    for s in statements:
        if isinstance(s, Set):
            out.append(pad + language.assign(s.name, s.text))
        else:
            yes, no = (rendered(side, language, pad + "    ") for side in (s.yes, s.no))
            out.extend(language.branch(s.test, yes, no, pad))
    return out
