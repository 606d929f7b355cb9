"""Models from input to output: a linear one, and a Wiener-Hammerstein chain L1, static law, L2."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from whsklearn.effects import Effect, FrictionLaw
from whsklearn.logs.units import UNKNOWN
from whsklearn.models.base import IdentifiedModel, as_input, numbered, per
from whsklearn.systems.wiener_hammerstein import WienerHammersteinSystem


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
        """b0 ..., f1 ..., offset; without the zeros of a `delay` beyond one sample."""
        b, f = np.array(self.numerator), np.array(self.denominator[1:])
        first = max(self.delay, 1)
        return {
            **numbered("b", b[:1]),
            **numbered("b", b[first:], first),
            **numbered("f", f, 1),
            "offset": float(self.offset),
        }

    @property
    def delay(self) -> int:
        """Samples before the output begins to answer: zeros at the beginning of the numerator.

        >>> LinearModel([0.0, 0.0, 0.5], [1.0, -0.5]).delay
        2
        """
        return int(next(iter(np.flatnonzero(self.numerator)), 0))

    def delayed(self, samples: int) -> LinearModel:
        """The same with a longer delay.

        ``samples``: to add to `delay`.

        Examples
        --------
        >>> LinearModel([0.0, 0.5], [1.0, -0.5], standard_errors={"b1": 0.1}).delayed(2).standard_errors
        {'b3': 0.1}
        """
        errors = {
            f"b{int(k[1:]) + samples}" if k[0] == "b" and k != "b0" else k: v for k, v in self.standard_errors.items()
        }
        numerator = (*self.numerator[:1], *[0.0] * samples, *self.numerator[1:])
        return dataclasses.replace(self, numerator=numerator, standard_errors=errors)

    @property
    def parameter_units(self) -> dict[str, str]:
        """SI units: b converts the input to the output, or to its rate if the output is a position."""
        into, out = self.si
        rate = f"{out}/s" if self.logged == "position" else out
        known = UNKNOWN not in self.si
        kinds = {"b": per(rate, into) if known else UNKNOWN, "f": "1"}
        return {k: kinds.get(k[0], rate if known else UNKNOWN) for k in self.parameters}

    def simulate(self, u: ArrayLike, *, start: float = 0.0) -> NDArray[np.float64]:
        from scipy.signal import lfilter

        by, far = self.factors
        y = (lfilter(self.numerator, self.denominator, as_input(u) * by) + self.offset) / far
        return start + np.cumsum(y) * self.dt if self.logged == "position" else y


# The unit of a weight is that of the output over that of x or dx to this power; 0: the output's unit
_POWERS = {
    "viscous": 1, "asymmetric_viscous": 1, "hinge": 1, "speed_hinge": 1, "quadratic_drag": 2, "natural_spline": 2,
}  # fmt: skip


@dataclass(frozen=True)
class ChainModel(IdentifiedModel):
    """x = b1/f1 u, v = law(x, dx), y = b2/f2 v; all polynomials start with the direct path.

    ``b1[0]`` multiplies u(t) itself, so a block with a delay begins with zeros; ``f1`` and
    ``f2`` begin with 1.

    Parameters
    ----------
    b1, f1 : tuple of float
        Numerator and denominator of the first block.
    law : FrictionLaw
        Static law between the two blocks.
    b2, f2 : tuple of float
        Numerator and denominator of the second block.
    effects : tuple of Effect
        Effects at the ports of the chain.
    dt, units, logged, standard_errors
        As for `IdentifiedModel`.

    References
    ----------
    Paper, (1) and (2); Giri and Bai (eds.) 2010, Block-oriented Nonlinear System Identification, Springer.

    Examples
    --------
    >>> from whsklearn.effects import Effect, FrictionLaw, Power
    >>> from whsklearn.models import ChainModel
    >>> ChainModel([0.0, 1.0], [1.0], FrictionLaw([Power(2.0, 2.0)]), [1.0], [1.0]).simulate([3.0, 0.0]).tolist()
    [0.0, 18.0]
    """

    b1: tuple[float, ...]
    f1: tuple[float, ...]
    law: FrictionLaw
    b2: tuple[float, ...]
    f2: tuple[float, ...]
    effects: tuple[Effect, ...] = ()
    kind: ClassVar[str] = "wiener-hammerstein"

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("b1", "f1", "b2", "f2"):
            object.__setattr__(self, name, tuple(float(v) for v in getattr(self, name)))
        for name in ("f1", "f2"):
            if not getattr(self, name) or getattr(self, name)[0] != 1.0:
                raise ValueError(f"{name} is {getattr(self, name)}, expected it to begin with 1; divide by its first.")
        object.__setattr__(self, "effects", tuple(self.effects))
        if self.effects:
            self.system()  # raises if the chain cannot be simulated

    def system(self) -> WienerHammersteinSystem:
        """The chain as `WienerHammersteinSystem`, whose blocks begin with one, after a delay or as a direct path."""
        numerators = []
        for name, b in (("b1", self.b1), ("b2", self.b2)):
            if b[:2] != (0.0, 1.0) and b[:1] != (1.0,):
                raise ValueError(
                    f"{name} is {b}, expected it to begin with 1, or with 0, 1; a chain with effects needs this."
                )
            numerators.append(b if b[0] else b[1:])
        return WienerHammersteinSystem(
            numerators[0],
            self.f1[1:],
            numerators[1],
            self.f2[1:],
            self.law,
            effects=self.effects,
            dt=self.dt,
            direct=sum(b[0] == 1.0 for b in (self.b1, self.b2)),
        )

    @property
    def parameters(self) -> dict[str, float]:
        """b1_0 ..., f1_1 ..., the law's weights by label, b2_0 ..., f2_1 ..."""
        weights = dict(zip(self.law.labels, self.law.weights.tolist(), strict=True))
        first = {**numbered("b1_", np.array(self.b1)), **numbered("f1_", np.array(self.f1[1:]), 1)}
        return {**first, **weights, **numbered("b2_", np.array(self.b2)), **numbered("f2_", np.array(self.f2[1:]), 1)}

    @property
    def parameter_units(self) -> dict[str, str]:
        """SI units: the blocks are dimensionless, and the law converts the input's unit to the output's.

        If the output is a position, the law gives its rate.  dx is a difference of samples, without a unit of time.
        """
        into, out = self.si
        if self.logged == "position":
            out = f"{out}/s"
        known = UNKNOWN not in self.si
        units = dict.fromkeys(self.parameters, "1")
        powers = (int(t.shape["degree"]) if t.name == "power" else _POWERS.get(t.name, 0) for t in self.law.terms)
        return units | {
            k: per(out, into, n) if known else UNKNOWN for k, n in zip(self.law.labels, powers, strict=True)
        }

    def signals(self, u: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """x, v and y before any integration, each of shape (n,), in SI. ``u`` (n,): input in SI."""
        from scipy.signal import lfilter

        if self.effects:
            s = self.system().signals(as_input(u))
            return s.x, s.v, s.y
        x = lfilter(self.b1, self.f1, as_input(u))
        v = self.law(x, np.diff(x, prepend=0.0))
        return x, v, lfilter(self.b2, self.f2, v)

    def simulate(self, u: ArrayLike, *, start: float = 0.0) -> NDArray[np.float64]:
        by, far = self.factors
        y = self.signals(as_input(u) * by)[2] / far
        return start + np.cumsum(y) * self.dt if self.logged == "position" else y
