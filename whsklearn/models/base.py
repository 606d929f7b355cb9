"""What all identified models have in common: sampling time, units, the kind of output, and standard errors."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from whsklearn.logs.errors import LogError
from whsklearn.logs.units import UNKNOWN, UNSTATED, factor_between, factor_of

_ROLES = {"input": "drive", "output": "position"}


@dataclass(frozen=True, kw_only=True)
class IdentifiedModel:
    """Fields shared by all kinds of model.

    Parameters
    ----------
    dt : float
        Sampling time (s); 1.0 if the log had no time stamps.
    units : mapping of str to str
        Units of the input and output of `simulate`, as logged, with the keys ``input`` and ``output``.  A missing unit
        is unknown, and SI is assumed.  The parameters are in SI whatever the units of the columns, see
        `parameter_units`.
    logged : {"output", "velocity", "position"}
        The quantity that was logged as output.  A model of ``position`` was fitted to its velocity, and its
        `simulate` integrates; with ``output`` the quantity is not specified.
    standard_errors : mapping of str to float
        Standard errors of the `parameters`, by name; parameters without one are omitted.

    References
    ----------
    Ljung 1999, System Identification: Theory for the User, 2nd ed., Prentice Hall, sec. 4.5 on model sets.

    Examples
    --------
    What `load_model` reads is one of the three kinds:

    >>> from whsklearn.models import AxisModel, ChainModel, IdentifiedModel, LinearModel
    >>> [issubclass(kind, IdentifiedModel) for kind in (AxisModel, ChainModel, LinearModel)]
    [True, True, True]
    """

    dt: float = 1.0
    units: Mapping[str, str] = field(default_factory=dict)
    logged: str = "output"
    standard_errors: Mapping[str, float] = field(default_factory=dict)

    @property
    def kind(self) -> str:
        """Name of this kind of model in files and tables."""
        raise NotImplementedError

    def __post_init__(self) -> None:
        if not (np.isfinite(self.dt) and self.dt > 0):
            raise ValueError(f"dt is {self.dt!r}, expected a sampling time above zero in s.")
        if self.logged not in ("output", "velocity", "position"):
            raise ValueError(f"logged is {self.logged!r}, expected 'output', 'velocity' or 'position'.")

    @property
    def parameters(self) -> dict[str, float]:
        """All identified parameters by name."""
        raise NotImplementedError

    @property
    def parameter_units(self) -> dict[str, str]:
        """The SI unit of each of `parameters`: ``1`` for a bare number, ``as logged`` if the log states no units."""
        raise NotImplementedError

    @property
    def factors(self) -> tuple[float, float]:
        """The factors that convert the columns of input and output to SI."""
        return factor_of(self.units.get("input", UNKNOWN))[0], factor_of(self.units.get("output", UNKNOWN))[0]

    @property
    def si(self) -> tuple[str, str]:
        """SI symbols of the columns of input and output."""
        return factor_of(self.units.get("input", UNKNOWN))[1], factor_of(self.units.get("output", UNKNOWN))[1]

    def column_factor(self, column: str, unit: str) -> float:
        """The factor that converts a signal in ``unit`` to the unit of `simulate`'s ``column``, "input" or "output".

        If the unit is unknown, the model's is assumed. Raises ValueError if it is a unit of another quantity than the
        model's column, such as A where the model has Nm.

        Examples
        --------
        >>> from whsklearn.models import LinearModel
        >>> LinearModel([0.0, 0.5], [1.0], units={"input": "Nm", "output": "deg"}).column_factor("input", "mNm")
        0.001
        """
        known = self.units.get(column, UNKNOWN)
        if {unit, known} & UNSTATED:
            return 1.0
        try:
            return factor_between(unit, known)
        except ValueError:
            raise LogError(
                f"The {column} of the log is in {unit}, that of the model in {known}, and one cannot be converted to "
                f"the other; give a log of the same quantity, or state the unit with --unit {_ROLES[column]}=UNIT."
            ) from None

    def simulate(self, u: ArrayLike, *, start: float = 0.0) -> NDArray[np.float64]:
        """Output (n,) in its unit, from the input (n,) alone, starting at rest before the first sample.

        ``u`` (n,): input in ``units``. ``start``: initial position, in ``units``, if the output is a position; gravity
        and cogging depend on it.
        """
        raise NotImplementedError


def as_input(u: ArrayLike) -> NDArray[np.float64]:
    """The input as a contiguous vector; raises if values are not finite."""
    signal = np.ascontiguousarray(np.asarray(u, dtype=float).reshape(-1))
    if not np.isfinite(signal).all():
        raise ValueError("The input holds NaN or infinity, expected finite numbers; clean the log.")
    return signal


def per(unit: str, by: str, power: int = 1) -> str:
    """A unit divided by a power of another one, with at most one slash.

    >>> per("rad", "A"), per("rad/s", "Nm", 2), per("rad/s", "V", 0)
    ('rad/A', 'rad/(s Nm2)', 'rad/s')
    """
    if not power:
        return unit
    above, _, below = unit.partition("/")
    under = f"{below} {by}{power if power > 1 else ''}".strip()
    return f"{above}/({under})" if " " in under else f"{above}/{under}"


def numbered(name: str, values: NDArray[np.float64], first: int = 0) -> dict[str, float]:
    """Coefficients by name and index, such as b1, b2."""
    return {f"{name}{i}": float(v) for i, v in enumerate(values, start=first)}
