"""Compiled equations as straight-line code of another language, with everything that is known in advance evaluated.

The effects' equations and the integrator exist once, as Python functions that Numba compiles.  An exported model must
not duplicate them, so it is generated from the same functions: `Specialiser` walks their syntax trees with the model's
numbers bound (online partial evaluation; Jones, Gomard, Sestoft 1993, Partial Evaluation and Automatic Program
Generation, ch. 4), folds constants, unrolls loops over effects, inlines calls, and writes the remaining operations in a
`whsklearn.export.languages.Language`.

Every name that is assigned becomes a new variable (static single assignment), and the values of both branches of an
``if`` are merged. Supported: numbers, tuples, arrays with known indices, ``if``, ``for`` over a known range, ``math``
and ``abs min max int float``.
"""

from __future__ import annotations

import ast
import inspect
import math
import operator
import textwrap
from collections import ChainMap
from collections.abc import Callable
from typing import Any

import numpy as np

from whsklearn.effects.equations import tanh
from whsklearn.export.languages import (
    If,
    Language,
    OneOf,
    Set,
    StateArray,
    Symbol,
    identifiers,
    needed_only,
    rendered,
    used,
)


class Specialiser:
    """Writes functions as ``statements`` (`Set` and `If`) of a language.

    ``wave(name, i, argument)`` writes a sine or cosine of the motion from the previous one in slot i of the state;
    without it, each is a function call.

    >>> from whsklearn.export.languages import C
    >>> work = Specialiser(C())
    >>> work.text(work.binary("Add", Symbol("x"), 0.5))
    '(x + 0.5)'
    """

    def __init__(self, language: Language, prefix: str = "", wave: Callable[[str, int, str], str] | None = None):
        self.language = language
        self.prefix = prefix  # of every variable
        self.wave = wave
        self.waves: dict[str, int] = {}  # slots of the arguments whose sine or cosine is stored
        self.meaning: dict[str, tuple[str, set[str]]] = {}  # per variable: expression, and all that it depends on
        self.statements: list[Any] = []
        self.variables: dict[str, str] = {}  # kinds of those in use
        self.globals: dict[str, Any] = {}

    # -- values -----------------------------------------------------------------------

    def text(self, value: Any) -> str:
        """A value as an expression of the language."""
        if isinstance(value, Symbol):
            return value.text
        if isinstance(value, bool | np.bool_):
            return self.language.truth(bool(value))
        return self.language.number(float(value))

    def variable(self, hint: str, kind: str) -> str:
        """A new variable."""
        n = len(self.variables)
        name = f"{self.prefix}{hint.strip('_') or 'x'}_{n}"
        self.variables[name] = kind
        return name

    def store(self, name: str, value: Any) -> None:
        """Write a value into the state."""
        self.statements.append(Set(name, self.text(value), kept=True))

    def finish(self, *results: Any) -> tuple[list[str], dict[str, str]]:
        """(lines of code, kind of each variable in them), without what neither the state nor the results need."""
        needed = set().union(*(identifiers(self.text(r)) for r in results))
        statements = needed_only(self.statements, needed)
        alive = needed | used(statements)
        return rendered(statements, self.language), {v: k for v, k in self.variables.items() if v in alive}

    def bind(self, hint: str, value: Any) -> Any:
        """Assign the value to a new variable, so that its expression is computed once."""
        if isinstance(value, tuple) and not isinstance(value, Symbol):
            parts = [self.bind(hint, v) for v in value]
            return type(value)(*parts) if hasattr(value, "_fields") else tuple(parts)
        if not isinstance(value, Symbol) or value.text.isidentifier():
            return value
        name = self.variable(hint, value.kind)
        self.statements.append(Set(name, value.text))
        self.meaning[name] = (value.text, self._sources(value.text))
        return Symbol(name, value.kind)

    def _sources(self, text: str) -> set[str]:
        """Every name that an expression depends on, also through variables."""
        names = identifiers(text)
        return names.union(*(self.meaning[n][1] for n in names if n in self.meaning))

    # -- functions --------------------------------------------------------------------

    def call(self, function: Any, *arguments: Any) -> Any:
        """Inline a function of plain Python or Numba, and return its value or tuple of values."""
        if isinstance(function, OneOf):
            function, arguments = function.functions[int(arguments[0])], arguments[1:]
        function = getattr(function, "py_func", function)
        tree = ast.parse(textwrap.dedent(inspect.getsource(function))).body[0]
        if not isinstance(tree, ast.FunctionDef):
            raise ValueError(f"{function!r} cannot be exported; define it with def.")
        names = [a.arg for a in tree.args.args]
        if len(names) != len(arguments):
            raise ValueError(f"{function.__name__} takes {len(names)} arguments, got {len(arguments)}.")
        outer = self.globals
        cells = [c.cell_contents for c in function.__closure__ or ()]
        self.globals = {**function.__globals__, **dict(zip(function.__code__.co_freevars, cells, strict=True))}
        env = {n: self.bind(n, a) for n, a in zip(names, arguments, strict=True)}
        try:
            _, result = self._block(tree.body, env)
        finally:
            self.globals = outer
        return result

    # -- statements -------------------------------------------------------------------

    def _block(self, body: list[ast.stmt], env: dict[str, Any]) -> tuple[bool, Any]:
        """Write statements; return whether they returned, and their value."""
        for k, s in enumerate(body):
            rest = body[k + 1 :]
            if isinstance(s, ast.Return):
                return True, None if s.value is None else self._value(s.value, env)
            if isinstance(s, ast.If):
                test = self._value(s.test, env)
                if not isinstance(test, Symbol):
                    return self._block([*(s.body if test else s.orelse), *rest], env)
                if _returns(s):
                    result = self._branch(test, [*s.body, *rest], [*s.orelse, *rest], env)
                    return True, result
                self._branch(test, s.body, s.orelse, env)
            elif isinstance(s, ast.For):
                return self._block([*self._unrolled(s, env), *rest], env)
            elif isinstance(s, ast.Assign):
                value = self._value(s.value, env)
                for target in s.targets:
                    self._assign(target, value, env)
            elif isinstance(s, ast.AugAssign):
                load = ast.copy_location(ast.parse(ast.unparse(s.target), mode="eval").body, s)
                self._assign(s.target, self._value(ast.BinOp(load, s.op, s.value), env), env)
            elif isinstance(s, ast.Expr):
                if not isinstance(s.value, ast.Constant):  # such as a docstring
                    self._value(s.value, env)
            elif not isinstance(s, ast.Pass):
                raise ValueError(f"Line {ast.unparse(s)!r} cannot be exported; write it with if, for and assignments.")
        return False, None

    def _unrolled(self, s: ast.For, env: dict[str, Any]) -> list[ast.stmt]:
        """Unroll a loop."""
        call = s.iter
        if not (isinstance(call, ast.Call) and isinstance(call.func, ast.Name) and call.func.id == "range"):
            raise ValueError(f"The loop over {ast.unparse(s.iter)!r} cannot be exported; loop over a range.")
        limits = [self._value(a, env) for a in call.args]
        if any(isinstance(v, Symbol) for v in limits):
            raise ValueError(f"The loop over {ast.unparse(s.iter)!r} cannot be exported; its length must be known.")
        out: list[ast.stmt] = []
        for i in range(*map(int, limits)):
            out.append(ast.copy_location(ast.Assign([s.target], ast.Constant(i)), s))
            out.extend(s.body)
        return out

    def _branch(self, test: Symbol, body: list[ast.stmt], orelse: list[ast.stmt], env: dict[str, Any]) -> Any:
        """Write both branches of an if, merge names and results, and return the result."""
        outside = self.statements
        sides = []
        for statements in (body, orelse):
            self.statements, inner = [], dict(env)
            _, result = self._block(statements, inner)
            sides.append((self.statements, inner, result))
        (yes, env1, r1), (no, env2, r2) = sides
        for name in sorted(env1.keys() & env2.keys()):
            env[name] = self._merge(name, env1[name], env2[name], yes, no)
        result = self._merge("r", r1, r2, yes, no)
        self.statements = outside
        if yes or no:
            self.statements.append(If(test.text, yes, no))
        return result

    def _merge(self, hint: str, a: Any, b: Any, yes: list[Any], no: list[Any]) -> Any:
        """Merge the values of both branches."""
        if a is b or (isinstance(a, Symbol) and isinstance(b, Symbol) and a.text == b.text):
            return a
        if isinstance(a, tuple) and not isinstance(a, Symbol) and isinstance(b, tuple) and len(a) == len(b):
            return tuple(self._merge(hint, x, y, yes, no) for x, y in zip(a, b, strict=True))
        if isinstance(a, int | float | np.floating) and not isinstance(a, bool) and type(a) is type(b) and a == b:
            return a
        if not all(isinstance(v, Symbol | int | float | np.number | bool | np.bool_) for v in (a, b)):
            return None  # used on one side only
        known = [v.kind for v in (a, b) if isinstance(v, Symbol)]
        kind = known[0] if known else "bool" if isinstance(a, bool | np.bool_) else "real"
        name = self.variable(hint, kind)
        yes.append(Set(name, self.text(a)))
        no.append(Set(name, self.text(b)))
        return Symbol(name, kind)

    def _assign(self, target: ast.expr, value: Any, env: dict[str, Any]) -> None:
        if isinstance(target, ast.Name):
            env[target.id] = self.bind(target.id, value)
        elif isinstance(target, ast.Tuple):
            value = self.bind("t", value)
            for t, v in zip(target.elts, value, strict=True):
                self._assign(t, v, env)
        elif isinstance(target, ast.Subscript):
            memory = self._value(target.value, env)
            if not isinstance(memory, StateArray):
                raise ValueError(f"{ast.unparse(target)!r} cannot be exported: only the state may be written to.")
            index = _indices(self._value(target.slice, env))
            if name := memory.name(*index):
                self.store(name, value)
        else:
            raise ValueError(f"{ast.unparse(target)!r} cannot be exported; assign to a name.")

    # -- expressions ------------------------------------------------------------------

    def _value(self, e: ast.expr, env: dict[str, Any]) -> Any:
        method = getattr(self, f"_{type(e).__name__.lower()}", None)
        if method is None:
            raise ValueError(f"{ast.unparse(e)!r} cannot be exported; write it with numbers and the math module only.")
        return method(e, env)

    def _constant(self, e: ast.Constant, env: dict[str, Any]) -> Any:
        return e.value

    def _name(self, e: ast.Name, env: dict[str, Any]) -> Any:
        return ChainMap(env, self.globals, _BUILTINS)[e.id]

    def _attribute(self, e: ast.Attribute, env: dict[str, Any]) -> Any:
        return getattr(self._value(e.value, env), e.attr)

    def _tuple(self, e: ast.Tuple, env: dict[str, Any]) -> Any:
        return tuple(self._value(x, env) for x in e.elts)

    def _subscript(self, e: ast.Subscript, env: dict[str, Any]) -> Any:
        whole, index = self._value(e.value, env), self._value(e.slice, env)
        if isinstance(whole, StateArray):  # read now, because the stored value may change before it is used
            kept = whole.name(*_indices(index))
            if not kept:
                return 0.0
            name = self.variable("m", "real")
            self.statements.append(Set(name, kept))
            return Symbol(name)
        if any(isinstance(i, Symbol) for i in (index if isinstance(index, tuple) else (index,))):
            raise ValueError(f"{ast.unparse(e)!r} cannot be exported; the index must be known in advance.")
        found = whole[index]
        return found.item() if isinstance(found, np.generic) else found

    def _unaryop(self, e: ast.UnaryOp, env: dict[str, Any]) -> Any:
        value = self._value(e.operand, env)
        if not isinstance(value, Symbol):
            return not value if isinstance(e.op, ast.Not) else -value
        if isinstance(e.op, ast.Not):
            return Symbol(self.language.negated(value.text), "bool")
        return Symbol(f"(-{value.text})")

    def _binop(self, e: ast.BinOp, env: dict[str, Any]) -> Any:
        return self.binary(type(e.op).__name__, self._value(e.left, env), self._value(e.right, env))

    def binary(self, op: str, a: Any, b: Any) -> Any:
        """a op b: folded, simplified where the value stays the same, or written."""
        if not isinstance(a, Symbol) and not isinstance(b, Symbol):
            return _FOLD[op](a, b)
        zero_a, zero_b = (not isinstance(v, Symbol) and v == 0 for v in (a, b))
        if op == "Add" and (zero_a or zero_b):
            return b if zero_a else a
        if op == "Sub" and zero_b:
            return a
        if op == "Mult":
            if zero_a or zero_b:
                return 0.0
            for factor, other in ((a, b), (b, a)):
                if not isinstance(factor, Symbol):
                    return self._scaled(float(factor), other)
        if op == "Div":
            if zero_a:
                return 0.0
            if not isinstance(b, Symbol):  # a product is five times faster and accurate to the last bit but one
                return self.binary("Mult", a, 1.0 / b)
        if op == "Pow":
            if not isinstance(b, Symbol) and b in (2, 3):
                base = self.text(self.bind("base", a))
                return Symbol("(" + " * ".join([base] * int(b)) + ")")
            return Symbol(self.language.function("pow", [self.text(a), self.text(b)]))
        return Symbol(f"({self.text(a)} {self.language.operators[op]} {self.text(b)})")

    def _scaled(self, factor: float, a: Symbol) -> Symbol:
        factor *= a.factor
        base = a.base or a.text
        if factor == 1.0:
            return Symbol(base)
        return Symbol(f"({self.language.number(factor)} * {base})", "real", factor, base)

    def _compare(self, e: ast.Compare, env: dict[str, Any]) -> Any:
        values = [self._value(x, env) for x in (e.left, *e.comparators)]
        parts: list[Any] = []
        for op, a, b in zip(e.ops, values, values[1:], strict=False):
            name = type(op).__name__
            if isinstance(a, Symbol) or isinstance(b, Symbol):
                parts.append(Symbol(f"({self.text(a)} {self.language.operators[name]} {self.text(b)})", "bool"))
            else:
                parts.append(bool(_FOLD[name](a, b)))
        return self._all(parts, "And")

    def _boolop(self, e: ast.BoolOp, env: dict[str, Any]) -> Any:
        parts = []
        for x in e.values:
            value = self._value(x, env)
            parts.append(value)
            if not isinstance(value, Symbol) and bool(value) == isinstance(e.op, ast.Or):
                break
        return self._all(parts, type(e.op).__name__)

    def _all(self, parts: list[Any], op: str) -> Any:
        absorbing = op == "Or"
        if any(not isinstance(p, Symbol) and bool(p) == absorbing for p in parts):
            return absorbing
        open_ = [p.text for p in parts if isinstance(p, Symbol)]
        if not open_:
            return not absorbing
        joined = f" {self.language.operators[op]} ".join(open_)
        return Symbol(joined if len(open_) == 1 else f"({joined})", "bool")

    def _ifexp(self, e: ast.IfExp, env: dict[str, Any]) -> Any:
        test = self._value(e.test, env)
        if not isinstance(test, Symbol):
            return self._value(e.body if test else e.orelse, env)
        return self._branch(test, [ast.Return(e.body)], [ast.Return(e.orelse)], env)

    def _call(self, e: ast.Call, env: dict[str, Any]) -> Any:
        function = self._value(e.func, env)
        arguments = [self._value(a, env) for a in e.args]
        name = _INTRINSICS.get(function) if getattr(function, "__hash__", None) else None
        if name is None:
            return self.call(function, *arguments)
        if not any(isinstance(a, Symbol) for a in arguments):
            return function(*arguments)
        if name in ("min", "max"):  # an infinite limit has no effect
            never = math.inf if name == "min" else -math.inf
            arguments = [a for a in arguments if isinstance(a, Symbol) or a != never]
        if len(arguments) == 1 and name in ("min", "max", "float"):
            return arguments[0]
        if name in self.language.twice:
            arguments = [self.bind("a", a) for a in arguments]
        if name in ("sin", "cos") and self.wave is not None and "t" not in self._sources(arguments[0].text):
            return Symbol(self._remembered(name, arguments[0].text))
        return Symbol(self.language.function(name, [self.text(a) for a in arguments]))

    def _remembered(self, name: str, argument: str) -> str:
        """A sine or cosine of the motion; branches that need the same one share a slot."""
        assert self.wave is not None
        whole = self.meaning[argument][0] if argument in self.meaning else argument
        slot = self.waves.setdefault(whole, len(self.waves))
        return self.wave(name, slot, argument)


