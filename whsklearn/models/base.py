"""What every identified model knows about itself: sampling, units, which signal it answers with, intervals."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray


@dataclass(frozen=True, kw_only=True)
class IdentifiedModel:
    """Fields that all kinds of model share.

    Parameters
    ----------
    dt : float
        Sampling time (s); 1.0 where the log had no time stamps.
    units : mapping of str to str
        Of ``input`` and ``output``, as logged.
    logged : {"output", "velocity", "position"}
        What the logged output is.  A model of ``position`` was fitted to its velocity, and its
        `simulate` integrates; ``output`` says nothing about it.
    standard_errors : mapping of str to float
        Of the `parameters`, by name; those without one are left out.

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
        """All identified numbers by name."""
        raise NotImplementedError

    @property
    def parameter_units(self) -> dict[str, str]:
        """Units of `parameters`; those without one are left out."""
        return {}

    def simulate(self, u: ArrayLike, *, start: float = 0.0) -> NDArray[np.float64]:
        """Output (n,) in the logged unit, from the input (n,) alone, at rest before its first sample.

        Parameters
        ----------
        u : array-like of shape (n,)
            Input in the unit of the log.
        start : float, default=0.0
            Where it rests, if the output is a position: gravity and cogging are another there.
        """
        raise NotImplementedError


def as_input(u: ArrayLike) -> NDArray[np.float64]:
    """The input as a contiguous vector; refuses what is not finite."""
    signal = np.ascontiguousarray(np.asarray(u, dtype=float).reshape(-1))
    if not np.isfinite(signal).all():
        raise ValueError("The input holds NaN or infinity, expected finite numbers; clean the log.")
    return signal


def numbered(name: str, values: NDArray[np.float64], first: int = 0) -> dict[str, float]:
    """Coefficients by name and index, such as b1, b2."""
    return {f"{name}{i}": float(v) for i, v in enumerate(values, start=first)}
