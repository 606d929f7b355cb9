"""A linear model: a ratio of polynomials in the delay operator."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from whsklearn.logs.units import UNKNOWN
from whsklearn.models.base import IdentifiedModel, as_input, numbered, per


@dataclass(frozen=True)
class LinearModel(IdentifiedModel):
    """y(t) = (b0 + b1 q^-1 + ...) / (1 + f1 q^-1 + ...) u(t) + offset.

    Parameters
    ----------
    numerator, denominator : sequences of float
        Coefficients of b and of f; the denominator begins with 1.
    offset : float, default=0.0
        Constant of the output.
    criterion : {"simulation", "prediction"}
        The error that was minimised: of the free run (``output_error``), or one step ahead (``arx``).

    References
    ----------
    Ljung 1999, System Identification, 2nd ed., sec. 4.2, ARX and output-error structures.

    Examples
    --------
    >>> from whsklearn.models import LinearModel
    >>> LinearModel([0.0, 0.5], [1.0, -0.5]).simulate([1.0, 1.0, 1.0]).tolist()
    [0.0, 0.5, 0.75]
    """

    numerator: tuple[float, ...]
    denominator: tuple[float, ...]
    offset: float = 0.0
    criterion: str = "simulation"

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("numerator", "denominator"):
            object.__setattr__(self, name, tuple(float(v) for v in getattr(self, name)))
        if not self.denominator or self.denominator[0] != 1.0:
            raise ValueError(f"denominator is {self.denominator}, expected it to begin with 1; divide by its first.")
        if self.criterion not in ("simulation", "prediction"):
            raise ValueError(f"criterion is {self.criterion!r}, expected 'simulation' or 'prediction'.")

    @property
    def kind(self) -> str:
        """``output_error`` or ``arx``."""
        return "output_error" if self.criterion == "simulation" else "arx"

    @property
    def parameters(self) -> dict[str, float]:
        """b0 ..., f1 ..., offset."""
        b, f = np.array(self.numerator), np.array(self.denominator[1:])
        return {**numbered("b", b), **numbered("f", f, 1), "offset": float(self.offset)}

    @property
    def parameter_units(self) -> dict[str, str]:
        """SI units: b converts the input to the output, or to its rate if the output is a position."""
        into, out = self.si
        rate = f"{out}/s" if self.logged == "position" else out
        known = UNKNOWN not in self.si
        kinds = {"b": per(rate, into) if known else UNKNOWN, "f": "1"}
        return {k: kinds.get(k[0], rate if known else UNKNOWN) for k in self.parameters}

    def from_logged(self) -> LinearModel:
        by, far = self.factors
        scale = {"b": far / by, "f": 1.0}
        errors = {k: v * scale.get(k[0], far) for k, v in self.standard_errors.items()}
        b = tuple(v * far / by for v in self.numerator)
        return dataclasses.replace(self, numerator=b, offset=self.offset * far, standard_errors=errors)

    def simulate(self, u: ArrayLike, *, start: float = 0.0) -> NDArray[np.float64]:
        from scipy.signal import lfilter

        by, far = self.factors
        y = (lfilter(self.numerator, self.denominator, as_input(u) * by) + self.offset) / far
        return start + np.cumsum(y) * self.dt if self.logged == "position" else y
