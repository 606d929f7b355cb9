"""Effects between motor and load: they split the inertia in two."""

from __future__ import annotations

import math
from typing import ClassVar

from whsklearn._numba import njit
from whsklearn.effects import codes
from whsklearn.effects.base import Effect
from whsklearn.effects.quantity import number
from whsklearn.effects.surroundings import Surroundings

_equation = njit(cache=False, error_model="numpy")


@_equation
def contact_stiffness(frequency, reduced):
    """Stiffness at which the reduced inertia J_m J_l / J rings at a frequency in Hz (Nm/rad)."""
    return reduced * (2.0 * math.pi * frequency) ** 2


@_equation
def contact_damping(ratio, stiffness, reduced):
    """c = 2 zeta sqrt(k J_r) (Nm s/rad)."""
    return 2.0 * ratio * math.sqrt(stiffness * reduced)


@_equation
def coupling_torque(twist, slip, motor, load, stiffness, damping, gap, give, h):
    """Mean torque of the coupling over a step h: implicit midpoint, pushing only where there is play (Nm).

    At h = 0 it is T_c = k (d - clip(d, -b/2, b/2)) + c dd/dt in contact. ``motor`` and ``load`` are the
    accelerations without the coupling, ``give`` the change of their difference per unit torque.
    """
    side = 0.0
    if gap > 0.0:
        ahead = twist + 0.5 * h * slip
        if abs(ahead) <= 0.5 * gap:
            return 0.0
        side = 1.0 if ahead > 0.0 else -1.0
    deflection = twist - side * 0.5 * gap
    spring = 0.5 * h * stiffness + damping
    free = slip + 0.5 * h * (motor - load)
    torque = (stiffness * deflection + spring * free) / (1.0 + 0.5 * h * spring * give)
    return 0.0 if side * torque < 0.0 else torque


@_equation
def resonance(frequency, ratio, dt):
    """a_0, a_1, b_1, b_2 of (a_0 + a_1 z^-1) / (1 + b_1 z^-1 + b_2 z^-2), a resonance in Hz of static gain one.

    It is exact at the samples for an input held over each sample of dt seconds (Astrom and Wittenmark
    1997, Computer-Controlled Systems, table 2.1; frequency and damping w and z, damped frequency w sqrt(1 - z^2)).
    """
    decay = 2.0 * math.pi * ratio * frequency * dt
    radius = math.exp(-decay)
    turn = 2.0 * math.pi * frequency * dt * math.sqrt(max(1.0 - ratio * ratio, 0.0))
    lag = decay * (math.sin(turn) / turn if turn > 0.0 else 1.0)
    first = 1.0 - radius * (math.cos(turn) + lag)
    second = radius * (radius + lag - math.cos(turn))
    return first, second, -2.0 * radius * math.cos(turn), radius * radius


@_equation
def play(gap, reading, x):
    """Where the far side of a play of width ``gap`` comes to rest when its near side moves to x."""
    half = 0.5 * gap
    if x - half > reading:
        return x - half
    return x + half if x + half < reading else reading


class _TransmissionEffect(Effect):
    """An effect that splits the inertia; ``load_share`` of it is behind the transmission."""

    place = "transmission"
    port = "block"
    column_kind = "none"
    finest = 2.5e-4
    # a load without mass, or a motor without one, is one body; a load that the drive does not move is a spring
    essential: ClassVar[tuple[str, ...]] = ("load_share", "load_coulomb")

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 0.0 < self.shape["load_share"] < 1.0:
            raise ValueError(
                f"{type(self).__name__}: load_share is {self.shape['load_share']}, expected a share between 0 and 1."
            )


