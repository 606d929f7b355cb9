"""Static nonlinearities that are no single physical effect: the terms of general laws.

With them Hammerstein and Wiener systems are the same class as the paper's, and a
six-parameter smooth friction law (3) is a sum like any other.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from whsklearn.effects import terms
from whsklearn.effects.friction import StaticEffect
from whsklearn.effects.quantity import Quantity

_WEIGHT = Quantity("y per x", -1e6, 1e6)


@dataclass(frozen=True)
class Tanh(StaticEffect):
    """weight tanh(dx / velocity): the smooth Coulomb term gamma_4 tanh(gamma_5 dx) of (3)."""

    weight: float = 1.0
    velocity: float = 1.0

    name: ClassVar[str] = "tanh"
    place: ClassVar[str] = "static"
    equation: ClassVar[str] = "w tanh(dx / v)"
    size: ClassVar[str] = "weight"
    quantities: ClassVar[dict[str, Quantity]] = {"weight": _WEIGHT, "velocity": Quantity("x", 1e-6, 1e6, log=True)}
    code: ClassVar[int] = terms.TANH


@dataclass(frozen=True)
class TanhDifference(StaticEffect):
    """weight (tanh(dx / fast) - tanh(dx / slow)): the Stribeck term of (3)."""

    weight: float = 1.0
    fast: float = 0.1
    slow: float = 1.0

    name: ClassVar[str] = "tanh_difference"
    place: ClassVar[str] = "static"
    equation: ClassVar[str] = "w (tanh(dx / v_1) - tanh(dx / v_2))"
    size: ClassVar[str] = "weight"
    quantities: ClassVar[dict[str, Quantity]] = {
        "weight": _WEIGHT,
        "fast": Quantity("x", 1e-6, 1e6, log=True),
        "slow": Quantity("x", 1e-6, 1e6, log=True),
    }
    code: ClassVar[int] = terms.TANH_DIFFERENCE


@dataclass(frozen=True)
class Power(StaticEffect):
    """weight x^degree, a term of a polynomial."""

    weight: float = 1.0
    degree: float = 1.0

    name: ClassVar[str] = "power"
    place: ClassVar[str] = "static"
    equation: ClassVar[str] = "w x^k"
    size: ClassVar[str] = "weight"
    quantities: ClassVar[dict[str, Quantity]] = {"weight": _WEIGHT, "degree": Quantity("1", 0, 9)}
    code: ClassVar[int] = terms.POWER

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.degree < 0 or self.degree != int(self.degree):
            raise ValueError(f"Power: degree is {self.degree}, expected a whole number >= 0; use Hinge for kinks.")


@dataclass(frozen=True)
class Hinge(StaticEffect):
    """weight max(x - knot, 0), a term of a piecewise-linear law."""

    weight: float = 1.0
    knot: float = 0.0

    name: ClassVar[str] = "hinge"
    place: ClassVar[str] = "static"
    equation: ClassVar[str] = "w max(x - knot, 0)"
    size: ClassVar[str] = "weight"
    quantities: ClassVar[dict[str, Quantity]] = {"weight": _WEIGHT, "knot": Quantity("x", -1e6, 1e6)}
    code: ClassVar[int] = terms.HINGE
