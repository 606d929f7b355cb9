"""Static nonlinearities that are not a single physical effect: the terms of general laws.

With them Hammerstein and Wiener systems are the same class as the paper's, and a
six-parameter smooth friction law (3) is a sum like any other.
"""

from __future__ import annotations

from whsklearn.effects import codes
from whsklearn.effects.base import Effect
from whsklearn.effects.friction import StaticEffect
from whsklearn.effects.quantity import choice, number


class _LawTerm(StaticEffect):
    """A term of a law of any system: its weight is in the unit of y per that of the term."""

    weight: float = number(1.0, "y per x", -1e6, 1e6)

    place = "static"


class Tanh(_LawTerm):
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

    velocity: float = number(1.0, "x", 1e-6, 1e6, log=True)

    name = "tanh"
    equation = "w tanh(dx / v)"
    signature = "a step at zero speed with a rounded edge"
    needs = "speeds on both sides of v, in both directions"
    code = codes.TANH


class TanhDifference(_LawTerm):
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

    fast: float = number(0.1, "x", 1e-6, 1e6, log=True)
    slow: float = number(1.0, "x", 1e-6, 1e6, log=True)

    name = "tanh_difference"
    equation = "w (tanh(dx / v_1) - tanh(dx / v_2))"
    signature = "a hump of friction at low speed that is gone at high speed"
    needs = "speeds between v_1 and v_2, in both directions"
    code = codes.TANH_DIFFERENCE


class Power(_LawTerm):
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

    degree: float = number(1.0, "1", 0, 9)

    name = "power"
    equation = "w x^k"
    signature = "a curve over x that grows with the k-th power"
    needs = "the whole range of x; its ends determine the high powers"
    code = codes.POWER

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.degree < 0 or self.degree != int(self.degree):
            raise ValueError(f"Power: degree is {self.degree}, expected a whole number >= 0; use Hinge for kinks.")


class Hinge(_LawTerm):
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

    knot: float = number(0.0, "x", -1e6, 1e6)

    name = "hinge"
    equation = "w max(x - knot, 0)"
    signature = "a kink at the knot, zero below it"
    needs = "samples on both sides of the knot"
    code = codes.HINGE


class NaturalSpline(_LawTerm):
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

    knot: float = number(-1.0, "x", -1e6, 1e6)
    last_but_one: float = number(0.0, "x", -1e6, 1e6)
    last: float = number(1.0, "x", -1e6, 1e6)

    name = "natural_spline"
    equation = "w (d_k(x) - d_m(x)), d_k(x) = ((x - k)_+^3 - (x - l)_+^3) / (l - k)"
    reference = "Hastie, Tibshirani, Friedman 2009, The Elements of Statistical Learning, (5.4)"
    signature = "a smooth bend over x, straight beyond the outer knots"
    needs = "samples between all of the knots"
    code = codes.NATURAL_SPLINE

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.knot < self.last_but_one < self.last:
            knots = (self.knot, self.last_but_one, self.last)
            raise ValueError(f"NaturalSpline: the knots are {knots}, expected increasing numbers; sort them.")


class SpeedHinge(_LawTerm):
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

    weight: float = number(1.0, "Nm s/rad", -1e6, 1e6)
    knot: float = number(1.0, "rad/s", 1e-9, 1e6, log=True)

    name = "speed_hinge"
    equation = "w sign(dx) max(|dx| - knot, 0)"
    signature = "a kink of the friction curve at the same speed in both directions"
    needs = "speeds on both sides of the knot, in both directions"
    code = codes.SPEED_HINGE


# --- a torque without an equation in the catalogue: cubic splines over position, speed or drive ----------------------
# A learned curve is a sum of equally spaced basis functions of equal shape, one `LearnedTorque` each; besides its
# height, three numbers give its position, its width and the period after which it repeats.
class LearnedTorque(Effect):
    """One basis function of a learned curve, c B((x - x_0) / w) r (Nm) with the cubic spline B and x, r by ``over``.

    ``over`` is ``position`` (x = q, r = 1), ``speed`` (|v|, sign(v)), ``position and direction`` (q, sign(v)),
    ``position and velocity`` (q, v), ``velocity`` (v, 1) or ``drive`` (u, 1); a curve is a sum of them.

    See Also
    --------
    NaturalSpline : a term of a named spline law.
    PositionFriction : friction that varies with position as one wave.
    Cogging : waves over the angle.

    Examples
    --------
    >>> LearnedTorque(0.4, centre=1.0, width=0.5).value(position=[0.0, 0.5, 1.0]).tolist()
    [0.0, 0.1, 0.4]
    """

    torque: float = number(0.1, "Nm", -1e3, 1e3)
    centre: float = number(0.0, "1", -1e6, 1e6, starts=(0.0,))
    width: float = number(0.5, "1", 1e-9, 1e6, log=True, starts=(0.5,))
    period: float = number(0.0, "1", 0.0, 1e6, starts=(0.0,))
    over: str = choice(
        "position",
        {
            "position": codes.LEARNED_POSITION,
            "speed": codes.LEARNED_SPEED,
            "position and direction": codes.LEARNED_FRICTION,
            "position and velocity": codes.LEARNED_DAMPING,
            "velocity": codes.LEARNED_VELOCITY,
            "drive": codes.LEARNED_DRIVE,
        },
    )

    name = "learned_torque"
    place = "static"  # it does not name an effect, so no search tries it
    equation = "sum of c B((x - x_0)/w)"
    signature = "the residual follows a signal, but no law of the catalogue"
    needs = "several passes over the same places or speeds"
    reference = "Eilers, Marx 1996, Flexible smoothing with B-splines and penalties, Stat. Sci. 11(2)"
    held = ("centre", "width", "period")
