"""Static nonlinearities that are not a single physical effect: the terms of general laws.

With them Hammerstein and Wiener systems are the same class as the paper's, and a
six-parameter smooth friction law (3) is a sum like any other.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from whsklearn.effects import codes
from whsklearn.effects.friction import StaticEffect
from whsklearn.effects.quantity import Quantity

_WEIGHT = Quantity("y per x", -1e6, 1e6)


@dataclass(frozen=True)
class Tanh(StaticEffect):
    """weight tanh(dx / velocity), in y's unit: the smooth Coulomb term gamma_4 tanh(gamma_5 dx) of (3).

    See Also
    --------
    Coulomb : the same with a sharp edge.
    TanhDifference : a hump near zero speed.

    References
    ----------
    Makkar, Dixon, Sawyer and Hu 2005, A new continuously differentiable friction model for control systems
    design, Proc. AIM 2005, 600-605; paper, (3).

    Examples
    --------
    >>> round(Tanh(0.5, velocity=0.1).value(velocity=0.1), 3)
    0.381
    """

    weight: float = 1.0
    velocity: float = 1.0

    name: ClassVar[str] = "tanh"
    place: ClassVar[str] = "static"
    equation: ClassVar[str] = "w tanh(dx / v)"
    size: ClassVar[str] = "weight"
    quantities: ClassVar[dict[str, Quantity]] = {"weight": _WEIGHT, "velocity": Quantity("x", 1e-6, 1e6, log=True)}
    signature: ClassVar[str] = "a step at zero speed with a rounded edge"
    needs: ClassVar[str] = "speeds on both sides of v, in both directions"
    code: ClassVar[int] = codes.TANH


@dataclass(frozen=True)
class TanhDifference(StaticEffect):
    """weight (tanh(dx / fast) - tanh(dx / slow)), in y's unit: the Stribeck term of (3).

    See Also
    --------
    Stribeck : the same hump beside a sharp sign.
    Tanh : a step that remains at high speed.

    References
    ----------
    Makkar, Dixon, Sawyer and Hu 2005, A new continuously differentiable friction model for control systems
    design, Proc. AIM 2005, 600-605; paper, (3).

    Examples
    --------
    >>> round(TanhDifference(1.0, fast=0.1, slow=1.0).value(velocity=0.3), 3)
    0.704
    """

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
    signature: ClassVar[str] = "a hump of friction at low speed that is gone at high speed"
    needs: ClassVar[str] = "speeds between v_1 and v_2, in both directions"
    code: ClassVar[int] = codes.TANH_DIFFERENCE


@dataclass(frozen=True)
class Power(StaticEffect):
    """weight x^degree, in y's unit: a term of a polynomial.

    See Also
    --------
    Hinge : a kink at one place.
    NaturalSpline : smooth, and straight beyond the outer knots.

    References
    ----------
    Narendra and Gallman 1966, An iterative method for the identification of nonlinear systems using a Hammerstein
    model, IEEE Trans. Autom. Control 11(3), 546-550.

    Examples
    --------
    >>> Power(2.0, degree=3).value(position=-2.0)
    -16.0
    """

    weight: float = 1.0
    degree: float = 1.0

    name: ClassVar[str] = "power"
    place: ClassVar[str] = "static"
    equation: ClassVar[str] = "w x^k"
    size: ClassVar[str] = "weight"
    quantities: ClassVar[dict[str, Quantity]] = {"weight": _WEIGHT, "degree": Quantity("1", 0, 9)}
    signature: ClassVar[str] = "a curve over x that grows with the k-th power"
    needs: ClassVar[str] = "the whole range of x; its ends determine the high powers"
    code: ClassVar[int] = codes.POWER

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.degree < 0 or self.degree != int(self.degree):
            raise ValueError(f"Power: degree is {self.degree}, expected a whole number >= 0; use Hinge for kinks.")


@dataclass(frozen=True)
class Hinge(StaticEffect):
    """weight max(x - knot, 0), in y's unit: a term of a piecewise-linear law.

    See Also
    --------
    NaturalSpline : smooth at its knots.
    SpeedHinge : the same over speed, odd.

    References
    ----------
    Breiman 1993, Hinging hyperplanes for regression, classification, and function approximation, IEEE Trans. Inf.
    Theory 39(3), 999-1013.

    Examples
    --------
    >>> Hinge(2.0, knot=1.0).value(position=[0.5, 1.5]).tolist()
    [0.0, 1.0]
    """

    weight: float = 1.0
    knot: float = 0.0

    name: ClassVar[str] = "hinge"
    place: ClassVar[str] = "static"
    equation: ClassVar[str] = "w max(x - knot, 0)"
    size: ClassVar[str] = "weight"
    quantities: ClassVar[dict[str, Quantity]] = {"weight": _WEIGHT, "knot": Quantity("x", -1e6, 1e6)}
    signature: ClassVar[str] = "a kink at the knot, zero below it"
    needs: ClassVar[str] = "samples on both sides of the knot"
    code: ClassVar[int] = codes.HINGE


@dataclass(frozen=True)
class NaturalSpline(StaticEffect):
    """One of the functions that span the natural cubic splines over given knots, in y's unit.

    Together with a constant and x they span all splines that are cubic between the knots and straight
    beyond the outer ones; there is one for each knot but the last two.

    See Also
    --------
    Hinge : straight between its knots.
    Power : one polynomial over the whole range.

    Examples
    --------
    >>> NaturalSpline(1.0, knot=-1.0, last_but_one=0.0, last=1.0).value(position=[-2.0, 0.0, 2.0]).tolist()
    [0.0, 0.5, 6.0]
    """

    weight: float = 1.0
    knot: float = -1.0
    last_but_one: float = 0.0
    last: float = 1.0

    name: ClassVar[str] = "natural_spline"
    place: ClassVar[str] = "static"
    equation: ClassVar[str] = "w (d_k(x) - d_m(x)), d_k(x) = ((x - k)_+^3 - (x - l)_+^3) / (l - k)"
    size: ClassVar[str] = "weight"
    quantities: ClassVar[dict[str, Quantity]] = {
        "weight": _WEIGHT,
        "knot": Quantity("x", -1e6, 1e6),
        "last_but_one": Quantity("x", -1e6, 1e6),
        "last": Quantity("x", -1e6, 1e6),
    }
    reference: ClassVar[str] = "Hastie, Tibshirani, Friedman 2009, The Elements of Statistical Learning, (5.4)"
    signature: ClassVar[str] = "a smooth bend over x, straight beyond the outer knots"
    needs: ClassVar[str] = "samples between all of the knots"
    code: ClassVar[int] = codes.NATURAL_SPLINE

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.knot < self.last_but_one < self.last:
            knots = (self.knot, self.last_but_one, self.last)
            raise ValueError(f"NaturalSpline: the knots are {knots}, expected increasing numbers; sort them.")


@dataclass(frozen=True)
class SpeedHinge(StaticEffect):
    """weight sign(dx) max(|dx| - knot, 0), in y's unit: a kink of an odd friction curve over speed.

    See Also
    --------
    Hinge : the same over x, on one side only.
    QuadraticDrag : friction that grows without a kink.

    References
    ----------
    Breiman 1993, Hinging hyperplanes for regression, classification, and function approximation, IEEE Trans. Inf.
    Theory 39(3), 999-1013.

    Examples
    --------
    >>> SpeedHinge(2.0, knot=1.0).value(velocity=[-1.5, 0.5, 1.5]).tolist()
    [-1.0, 0.0, 1.0]
    """

    weight: float = 1.0
    knot: float = 1.0

    name: ClassVar[str] = "speed_hinge"
    place: ClassVar[str] = "static"
    equation: ClassVar[str] = "w sign(dx) max(|dx| - knot, 0)"
    size: ClassVar[str] = "weight"
    quantities: ClassVar[dict[str, Quantity]] = {"weight": _WEIGHT, "knot": Quantity("x", 1e-9, 1e6, log=True)}
    signature: ClassVar[str] = "a kink of the friction curve at the same speed in both directions"
    needs: ClassVar[str] = "speeds on both sides of the knot, in both directions"
    code: ClassVar[int] = codes.SPEED_HINGE
