"""Laws in x by name (polynomial, piecewise linear, cubic spline) and the placement of their knots.

The knots of a named law suit an x of unit deviation; a fit that knows x places them again with `placed`.
"""

from __future__ import annotations

import numpy as np

from whsklearn.effects.base import Array
from whsklearn.effects.friction import StaticEffect
from whsklearn.effects.static import Hinge, NaturalSpline, Power

N_KNOTS = 12  # 0.276 mV on the benchmark, the same as with 20; 8 leave 0.451 (cubic spline)
N_KINKS = 30  # a piecewise-linear law needs this many for the same error: 12 leave 0.523 mV, 20 leave 0.314
SPREAD = 3.0  # deviations
MOST = 40  # kinks or degrees that a name may ask for


DEGREE = 3  # of a polynomial


def static_terms(name: str) -> tuple[StaticEffect, ...] | None:
    """The terms of a named law in x; None for any other name.

    ``linear``, ``offset``, ``polynomial`` (with offset; ``polynomial:5`` up to the fifth degree), ``piecewise_linear``
    (``piecewise_linear:12`` with 12 kinks), ``cubic_spline`` (``cubic_spline:8`` with 8 knots).

    Raises ValueError if what follows a colon is no number from 1 to 40, or fewer than the 3 knots of a spline.
    """
    kind, colon, number = name.partition(":")
    least = 3 if kind == "cubic_spline" else 1
    if colon and not (number.isdigit() and least <= int(number) <= MOST):
        raise ValueError(f"The law has {name!r}; expected a number from {least} to {MOST} after the colon.")
    if name == "linear":
        return (Power(1.0, 1),)
    if name == "offset":
        return (Power(0.0, 0),)
    if kind == "polynomial":
        return tuple(Power(float(k == 1), k) for k in range(int(number or DEGREE) + 1))
    if kind == "piecewise_linear":
        return piecewise_linear_terms(np.linspace(-SPREAD, SPREAD, int(number or N_KINKS)))
    if kind == "cubic_spline":
        return spline_terms(np.linspace(-SPREAD, SPREAD, int(number or N_KNOTS)))
    return None


def has_knots(terms: tuple[StaticEffect, ...]) -> bool:
    """Whether some of the terms have knots, whose places follow from x."""
    return any(isinstance(t, Hinge | NaturalSpline) for t in terms)


def spline_terms(knots: Array) -> tuple[StaticEffect, ...]:
    """Constant, x and a `NaturalSpline` for each knot but the last two; initially v = x."""
    ends = float(knots[-2]), float(knots[-1])
    return (Power(0.0, 0), Power(1.0, 1), *(NaturalSpline(0.0, float(k), *ends) for k in knots[:-2]))


def piecewise_linear_terms(knots: Array) -> tuple[StaticEffect, ...]:
    """Constant, x and a `Hinge` for each knot; initially v = x."""
    return (Power(0.0, 0), Power(1.0, 1), *(Hinge(0.0, float(k)) for k in knots))


def place_knots(x: Array, count: int) -> Array:
    """Knots for a law over these values: half at quantiles, half evenly spaced over the 0.05 to 99.95 % range.

    Quantiles alone would leave none at the ends, where a saturation is; an even grid alone would waste most knots where
    there is no data.

    ``x`` (n,): values that the law meets. ``count``: number of knots, 3 or more. Returns (count,): increasing, even
    where values repeat.
    """
    low, high = np.quantile(x, [0.0005, 0.9995])
    if not high > low:
        low, high = low - 1.0, high + 1.0
    inner = count // 2
    grid = np.linspace(low, high, count - inner)
    at = np.quantile(x, (np.arange(inner) + 0.5) / inner)
    knots = np.sort(np.concatenate([grid, np.clip(at, low, high)]))
    least = 0.1 * (high - low) / count  # closer knots make the basis functions nearly equal
    for i in range(1, count):
        knots[i] = max(knots[i], knots[i - 1] + least)
    return low + (knots - knots[0]) * (high - low) / (knots[-1] - knots[0])


def placed(terms: tuple[StaticEffect, ...], x: Array) -> tuple[StaticEffect, ...]:
    """The same terms with the knots of hinges and splines placed for these x; other terms are unchanged."""
    spline = [t for t in terms if isinstance(t, NaturalSpline)]
    hinges = [t for t in terms if isinstance(t, Hinge)]
    others = [t for t in terms if not isinstance(t, (NaturalSpline, Hinge))]
    if spline:
        knots = place_knots(x, len(spline) + 2)
        others += [NaturalSpline(0.0, float(k), float(knots[-2]), float(knots[-1])) for k in knots[:-2]]
    if hinges:
        others += [Hinge(0.0, float(k)) for k in place_knots(x, max(len(hinges), 3))[: len(hinges)]]
    return tuple(others)
