"""What a number of an effect means: its unit and its plausible range."""

from __future__ import annotations

import re
from dataclasses import dataclass


@dataclass(frozen=True)
class Quantity:
    """A parameter of an effect: its unit on a rotary axis and its plausible range.

    Parameters
    ----------
    unit : str
        Unit on a rotary axis (``"Nm"``, ``"rad/s"``, ``"1"``).  A linear axis reads
        N for Nm and m for rad; a Wiener-Hammerstein system, the units of its log.
    low, high : float
        Plausible range on real axes, inclusive; used to reject a fit, to draw tests.
    log : bool
        Whether the range is spanned in ratios rather than in differences.
    """

    unit: str
    low: float
    high: float
    log: bool = False

    def labelled(self, name: str) -> str:
        """The name with the unit appended, in the letters of a column: ``torque_nm``.

        Examples
        --------
        >>> Quantity("rad/s", 0, 1).labelled("velocity")
        'velocity_rad_per_s'
        """
        unit = re.sub(r"[^a-z0-9]+", "_", self.unit.lower().replace("/", " per ")).strip("_")
        return name if self.unit == "1" else f"{name}_{unit}"
