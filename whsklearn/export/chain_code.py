"""A chain of filter, law and filter as code, sample by sample."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from whsklearn.effects import Effect, FrictionLaw
from whsklearn.effects import codes as fx
from whsklearn.effects.equations import delayed
from whsklearn.effects.rows import term
from whsklearn.export.axis_code import Fragment
from whsklearn.export.languages import Language, OneOf, StateArray, Symbol
from whsklearn.export.specialise import Specialiser
from whsklearn.systems.chain import added, driven, packed, sensed, transmitted


@dataclass(frozen=True)
class CodedChain:
    """x = b1/f1 u, v = law(x, dx), y = b2/f2 v + offset, integrated if the output is a position.

    Polynomials in the delay operator, beginning with the direct path; f1 and f2 begin with 1; without a law, v = x.
    Effects act at the ports of a chain whose blocks both have a delay (`whsklearn.systems.chain`).

    >>> late = np.array([0.0, 1.0])
    >>> chain = CodedChain(0.5 * late, np.array([1.0, -0.5]), None, late, np.ones(1), dt=0.01)
    >>> chain.direct, [x.tolist() for x in chain.linear()]
    (False, [[0.0, 0.0, 0.5], [1.0, -0.5]])
    """

    b1: NDArray[Any]
    f1: NDArray[Any]
    law: FrictionLaw | None
    b2: NDArray[Any]
    f2: NDArray[Any]
    dt: float
    offset: float = 0.0
    integrates: bool = False
    effects: tuple[Effect, ...] = ()

    @property
    def direct(self) -> bool:
        """Whether a block has a direct path: an effect before it then depends on signals behind it."""
        return bool(self.b1[0] != 0.0 or self.b2[0] != 0.0)

    def linear(self) -> tuple[NDArray[Any], NDArray[Any]]:
        """Numerator and denominator of the chain with the law's linear terms only."""
        gain: NDArray[Any] = np.ones(1) if self.law is None else np.zeros(2)
        for t in self.law.terms if self.law else ():
            if t.name == "viscous":
                gain = gain + t.magnitude * np.array([1.0, -1.0])
            elif t.name == "power" and t.shape["degree"] == 1:
                gain = gain + t.magnitude * np.array([1.0, 0.0])
        numerator = np.convolve(np.convolve(self.b1, gain), self.b2)
        denominator = np.convolve(self.f1, self.f2)
        if self.integrates:
            numerator, denominator = numerator * self.dt, np.convolve(denominator, [1.0, -1.0])
        return numerator, denominator


def _filtered(b, f, z, n, u):  # type: ignore[no-untyped-def]
    """One sample of b/f in the transposed direct form II, as in scipy.signal.lfilter."""
    if n == 0:
        return b[0] * u
    y = b[0] * u + z[0]
    for i in range(n - 1):
        z[i] = b[i + 1] * u + z[i + 1] - f[i + 1] * y
    z[n - 1] = b[n] * u - f[n] * y
    return y


def _law(codes, shapes, weights, x, dx):  # type: ignore[no-untyped-def]
    total = 0.0
    for k in range(codes.size):
        total += weights[k] * term(codes[k], shapes[k, 0], shapes[k, 1], shapes[k, 2], x, dx, math.inf)[0]
    return total


def _pushed(b, f, z, n, u, y):  # type: ignore[no-untyped-def]
    """Update the states of `_filtered` for an input that is known only after its output, if b[0] is zero."""
    for i in range(n - 1):
        z[i] = b[i + 1] * u + z[i + 1] - f[i + 1] * y
    z[n - 1] = b[n] * u - f[n] * y


