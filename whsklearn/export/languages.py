"""How a language writes numbers, operators and functions: C99 and IEC 61131-3 Structured Text.

Statements that `whsklearn.export.specialise.Specialiser` writes are kept as values until it is known which are needed.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple


class Symbol(NamedTuple):
    """An expression whose value is known only at run time; ``kind`` is ``real`` or ``bool``.

    A product with a constant keeps the ``factor`` and the other operand, so that further constant factors are merged.

    >>> from whsklearn.export.specialise import Specialiser
    >>> work = Specialiser(C())
    >>> work.binary("Mult", work.binary("Mult", Symbol("x"), 2.0), 3.0).text
    '(6.0 * x)'
    """

    text: str
    kind: str = "real"
    factor: float = 1.0
    base: str = ""


class Set(NamedTuple):
    """An assignment; ``kept`` if the name belongs to the state and is kept between samples.

    >>> sorted(used([Set("x", "a * u + x", kept=True)]))
    ['a', 'u', 'x']
    """

    name: str
    text: str
    kept: bool = False


class If(NamedTuple):
    """Two ways.

    >>> for line in rendered([If("u < 0.0", [Set("y", "0.0")], [Set("y", "u")])], C(), ""):
    ...     print(line)
    if (u < 0.0) {
        y = 0.0;
    } else {
        y = u;
    }
    """

    test: str
    yes: list[Any]
    no: list[Any]


@dataclass(frozen=True)
class StateArray:
    """An array of the generated code's state: element (i, j) is called ``name(i, j)``, empty if it is never read.

    Examples
    --------
    >>> StateArray(lambda i, j=0: f"s->x[{i}]").name(2)
    's->x[2]'
    """

    name: Callable[..., str]


@dataclass(frozen=True)
class OneOf:
    """User-defined effects, called with the index of the function first, as in compiled kernels.

    Examples
    --------
    >>> OneOf((abs, float)).functions[1](2)
    2.0
    """

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


_OPERATORS = {"Add": "+", "Sub": "-", "Mult": "*", "Div": "/", "Lt": "<", "LtE": "<=", "Gt": ">", "GtE": ">="}


class Language:
    """What `whsklearn.export.specialise.Specialiser` needs from a language.

    Examples
    --------
    >>> [language.truth(True) for language in (C(), StructuredText())]
    ['1', 'TRUE']
    """

    operators: ClassVar[dict[str, str]]  # by the name of the syntax node: ``Add``, ``LtE``, ``And``, ...
    twice: ClassVar[frozenset[str]]  # functions whose arguments are written more than once and therefore need a name
    _state: ClassVar[str] = ""  # before a number that is kept between samples
    _truths: ClassVar[tuple[str, str]]  # false, true
    _negated: ClassVar[str]
    _assigned: ClassVar[str]
    _branches: ClassVar[tuple[str, str, str, str]]  # if, if not, else, end

    def number(self, value: float) -> str:
        """The shortest literal that reads back as the same number."""
        raise NotImplementedError

    def function(self, name: str, arguments: list[str]) -> str:
        """A call; ``name`` as in `math`, or one of ``abs min max int``."""
        raise NotImplementedError

    def state(self, field: str, index: int = -1) -> str:
        """A number that is kept between samples: a field of its own, or an entry of one."""
        return f"{self._state}{field}" if index < 0 else f"{self._state}{field}[{index}]"

    def truth(self, value: bool) -> str:
        """True or false."""
        return self._truths[value]

    def negated(self, text: str) -> str:
        """Logical not."""
        return self._negated.format(text)

    def assign(self, name: str, text: str) -> str:
        """One assignment."""
        return self._assigned.format(name, text.removeprefix("(").removesuffix(")") if _wrapped(text) else text)

    def branch(self, test: str, yes: list[str], no: list[str], pad: str) -> list[str]:
        """An if statement with its else, without empty branches."""
        if_, unless, otherwise, end = self._branches
        if not yes:
            return [pad + unless.format(test), *no, pad + end]
        return [pad + if_.format(test), *yes, *([pad + otherwise, *no] if no else []), pad + end]


@dataclass(frozen=True)
class C(Language):
    """C99; ``real`` is ``double`` or ``float``.

    >>> C("float").function("sin", ["q"]), C().number(-0.5)
    ('sinf(q)', '(-0.5)')
    """

    real: str = "double"
    operators: ClassVar = {**_OPERATORS, "Eq": "==", "NotEq": "!=", "And": "&&", "Or": "||"}
    twice: ClassVar = frozenset({"min", "max"})
    _state: ClassVar = "s->"
    _truths: ClassVar = ("0", "1")
    _negated: ClassVar = "(!{})"
    _assigned: ClassVar = "{} = {};"
    _branches: ClassVar = ("if {} {{", "if (!{}) {{", "} else {", "}")

    def number(self, value: float) -> str:
        """The literal, in brackets if it is negative."""
        if math.isinf(value):
            return "INFINITY" if value > 0 else "(-INFINITY)"
        text = repr(float(value)) + ("f" if self.real == "float" else "")
        return f"({text})" if value < 0 else text

    def branch(self, test: str, yes: list[str], no: list[str], pad: str) -> list[str]:
        """See `Language`; the test in brackets."""
        return super().branch(test if _wrapped(test) else f"({test})", yes, no, pad)

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


class StructuredText(Language):
    """IEC 61131-3 Structured Text with LREAL numbers.

    >>> StructuredText().function("sin", ["q"]), StructuredText().number(1e-9)
    ('SIN(q)', '1.0E-9')
    """

    operators: ClassVar = {**_OPERATORS, "Eq": "=", "NotEq": "<>", "And": "AND", "Or": "OR"}
    twice: ClassVar = frozenset({"copysign", "floor"})
    _truths: ClassVar = ("FALSE", "TRUE")
    _negated: ClassVar = "(NOT {})"
    _assigned: ClassVar = "{} := {};"
    _branches: ClassVar = ("IF {} THEN", "IF NOT {} THEN", "ELSE", "END_IF;")

    def number(self, value: float) -> str:
        """See `Language`; IEC 61131-3 has no infinity."""
        if math.isinf(value):
            return "1.0E308" if value > 0 else "(-1.0E308)"
        mantissa, _, exponent = repr(float(value)).partition("e")
        mantissa += "" if "." in mantissa else ".0"
        text = mantissa + (f"E{int(exponent)}" if exponent else "")
        return f"({text})" if value < 0 else text

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
