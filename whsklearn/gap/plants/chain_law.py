"""The law of a base chain: made from a name, with knots placed for x, and a check of whether orders and law suffice.

The error of a missing pole, or of a straight law in place of a curve, also follows the input, and the nearest effect of
the catalogue would be named for it.  So the base model is also fitted with one and two more poles and zeros in each
block, and with kinks in x and dx beside its law.  If that explains more than the effects found, the report says so.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from whsklearn.effects import FrictionLaw, Hinge, Power, StaticEffect, as_law
from whsklearn.gap.calibration import gain
from whsklearn.gap.plants.chain_fit import cost, polished, sharpened, weighed
from whsklearn.gap.plants.chain_model import HARD, SHARPEST, ChainModel, Record, simulate

if TYPE_CHECKING:
    from numpy.typing import NDArray

DEGREE, KNOTS = 3, 8  # unless the name gives a number
# Shares of the samples between which knots are placed.  Beyond them the curve is a straight line, and the capped fit
# treats samples that bend away from it as outliers; still further out a segment has too few samples for a slope.
REACH = (0.005, 0.995)
EXTRA = (1, 2)  # poles and zeros added to each block
SPOKEN_OF = 0.2  # share of the mean square that orders, or a law, must explain to be mentioned as the cause


@dataclass(frozen=True)
class LawChoice:
    """A law before its knots are placed by the data.

    Attributes
    ----------
    terms : tuple of StaticEffect
        The terms without knots.
    n_knots : int
        Number of kinks of a piecewise-linear curve in x; 0 for none.
    """

    terms: tuple[StaticEffect, ...]
    n_knots: int = 0

    @property
    def has_knots(self) -> bool:
        """Whether the law needs x to place its knots."""
        return self.n_knots > 0

    def first(self) -> FrictionLaw:
        """The law itself, or a cubic polynomial instead of a curve with knots, as it can be fitted from any start."""
        return FrictionLaw([*self.terms, *_powers(DEGREE)] if self.has_knots else self.terms)

    def placed(self, x: NDArray[np.float64]) -> FrictionLaw:
        """The law with its knots at the quantiles of x."""
        knots = np.unique(np.quantile(x, np.linspace(*REACH, self.n_knots)))
        return FrictionLaw([*self.terms, Power(1.0, 1.0), *(Hinge(0.0, float(k)) for k in knots)])


def law_choice(law: str | FrictionLaw | None) -> LawChoice:
    """A base law from names separated by commas: names of effects and of curves in x.

    ``linear`` is x, ``polynomial`` x, x^2, x^3 (``polynomial:5`` up to x^5), ``piecewise_linear`` a curve with 8 kinks
    at the quantiles of x (``piecewise_linear:12`` with 12), ``offset`` a constant.

    Raises
    ------
    ValueError
        If a name is not known, or no number follows a colon.

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
            raise ValueError(f"The law has {part!r}; expected a number from 1 to 40 after the colon.")
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


def with_knots(s: Record, m: ChainModel, choice: LawChoice) -> tuple[Record, list[ChainModel]]:
    """(record, [fitted model]) with the knots of the law at the quantiles of the model's x."""
    law = choice.placed(simulate(s, m)[0])
    dims = s.dims.copy()
    dims[4] = len(law)
    at = dataclasses.replace(s, law=law, dims=dims)
    _, b, weights, _, _ = s.blocks
    theta = weighed(at, m.theta[: b.stop], m.theta[weights.stop :])
    return at, [polished(at, sharpened(at, dataclasses.replace(m, theta=theta), (30.0, 300.0, SHARPEST), 15))]


def raised(s: Record, m: ChainModel, more: int) -> tuple[Record, ChainModel]:
    """(record, model) with ``more`` additional zeros in a, b, c and d: the same model with a higher order."""
    a, b, w, c, d = (m.theta[part] for part in s.blocks)
    zero = np.zeros(more)
    theta = np.concatenate([a, zero, b, zero, w, c, zero, d, zero])
    dims = s.dims + np.array([more, more, more, more, 0])
    return dataclasses.replace(s, dims=dims), dataclasses.replace(m, theta=theta)


def freed(s: Record, m: ChainModel) -> tuple[Record, ChainModel]:
    """(record, model) with kinks in x, all of weight zero, and a cubic beside its law."""
    x = simulate(s, m)[0]
    kinks = [Hinge(0.0, float(k)) for k in np.quantile(x, np.linspace(*REACH, KNOTS))]
    law = FrictionLaw([*s.law.terms, *(Power(0.0, float(k)) for k in range(1, DEGREE + 1)), *kinks])
    dims = s.dims.copy()
    dims[4] = len(law)
    cut = s.blocks[2].stop
    theta = np.concatenate([m.theta[:cut], np.zeros(len(law) - len(s.law)), m.theta[cut:]])
    return dataclasses.replace(s, dims=dims, law=law), dataclasses.replace(m, theta=theta)


def falls_short(s: Record, base: ChainModel, model: ChainModel) -> str:
    """Sentence on what the orders or law of the base model lack; empty if larger ones explain no more than the effects.

    Both explain the same record, so they are compared by n ln of the mean square residual, in which a common noise
    floor has no effect, with a penalty of ln n for each additional number (Schwarz 1978, Annals of Statistics 6(2),
    461-464).
    """

    def fitted(pair: tuple[Record, ChainModel]) -> tuple[Record, ChainModel, float]:
        at, m = pair
        m = sharpened(at, m, (10.0, *HARD), 10)
        return at, m, cost(at, m)

    n = float(s.fit.sum())

    def beats(other: tuple[Record, ChainModel, float]) -> bool:
        more = other[1].theta.size - base.theta.size - sum(t.kind.n_numbers for t in model.terms)
        return gain(cost(s, model), other[2], n) > more * np.log(n)

    value = cost(s, base)
    orders = min((fitted(raised(s, base, more)) for more in EXTRA), key=lambda f: f[2])
    law = fitted(freed(s, base))
    both = fitted(freed(*orders[:2]))
    if not any(map(beats, (orders, law, both))):
        return ""
    by_orders, by_law = 1.0 - orders[2] / value, 1.0 - law[2] / value
    parts = []
    if by_orders > SPOKEN_OF:
        before, after = (",".join(str(int(n)) for n in o[:4]) for o in (s.dims, orders[0].dims))
        parts.append(
            f"linear dynamics are missing: more poles and zeros alone take {100 * by_orders:.0f} % off the mean square "
            f"of the error (orders {before} were given; try {after})"
        )
    if by_law > SPOKEN_OF:
        parts.append(
            f"the law has another shape: free functions of x alone take {100 * by_law:.0f} % off it (give another law)"
        )
    if not parts:
        parts.append("orders and law together are too small")
    return "The base model itself falls short: " + "; ".join(parts) + ". No effect is named until that is corrected."
