"""Friction before sliding: asperities act as springs that break loose after a short distance.

All of them are c z, where z is a pure memory of the path, |z| near 1 after the presliding
distance.  The effect adds to the law's Coulomb term; if it replaces that term, a refit removes the same torque from
``coulomb``.
"""

from __future__ import annotations

import math

from whsklearn.effects import codes
from whsklearn.effects.base import Effect
from whsklearn.effects.equations import N_STATES
from whsklearn.effects.quantity import Scales, number
from whsklearn.effects.surroundings import Surroundings

# relative to the torque's level, of the peak after a reversal, kappa = d v / x_s with v the speed that the axis has
# reached after the presliding distance: critical damping of the bristles, d = 2 sqrt(J x_s / c), gives 2 sqrt(2 J a /
# c)
_KICKS = (0.2, 0.8, 3.0)
# Damping ratio of bristles beyond which they are a damper: ten times that of the published model, because a fit knows
# it to a factor of a few only (`tests/gap/plants/test_servo_inverse.py`).
MOST_DAMPED = 5.0


class PreslidingHysteresis(Effect):
    """Dahl's model, c z with dz/dx = (1 - z sign(v)) / x_s (Nm), the simplest of the family.

    See Also
    --------
    LuGre : its level falls with speed.
    GeneralizedMaxwellSlip : closes nested loops, which this model does not remember.
    BoucWen : slimmer loops.
    Backlash : also over a distance, but the motor moves freely meanwhile.
    Stribeck : acts near standstill as well, as a function of speed.

    Examples
    --------
    >>> path, speed = [0.0, 0.001, 0.01, 0.009], [0.0, 1.0, 1.0, -1.0]
    >>> PreslidingHysteresis(0.1, distance=0.001).value(position=path, velocity=speed).round(3).tolist()
    [0.0, 0.063, 0.1, -0.026]
    """

    torque: float = number(0.1, "Nm", 1e-4, 1e3, log=True)
    distance: float = number(
        1e-3,
        "rad",
        1e-6,
        0.2,
        log=True,
        span=(1e-5, 0.5),
        # on a long travel a bearing is past it within a sample or two: only the reversals themselves show it
        starts=(2e-5, 4.8e-5, 1e-4, 2.3e-4, 5e-4, 1.1e-3, 2.3e-3, 4.8e-3, 0.01, 0.022, 0.047, 0.1),
    )

    name = "presliding_hysteresis"
    place = "friction"
    equation = "c z, dz/dt = (v - |v| z) / x_s"
    signature = "after each reversal friction builds up over a short distance, along a curve"
    needs = "many small reversals"
    reference = "Dahl 1968, A solid friction model, Aerospace Corporation TOR-0158(3107-18)-1"
    parent = "coulomb"
    code = codes.DAHL

    def implausible(self, seen: Surroundings) -> str:
        """The objection that friction has built up before the encoder counts one step.

        To the record that is Coulomb friction, whose reversals a fit then only shapes.

        ``seen``: see `Effect.implausible`.
        """
        return "it builds up within one step of the encoder" if self.distance < seen.step else ""