def _with_effects(chain, work, states, block, drive):  # type: ignore[no-untyped-def]
    """The reading of a chain with effects at its ports, sample by sample as `whsklearn.systems.chain.run`."""
    state = work.language.state
    ports: Any = packed(chain.effects)
    slots: dict[tuple[int, int], int] = {}
    memory = StateArray(lambda i, j: state("memory", slots.setdefault((i, j), len(slots))))
    own = OneOf(tuple(type(e).evaluate for e in chain.effects if e.evaluate is not None))
    t: Any = Symbol(state("samples"))
    n = max(chain.b1.size, chain.f1.size) - 1
    b, f = (np.pad(v, (0, n + 1 - v.size)) for v in (chain.b1, chain.f1))
    z = StateArray(lambda i: state("first", i))
    states |= {"first": n, "last_x": 0, "last_dx": 0, "samples": 0}
    first = work.bind("raw", work.call(_first, z))
    x = work.bind("x", work.call(transmitted, *ports[:2], memory, first, chain.dt))
    u: Any = Symbol(drive)
    late = [e for e in chain.effects if e.code == fx.INPUT_DELAY]
    for whole, part in (delayed(max(e.row[0] / chain.dt, 0.0)) for e in late):
        past = [u, *(Symbol(state("history", i)) for i in range(whole + 1))]
        newer, older = (work.binary("Mult", share, past[i]) for share, i in ((1.0 - part, whole), (part, whole + 1)))
        u = work.bind("arrived", work.binary("Add", newer, older))
        states["history"] = whole + 1
        for i in reversed(range(whole + 1)):
            work.store(state("history", i), past[i])
    before: Any = Symbol(state("last_x"))
    ahead = work.bind("ahead", work.call(_ahead, f, z, n, first, x))
    driven_u = work.bind("driven", work.call(driven, *ports[:2], memory, u, t, x, before, ahead, chain.dt))
    work.call(_pushed, b, f, z, n, driven_u, first)
    dx = work.bind("dx", work.binary("Sub", x, before))
    ddx = work.bind("ddx", work.binary("Sub", dx, Symbol(state("last_dx"))))
    law = chain.law
    v = work.call(_law, law.codes, law.shapes, law.weights, x, dx)
    more = work.call(added, *ports[:2], memory, own, Symbol(drive), x, dx, ddx, t, chain.dt, math.inf)
    v = work.bind("v", work.binary("Add", v, more))
    work.store(state("last_x"), x)
    work.store(state("last_dx"), dx)
    y = work.bind("q", block("second", chain.b2, chain.f2, v))
    y = work.bind("y", work.call(sensed, *ports[:2], memory, own, y, t, chain.dt))
    work.store(state("samples"), work.binary("Add", t, 1.0))
    if slots:
        states["memory"] = len(slots)
    return y


def _first(z):  # type: ignore[no-untyped-def]
    return z[0]


def _ahead(f, z, n, first, x):  # type: ignore[no-untyped-def]
    """The next x without a drive, if the transmission transmits the change of ``first``."""
    return (z[1] if n > 1 else 0.0) - f[1] * first + x - first


def chain_code(chain: CodedChain, language: Language, *, drive: str = "drive", out: float = 1.0) -> Fragment:
    """One sample of a chain, specialised to its numbers; ``out`` as for `axis_code`, ``drive`` the input's variable.

    >>> from whsklearn.export.languages import C
    >>> late = np.array([0.0, 1.0])
    >>> code = chain_code(CodedChain(0.5 * late, np.array([1.0, -0.5]), None, late, np.ones(1), dt=0.01), C())
    >>> code.states, code.lines[1]
    ({'first': 1, 'second': 1}, 's->first[0] = (0.5 * drive) - ((-0.5) * m_0);')
    """
    work, state = Specialiser(language), language.state
    states: dict[str, int] = {}

    def block(name: str, b: NDArray[Any], f: NDArray[Any], u: Any) -> Any:
        n = max(b.size, f.size) - 1
        if n:
            states[name] = n
        wide = [np.pad(v, (0, n + 1 - v.size)) for v in (b, f)]
        return work.bind(name, work.call(_filtered, *wide, StateArray(lambda i: state(name, i)), n, u))

    effects = bool(chain.effects) and not chain.direct
    if effects:
        x = _with_effects(chain, work, states, block, drive)
    else:
        x = block("first", chain.b1, chain.f1, Symbol(drive))
    if chain.law is not None and not effects:
        law, dx = chain.law, 0.0
        if any(t.name != "power" for t in law.terms):
            states["last_x"] = 0
            dx = work.bind("dx", work.binary("Sub", x, Symbol(state("last_x"))))
            work.store(state("last_x"), x)
        x = work.bind("v", work.call(_law, law.codes, law.shapes, law.weights, x, dx))
    y = work.binary("Add", x if effects else block("second", chain.b2, chain.f2, x), chain.offset)
    if chain.integrates:
        states["total"] = 0
        total = work.bind("total", work.binary("Add", Symbol(state("total")), y))
        work.store(state("total"), total)
        y = work.binary("Mult", total, chain.dt)
    y = work.bind("y", work.binary("Mult", y, 1.0 / out))
    return Fragment(*work.finish(y), work.text(y), states)
