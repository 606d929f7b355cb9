"""Effects between motor and load: they split the one inertia in two."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from whsklearn.effects import codes
from whsklearn.effects.base import Effect
from whsklearn.effects.quantity import Quantity

_SHARE = Quantity("1", 0.05, 0.95)


@dataclass(frozen=True)
class TransmissionEffect(Effect):
    """An effect that splits the inertia; ``load_share`` of it is behind the transmission."""

    place: ClassVar[str] = "transmission"
    port: ClassVar[str] = "block"
    column_kind: ClassVar[str] = "none"

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 0.0 < self.shape["load_share"] < 1.0:
            raise ValueError(
                f"{type(self).__name__}: load_share is {self.shape['load_share']}, expected a share between 0 and 1."
            )


@dataclass(frozen=True)
class Backlash(TransmissionEffect):
    """Play between motor and load; the contact is stiff and damped, and it only pushes."""

    gap: float = 2e-3
    load_share: float = 0.5
    frequency: float = 60.0
    damping_ratio: float = 0.3

    name: ClassVar[str] = "backlash"
    equation: ClassVar[str] = "T_c = k (d - clip(d, -b/2, b/2)) + c dd/dt in contact, d = q_m - q_l"
    size: ClassVar[str] = "gap"
    quantities: ClassVar[dict[str, Quantity]] = {
        "gap": Quantity("rad", 1e-5, 0.1, log=True),
        "load_share": _SHARE,
        "frequency": Quantity("Hz", 5.0, 1e3, log=True),
        "damping_ratio": Quantity("1", 0.0, 1.0),
    }
    signature: ClassVar[str] = "after a reversal the load lets go: the drive moves the motor alone, then an impact"
    needs: ClassVar[str] = "reversals under load"
    reference: ClassVar[str] = "Nordin, Gutman 2002, Automatica 38(10), 1633-1649"
    code: ClassVar[int] = codes.BACKLASH


@dataclass(frozen=True)
class FlexibleCoupling(TransmissionEffect):
    """A spring between motor and load."""

    compliance: float = 1e-3
    load_share: float = 0.5
    damping_ratio: float = 0.03

    name: ClassVar[str] = "flexible_coupling"
    equation: ClassVar[str] = "T_c = (q_m - q_l) / C + c (v_m - v_l), c = 2 zeta sqrt(J_r / C), J_r = J_m J_l / J"
    size: ClassVar[str] = "compliance"
    quantities: ClassVar[dict[str, Quantity]] = {
        "compliance": Quantity("rad/Nm", 1e-7, 1e1, log=True),
        "load_share": _SHARE,
        "damping_ratio": Quantity("1", 0.0, 0.5),
    }
    signature: ClassVar[str] = "a resonance at a fixed frequency that the drive excites"
    needs: ClassVar[str] = "energy near the resonance"
    reference: ClassVar[str] = "Spong 1987, ASME J. Dyn. Syst. Meas. Control 109(4), 310-319"
    code: ClassVar[int] = codes.FLEXIBLE_COUPLING
