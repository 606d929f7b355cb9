"""A torque without an equation in the catalogue: cubic splines over position, speed or drive.

A learned curve is a sum of equally spaced basis functions of equal shape, one `LearnedTorque` each; besides its height,
three numbers give its position, its width and the period after which it repeats.
"""

from __future__ import annotations

from whsklearn.effects import codes
from whsklearn.effects.base import Effect
from whsklearn.effects.quantity import choice, number


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