class LuGre(PreslidingHysteresis):
    """LuGre: Dahl's spring whose end level falls with speed (Stribeck), with damping; c (z + d dz/dt) (Nm).

    See Also
    --------
    PreslidingHysteresis : Dahl's model, without the Stribeck level and the damping.
    GeneralizedMaxwellSlip : the same level with a memory of nested reversals.
    Stribeck : the same level without presliding.

    Examples
    --------
    >>> path, speed = [0.0, 0.01, 0.02], [0.0, 0.01, 1.0]
    >>> LuGre(0.1, ratio=1.5, damping=0.0).value(position=path, velocity=speed).round(3).tolist()
    [0.0, 0.148, 0.1]
    """

    ratio: float = number(1.5, "1", 1.0, 2.5, starts=(1.0, 1.5))
    velocity: float = number(0.05, "rad/s", 1e-3, 2.0, log=True, span=(4e-3, 0.5), starts=(0.01, 0.03, 0.1, 0.3))
    damping: float = number(1e-3, "s", 0.0, 2.0, log=True, span=(3e-4, 10.0), scale="stroke")

    equation = "c (z + d dz/dt), dz/dt = (v - |v| z / g(v)) / x_s, g = 1 + (r - 1) exp(-(v/v_s)^2)"
    later = ("ratio", "velocity")
    sought = True
    reference = "Canudas de Wit, Olsson, Astrom, Lischinsky 1995, IEEE Trans. Autom. Control 40(3), 419-425"
    code = codes.LUGRE

    def implausible(self, seen: Surroundings) -> str:
        """The objection that the bristles are dampers rather than springs (``seen``: see `Effect.implausible`).

        Bristles of stiffness s = T / d hold the inertia J at rest with the damping ratio c sqrt(s / J) / 2, c their
        damping over their stiffness.  The model was published with 0.5 (sigma_1 = sqrt(sigma_0), m = 1).  A fit that
        ends at 18 or 74 uses them as a damper of slow motion, in place of whatever else is missing there.
        """
        ratio = 0.5 * self.damping * math.sqrt(self.torque / (self.distance * seen.inertia))
        if ratio > MOST_DAMPED:
            return f"its bristles would be damped {ratio:.0f} times as much as critically"
        return super().implausible(seen)

    def labelled(self) -> dict[str, float | str]:
        """All fields under names with their unit; without the Stribeck speed if the level does not fall.

        Examples
        --------
        >>> list(LuGre(0.1, ratio=1.0).labelled())
        ['torque_nm', 'distance_rad', 'damping_s']
        """
        told = super().labelled()
        return told if self.ratio > 1.0 else {k: v for k, v in told.items() if not k.startswith(("ratio", "velocity"))}

    @classmethod
    def starts(cls, scales: Scales) -> list[tuple[float, ...]]:
        """Dahl's distances, each with the dampings that give the same peaks after a reversal, d = kappa T sqrt(x_s /
        reach).

        T = reach / speed is the time of half the travel, sqrt(x_s / reach) the share of the speed that the axis has
        gained after x_s: a grid of dampings alone would begin with peaks that are hundreds of times too large or too
        small.

        ``scales``: of the record.
        """
        once = super().starts(scales)
        field = cls.searched().index("damping")
        low, high = cls.quantities["damping"].bounds(scales)
        out: list[tuple[float, ...]] = []
        for x_s, ratio, velocity in dict.fromkeys(s[:field] for s in once):
            for kick in _KICKS:
                damping = kick * scales.stroke * math.sqrt(x_s / scales.reach)
                out.append((x_s, ratio, velocity, min(max(damping, low), high)))
        return out


class GeneralizedMaxwellSlip(PreslidingHysteresis):
    """Parallel Maxwell elements that stick up to distances of their own and remember nested loops; c mean(z_i) (Nm).

    The elements carry equal shares and break loose at evenly spaced distances with mean x_s;
    a sliding element follows the level g(v) at once, the limit of a fast attraction.

    See Also
    --------
    PreslidingHysteresis : Dahl's model, which drifts under a small oscillation beside a bias.
    LuGre : one state instead of several.

    Examples
    --------
    >>> path, speed = [0.0, 0.0004, 0.01], [0.0, 1.0, 1.0]
    >>> GeneralizedMaxwellSlip(0.1).value(position=path, velocity=speed).round(3).tolist()
    [0.0, 0.052, 0.1]
    """

    elements: float = number(4.0, "1", 1, N_STATES)
    ratio: float = number(1.0, "1", 1.0, 2.5)
    velocity: float = number(0.05, "rad/s", 1e-3, 2.0, log=True)

    equation = "c mean(z_i), dz_i = dx / x_i while |z_i| < g(v), else z_i = g(v) sign(v)"
    reference = "Al-Bender, Lampaert, Swevers 2005, IEEE Trans. Autom. Control 50(11), 1883-1887"
    code = codes.MAXWELL_SLIP

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.elements != int(self.elements) or not 1 <= self.elements <= N_STATES:
            raise ValueError(f"{self.elements} elements, expected a whole number from 1 to {N_STATES}; lower it.")


class BoucWen(PreslidingHysteresis):
    """Bouc-Wen with exponent 1 and beta + gamma = 1, c z (Nm): beta = 1 is Dahl, a smaller beta gives a slimmer loop.

    See Also
    --------
    PreslidingHysteresis : the case beta = 1.
    GeneralizedMaxwellSlip : loops built of elements.

    Examples
    --------
    >>> path, speed = [0.0, 0.001, 0.01, 0.009], [0.0, 1.0, 1.0, -1.0]
    >>> BoucWen(0.1, distance=0.001, beta=0.8).value(position=path, velocity=speed).round(3).tolist()
    [0.0, 0.063, 0.1, -0.02]
    """

    beta: float = number(0.8, "1", 0.3, 1.0)

    equation = "c z, dz/dt = (v - beta |v| z - (1 - beta) v |z|) / x_s"
    reference = "Wen 1976, ASCE J. Eng. Mech. Div. 102(2), 249-263"
    code = codes.BOUC_WEN