class Backlash(_TransmissionEffect):
    """Play between motor and load; the contact is stiff and damped, and can only push.

    T_c = k (d - clip(d, -b/2, b/2)) + c dd/dt (Nm) in contact, d = q_m - q_l; k and c follow from the frequency
    and the damping ratio of the two inertias in contact.  Dry friction of the load, F_l sign(v_l), brakes it while the
    play is crossed.

    See Also
    --------
    FlexibleCoupling : deflects in proportion to the torque; a heavily damped one resembles play.
    PreslidingHysteresis : friction that builds up over a distance, with one inertia.
    DeadZone : the drive is lost by its size, not over a distance.

    Examples
    --------
    >>> Backlash(0.002).labelled()
    {'gap_rad': 0.002, 'load_share': 0.5, 'frequency_hz': 60.0, 'damping_ratio': 0.3, 'load_coulomb_nm': 0.0}
    """

    gap: float = number(2e-3, "rad", 1e-5, 0.5, log=True, span=(1e-5, 0.5), starts=(1e-3, 3e-3, 1e-2, 3e-2))
    load_share: float = number(0.5, "1", 0.05, 0.95, starts=(0.45,))
    frequency: float = number(60.0, "Hz", 5.0, 1e3, log=True, scale="resonance", span=(0.1, 1.0), starts=(0.6,))
    damping_ratio: float = number(0.3, "1", 0.01, 1.5, starts=(0.15,))
    load_coulomb: float = number(0.0, "Nm", 0.0, 1e3, span=(0.0, 1.0), starts=(0.0,), open_below=True)

    name = "backlash"
    equation = "T_c = k (d - clip(d, -b/2, b/2)) + c dd/dt in contact, d = q_m - q_l; J_l dv_l/dt = T_c - F_l sign(v_l)"
    signature = "after a reversal the drive moves the motor alone until an impact"
    needs = "reversals under load"
    reference = "Nordin, Gutman 2002, Automatica 38(10), 1633-1649"
    finest = 1.25e-4  # an impact lasts a few steps
    code = codes.BACKLASH

    def implausible(self, seen: Surroundings) -> str:
        """The objection that the play is narrower than the encoder can show. ``seen``: see `Effect.implausible`."""
        return "the play is narrower than a step of the encoder" if self.gap < seen.step else ""


class LoadSideViscous(Effect, catalogued=False):
    """Viscous friction of the load behind a flexible coupling, c v_l (Nm).

    See Also
    --------
    Viscous : at the motor; the two differ at the resonance only.

    Examples
    --------
    >>> LoadSideViscous(0.5).value(velocity=-2.0)
    -1.0
    """

    coefficient: float = number(0.0, "Nm s/rad", 0.0, 1e3)

    name = "load_viscous"
    place = "transmission"
    equation = "c v_l"
    signature = "as viscous friction, and the resonance is damped"
    needs = "energy near the resonance"
    reference = "Spong 1987, ASME J. Dyn. Syst. Meas. Control 109(4), 310-319"
    code = codes.LOAD_VISCOUS


class FlexibleCoupling(_TransmissionEffect):
    """A spring between motor and load, T_c = (q_m - q_l) / C + c (v_m - v_l) (Nm).

    Dry friction of the load, F_l sign(v_l), lets the motor twist the spring of a load at rest.

    See Also
    --------
    Backlash : transmits nothing while the play is crossed, whatever the torque.
    InputDelay : the same phase below the resonance.

    Examples
    --------
    >>> FlexibleCoupling(0.001).labelled()
    {'compliance_rad_per_nm': 0.001, 'load_share': 0.5, 'damping_ratio': 0.03, 'load_coulomb_nm': 0.0}
    """

    compliance: float = number(
        1e-3, "rad/Nm", 1e-7, 1e1, log=True, span=(0.5, 1e4), starts=(2.25, 6.6, 20.0, 56.0, 165.0, 506.0)
    )
    load_share: float = number(0.5, "1", 0.05, 0.95, starts=(0.45,))
    damping_ratio: float = number(0.03, "1", 0.003, 1.0, starts=(0.06,), open_below=True)
    load_coulomb: float = number(0.0, "Nm", 0.0, 1e3, span=(0.0, 1.0), starts=(0.0,), open_below=True)

    name = "flexible_coupling"
    equation = (
        "T_c = (q_m - q_l) / C + c (v_m - v_l), c = 2 zeta sqrt(J_r / C), J_r = J_m J_l / J; "
        "J_l dv_l/dt = T_c - F_l sign(v_l)"
    )
    signature = "a resonance at a fixed frequency that the drive excites"
    needs = "energy near the resonance"
    reference = "Spong 1987, ASME J. Dyn. Syst. Meas. Control 109(4), 310-319"
    essential = (*_TransmissionEffect.essential, "damping_ratio")  # a coupling that does not ring is no spring
    code = codes.FLEXIBLE_COUPLING
