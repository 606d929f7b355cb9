"""How a language writes numbers, operators and functions: C99 and IEC 61131-3 Structured Text.

Statements that `whsklearn.export.specialise.Specialiser` writes are kept as values until it is known which are needed.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, NamedTuple, Protocol


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


# --- how a language writes numbers, operators and functions: C99 and IEC 61131-3 Structured Text ---------------------
class Language(Protocol):
    """The interface that `whsklearn.export.specialise.Specialiser` needs from a language."""

    @property
    def operators(self) -> dict[str, str]:
        """Operators by the name of the syntax node: ``Add``, ``LtE``, ``And``, ..."""
        ...

    @property
    def twice(self) -> frozenset[str]:
        """Functions whose arguments are written more than once and therefore need a name."""
        ...

    def number(self, value: float) -> str:
        """A literal."""
        ...

    def truth(self, value: bool) -> str:
        """True or false."""
        ...

    def negated(self, text: str) -> str:
        """Logical not."""
        ...

    def assign(self, name: str, text: str) -> str:
        """One assignment."""
        ...

    def branch(self, test: str, yes: list[str], no: list[str], pad: str) -> list[str]:
        """An if with its else."""
        ...

    def function(self, name: str, arguments: list[str]) -> str:
        """A call; ``name`` as in `math`, or one of ``abs min max int``."""
        ...


_ARITHMETIC = {"Add": "+", "Sub": "-", "Mult": "*", "Div": "/", "Lt": "<", "LtE": "<=", "Gt": ">", "GtE": ">="}


@dataclass(frozen=True)
class C:
    """C99; ``real`` is ``double`` or ``float``."""

    real: str = "double"
    operators: dict[str, str] = field(
        default_factory=lambda: {**_ARITHMETIC, "Eq": "==", "NotEq": "!=", "And": "&&", "Or": "||"}
    )
    twice: frozenset[str] = frozenset({"min", "max"})

    def number(self, value: float) -> str:
        """The shortest text that reads back as the same number."""
        if math.isinf(value):
            return "INFINITY" if value > 0 else "(-INFINITY)"
        text = repr(float(value)) + ("f" if self.real == "float" else "")
        return f"({text})" if value < 0 else text

    def truth(self, value: bool) -> str:
        """1 or 0."""
        return str(int(value))

    def negated(self, text: str) -> str:
        """Logical not."""
        return f"(!{text})"

    def assign(self, name: str, text: str) -> str:
        """One assignment."""
        return f"{name} = {text.removeprefix('(').removesuffix(')') if _wrapped(text) else text};"

    def branch(self, test: str, yes: list[str], no: list[str], pad: str) -> list[str]:
        """An if statement with its else, without empty branches."""
        test = test if _wrapped(test) else f"({test})"
        if not yes:
            return [f"{pad}if (!{test}) {{", *no, f"{pad}}}"]
        return [f"{pad}if {test} {{", *yes, *([f"{pad}}} else {{", *no] if no else []), f"{pad}}}"]

    def function(self, name: str, arguments: list[str]) -> str:
        """A call of math.h; ``min`` and ``max`` are choices, which compile to one instruction."""
        if name in ("min", "max"):
            a, *more = arguments
            if not more:
                return a
            b, sign = self.function(name, more), ">" if name == "max" else "<"
            return f"({b} {sign} {a} ? {b} : {a})"  # of equal ones the first, as in Python
        name = {"abs": "fabs", "int": "trunc"}.get(name, name)
        return f"{name}{'f' if self.real == 'float' else ''}({', '.join(arguments)})"


@dataclass(frozen=True)
class StructuredText:
    """IEC 61131-3 Structured Text with LREAL numbers."""

    operators: dict[str, str] = field(
        default_factory=lambda: {**_ARITHMETIC, "Eq": "=", "NotEq": "<>", "And": "AND", "Or": "OR"}
    )
    twice: frozenset[str] = frozenset({"copysign", "floor"})

    def number(self, value: float) -> str:
        """A real literal; IEC 61131-3 has no infinity."""
        if math.isinf(value):
            return "1.0E308" if value > 0 else "(-1.0E308)"
        mantissa, _, exponent = repr(float(value)).partition("e")
        mantissa += "" if "." in mantissa else ".0"
        text = mantissa + (f"E{int(exponent)}" if exponent else "")
        return f"({text})" if value < 0 else text

    def truth(self, value: bool) -> str:
        """TRUE or FALSE."""
        return "TRUE" if value else "FALSE"

    def negated(self, text: str) -> str:
        """Logical not."""
        return f"(NOT {text})"

    def assign(self, name: str, text: str) -> str:
        """One assignment."""
        return f"{name} := {text.removeprefix('(').removesuffix(')') if _wrapped(text) else text};"

    def branch(self, test: str, yes: list[str], no: list[str], pad: str) -> list[str]:
        """An IF statement with its ELSE, without empty branches."""
        if not yes:
            return [f"{pad}IF NOT {test} THEN", *no, f"{pad}END_IF;"]
        return [f"{pad}IF {test} THEN", *yes, *([f"{pad}ELSE", *no] if no else []), f"{pad}END_IF;"]

    def function(self, name: str, arguments: list[str]) -> str:
        """A standard function, or an expression of standard functions if there is none."""
        a = arguments[0]
        if name == "tanh":
            return f"(1.0 - 2.0 / (EXP(2.0 * {a}) + 1.0))"
        if name == "copysign":
            return f"SEL({arguments[1]} < 0.0, ABS({a}), -ABS({a}))"
        if name == "floor":
            return f"(LINT_TO_LREAL(TRUNC_LINT({a})) - SEL({a} < LINT_TO_LREAL(TRUNC_LINT({a})), 0.0, 1.0))"
        if name == "int":
            return f"LINT_TO_LREAL(TRUNC_LINT({a}))"
        name = {"log": "LN", "pow": "EXPT"}.get(name, name.upper())
        return f"{name}({', '.join(arguments)})"


def _wrapped(text: str) -> bool:
    """Whether one pair of brackets encloses the whole text."""
    if not (text.startswith("(") and text.endswith(")")):
        return False
    depth = 0
    for k, c in enumerate(text):
        depth += (c == "(") - (c == ")")
        if depth == 0 and k < len(text) - 1:
            return False
    return True
