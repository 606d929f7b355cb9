"""A chain of filter, law and filter as code, sample by sample."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from whsklearn.effects import FrictionLaw
from whsklearn.effects.terms import term
from whsklearn.export.axis_code import Part
from whsklearn.export.languages import Language
from whsklearn.export.specialise import Specialiser
from whsklearn.export.statements import Memory, Symbol


@dataclass(frozen=True)
class Chain:
    """x = b1/f1 u, v = law(x, dx), y = b2/f2 v + offset, summed up times dt where the output is a position.

    Polynomials in the delay, from the direct path on; f1 and f2 begin with 1; no law: v = x.
    """

    b1: NDArray[Any]
    f1: NDArray[Any]
    law: FrictionLaw | None
    b2: NDArray[Any]
    f2: NDArray[Any]
    dt: float
    offset: float = 0.0
    integrates: bool = False

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


@dataclass
class ChainCode:
    """One sample as statements, and what is kept between samples."""

    step: Part
    states: dict[str, int]


def _filtered(b, f, z, n, u):  # type: ignore[no-untyped-def]
    """One sample of b/f in the transposed direct form II, as scipy.signal.lfilter has it."""
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


def chain_code(chain: Chain, language: Language, state: Any) -> ChainCode:
    """Specialise a chain to its numbers; ``state(name, index)`` as for `axis_code`."""
    work = Specialiser(language)
    states: dict[str, int] = {}

    def block(name: str, b: NDArray[Any], f: NDArray[Any], u: Any) -> Any:
        n = max(b.size, f.size) - 1
        if n:
            states[name] = n
        wide = [np.pad(v, (0, n + 1 - v.size)) for v in (b, f)]
        return work.bind(name, work.call(_filtered, *wide, Memory(lambda i: state(name, i)), n, u))

    x = block("first", chain.b1, chain.f1, Symbol("drive"))
    if chain.law is not None:
        law, dx = chain.law, 0.0
        if any(t.name != "power" for t in law.terms):
            states["last_x"] = 0
            dx = work.bind("dx", work.binary("Sub", x, Symbol(state("last_x", -1))))
            work.store(state("last_x", -1), x)
        x = work.bind("v", work.call(_law, law.codes, law.shapes, law.weights, x, dx))
    y = work.binary("Add", block("second", chain.b2, chain.f2, x), chain.offset)
    if chain.integrates:
        states["total"] = 0
        total = work.bind("total", work.binary("Add", Symbol(state("total", -1)), y))
        work.store(state("total", -1), total)
        y = work.binary("Mult", total, chain.dt)
    y = work.bind("y", y)
    return ChainCode(Part(*work.finish(y), work.text(y)), states)
