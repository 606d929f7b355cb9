"""The law of a base chain from its name: friction terms, a line, a polynomial, a piecewise-linear curve, an offset."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from whsklearn.effects import FrictionLaw, Hinge, Power, StaticEffect, as_law

if TYPE_CHECKING:
    from numpy.typing import NDArray

DEGREE, KNOTS = 3, 8  # where the name gives none
# shares of the samples between which knots lie: beyond, the curve is a line, and samples that bend away from it pass
# for outliers of the capped fit; still further out a segment has too few samples for a slope
REACH = (0.005, 0.995)


@dataclass(frozen=True)
class LawChoice:
    """What a law is made of before the data say where its knots are.

    Attributes
    ----------
    terms : tuple of StaticEffect
        Those without knots.
    n_knots : int
        Kinks of a piecewise-linear curve in x; 0 for none.
    """

    terms: tuple[StaticEffect, ...]
    n_knots: int = 0

    @property
    def has_knots(self) -> bool:
        """Whether the law needs an x to be complete."""
        return self.n_knots > 0

    def first(self) -> FrictionLaw:
        """The law itself, or a cubic polynomial in the place of a curve with knots: it fits from any start."""
        return FrictionLaw([*self.terms, *_powers(DEGREE)] if self.has_knots else self.terms)

    def placed(self, x: NDArray[np.float64]) -> FrictionLaw:
        """The law with its knots at the quantiles of x."""
        knots = np.unique(np.quantile(x, np.linspace(*REACH, self.n_knots)))
        return FrictionLaw([*self.terms, Power(1.0, 1.0), *(Hinge(0.0, float(k)) for k in knots)])


def law_choice(law: str | FrictionLaw | None) -> LawChoice:
    """A base law from names joined by commas: those of effects, and the curves in x.

    ``linear`` is x, ``polynomial`` x, x^2, x^3 (``polynomial:5`` up to x^5), ``piecewise_linear`` a curve with 8 kinks
    at the quantiles of x (``piecewise_linear:12`` with 12), ``offset`` a constant.

    Raises
    ------
    ValueError
        If a name is not known, or a number behind a colon is none.

    Examples
    --------
    >>> law_choice("linear,offset,coulomb").first().labels
    ('x1', 'x0', 'coulomb')
    >>> law_choice("piecewise_linear:4").placed(np.linspace(-1, 1, 101)).labels
    ('x1', 'hinge1', 'hinge2', 'hinge3', 'hinge4')
    """
    if not isinstance(law, str):
        return LawChoice(as_law(law).terms)
    terms: list[StaticEffect] = []
    n_knots = 0
    for part in (p.strip() for p in law.split(",")):
        name, _, number = part.partition(":")
        if number and (not number.isdigit() or not 1 <= int(number) <= 40):
            raise ValueError(f"The law has {part!r}; expected a number from 1 to 40 behind the colon.")
        if name == "linear":
            terms.append(Power(1.0, 1.0))
        elif name == "offset":
            terms.append(Power(1.0, 0.0))
        elif name == "polynomial":
            terms += _powers(int(number) if number else DEGREE)
        elif name == "piecewise_linear":
            n_knots = int(number) if number else KNOTS
        elif part:
            try:
                terms += as_law(part).terms
            except ValueError as error:
                raise ValueError(
                    f"{error} A chain also takes linear, polynomial, piecewise_linear and offset."
                ) from None
    if not terms and not n_knots:
        raise ValueError("The law is empty; name at least one term, such as linear or viscous.")
    return LawChoice(tuple(terms), n_knots)


def _powers(degree: int) -> list[StaticEffect]:
    return [Power(1.0, float(k)) for k in range(1, degree + 1)]


def is_line(law: FrictionLaw) -> bool:
    """Whether a law is a line in x, with or without an offset."""
    return all(isinstance(t, Power) and t.degree <= 1 for t in law.terms)


def bent(law: FrictionLaw, name: str, size: float) -> FrictionLaw:
    """A line in x with a saturation or a dead zone of x, as a law of its own.

    clip(x, -L, L) = max(x + L, 0) - max(x - L, 0) - L.

    Examples
    --------
    >>> law = bent(law_choice("linear").first(), "saturation", 0.5)
    >>> law(x=[-2.0, 0.25, 2.0], dx=0.0).tolist()
    [-0.5, 0.25, 0.5]
    """
    slope = sum(t.magnitude for t in law.terms if isinstance(t, Power) and t.degree == 1)
    level = sum(t.magnitude for t in law.terms if isinstance(t, Power) and t.degree == 0)
    sign = 1.0 if name == "saturation" else -1.0
    clip = [Hinge(sign * slope, -size), Hinge(-sign * slope, size), Power(level - sign * slope * size, 0.0)]
    return FrictionLaw(clip if name == "saturation" else [Power(slope, 1.0), *clip])