def _indices(index: Any) -> tuple[int, ...]:
    return tuple(int(i) for i in (index if isinstance(index, tuple) else (index,)))


def _returns(s: ast.stmt) -> bool:
    return any(isinstance(n, ast.Return) for n in ast.walk(s))


_BUILTINS = {"abs": abs, "min": min, "max": max, "int": int, "float": float, "bool": bool}
_INTRINSICS: dict[Any, str] = {
    abs: "abs", min: "min", max: "max", float: "float", int: "int", math.sin: "sin", math.cos: "cos", math.tan: "tan",
    math.exp: "exp", math.log: "log", math.sqrt: "sqrt", math.tanh: "tanh", math.atan: "atan",
    math.atan2: "atan2", tanh: "tanh",  # of the equations, which is the same number
    math.floor: "floor", math.copysign: "copysign", math.fabs: "abs", math.pow: "pow",
}  # fmt: skip
_FOLD: dict[str, Callable[[Any, Any], Any]] = {
    "Add": operator.add, "Sub": operator.sub, "Mult": operator.mul, "Div": operator.truediv, "Pow": operator.pow,
    "FloorDiv": operator.floordiv, "Mod": operator.mod, "Lt": operator.lt, "LtE": operator.le, "Gt": operator.gt,
    "GtE": operator.ge, "Eq": operator.eq, "NotEq": operator.ne, "Is": operator.is_, "IsNot": operator.is_not,
}  # fmt: skip
