"""A friction law: a sum of static terms, linear in their weights.

Laws (3) and (4) of the paper, Coulomb plus viscous, a polynomial or a piecewise-linear
characteristic are all this one sum, so one estimator and one simulator serve them all.

The knots of a law in x that is given by name (polynomial, piecewise linear, cubic spline) suit an x of unit deviation;
a fit that knows x places them again with `placed`.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from whsklearn.effects.base import ArgumentError, Array, get_effect
from whsklearn.effects.codes import N_SHAPE
from whsklearn.effects.friction import Coulomb, ReducedStribeck, StaticEffect, Viscous
from whsklearn.effects.rows import law_values
from whsklearn.effects.static import Hinge, NaturalSpline, Power, Tanh, TanhDifference

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
        raise ArgumentError(f"The law has {name!r}; expected a number from {least} to {MOST} after the colon.")
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
        # a kink at an end of x has no samples behind it, which would tell the slope there
        others += [Hinge(0.0, float(k)) for k in place_knots(x, len(hinges) + 2)[1:-1]]
    return tuple(others)


def without_knots(law: FrictionLaw) -> FrictionLaw:
    """The law, with a cubic in place of knots: that can be fitted from any start, and knows no x that places them."""
    if not has_knots(law.terms):
        return law
    return FrictionLaw([*(t for t in law.terms if not has_knots((t,))), Power(0.0, 2), Power(0.0, 3)])


class FrictionLaw:
    """v = sum of w_k f_k(x, dx), with dx = x(t) - x(t-1).

    Parameters
    ----------
    terms : iterable of StaticEffect
        The terms; the magnitude of each is its weight.

    Attributes
    ----------
    labels : tuple of str
        One name per weight, numbered if a kind of term recurs; powers are x0, x1, x2, ...
    codes, shapes, weights : ndarray of shape (n_terms,), (n_terms, 3), (n_terms,)
        The law as the compiled kernels take it.

    References
    ----------
    Paper, (3) and (4).

    Examples
    --------
    >>> from whsklearn.effects import FrictionLaw, Viscous, Coulomb
    >>> law = FrictionLaw([Viscous(0.05), Coulomb(0.7)])
    >>> law.labels
    ('viscous', 'coulomb')
    >>> float(law(x=0.0, dx=2.0).round(6))
    0.8
    """

    def __init__(self, terms: Iterable[StaticEffect]):
        self.terms = tuple(terms)
        if not self.terms:
            raise ArgumentError("The friction law has no terms; give at least one, such as Viscous().")
        for t in self.terms:
            if not isinstance(t, StaticEffect):
                raise ArgumentError(
                    f"{t!r} cannot be a term of a friction law: expected a memoryless effect such as Coulomb()."
                )
        names = [f"x{int(t.degree)}" if isinstance(t, Power) else t.name for t in self.terms]
        self.labels = tuple(n if names.count(n) == 1 else f"{n}{names[: i + 1].count(n)}" for i, n in enumerate(names))
        self.codes = np.array([t.code for t in self.terms], dtype=np.int64)
        self.shapes = np.zeros((len(self.terms), N_SHAPE))
        for row, t in zip(self.shapes, self.terms, strict=True):
            row[: len(t.term_shape)] = t.term_shape
        self.weights = np.array([t.magnitude for t in self.terms])

    @property
    def key(self) -> int | None:
        """Index of the first term that is linear in x or dx, the key term of (5); None without one."""
        for i, t in enumerate(self.terms):
            if isinstance(t, Viscous) or (isinstance(t, Power) and t.degree == 1):
                return i
        return None

    def __len__(self) -> int:
        return len(self.terms)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, FrictionLaw) and self.terms == other.terms

    def __hash__(self) -> int:
        return hash(self.terms)

    def __repr__(self) -> str:
        return f"FrictionLaw({list(self.terms)!r})"

    def __call__(self, x: ArrayLike, dx: ArrayLike, kappa: float = np.inf) -> NDArray[np.float64]:
        """The law's value at x and dx (broadcast against each other)."""
        return self.regressors(x, dx, kappa) @ self.weights

    def regressors(self, x: ArrayLike, dx: ArrayLike, kappa: float = np.inf) -> NDArray[np.float64]:
        """Every term at weight one, stacked along a new last axis.

        ``x``, ``dx`` (n,): signal and its change, x(t) - x(t-1). ``kappa``: sign(dx) is tanh(kappa dx).
        """
        x, dx = np.broadcast_arrays(np.asarray(x, dtype=float), np.asarray(dx, dtype=float))
        values = law_values(self.codes, self.shapes, x.ravel(), dx.ravel(), float(kappa))
        return np.ascontiguousarray(values.T).reshape(*x.shape, len(self))

    def reweighted(self, weights: Sequence[float] | NDArray[np.float64]) -> FrictionLaw:
        """The same terms with other weights. ``weights``: one per term, in the unit of y."""
        return FrictionLaw([t.resized(float(w)) for t, w in zip(self.terms, weights, strict=True)])


def flat_parameters(parameters: Mapping[str, Any]) -> dict[str, float]:
    """One number a name, in the order of the chain: L1, friction, L2; a[0] = c[0] = 1 are left out.

    ``parameters``: such as ``parameters_`` of an estimator. With several inputs ``a2_1`` is a_2 of the first.

    Examples
    --------
    >>> flat_parameters({"a": [1.0, 2.2], "b": [1.0], "c": [1.0], "d": [0.4], "coulomb": 0.7})
    {'a2': 2.2, 'b1': 1.0, 'coulomb': 0.7, 'd1': 0.4}
    """
    blocks: dict[str, dict[str, float]] = {
        k: {
            k + "_".join(str(i + 1) for i in at): float(w)
            for at, w in np.ndenumerate(np.atleast_1d(parameters.get(k, ())))
            if not (k in "ac" and not any(at))
        }
        for k in "abcd"
    }
    law = {k: float(v) for k, v in parameters.items() if k not in blocks and np.ndim(v) == 0}
    return blocks["a"] | blocks["b"] | law | blocks["c"] | blocks["d"]


def reduced_law(viscous: float = 0.05, coulomb: float = 0.7, stribeck: float = 0.2) -> FrictionLaw:
    """Law (4): gamma_6 dx + beta_1 sign(dx) - beta_2 tanh(dx); Example 5.1's values by default.

    ``viscous``, ``coulomb``, ``stribeck``: gamma_6 (y per x), beta_1 and beta_2 (in the unit of y).

    Examples
    --------
    >>> from whsklearn.effects import reduced_law
    >>> reduced_law().weights.tolist()
    [0.05, 0.7, 0.2]
    """
    return FrictionLaw([Viscous(viscous), Coulomb(coulomb), ReducedStribeck(stribeck)])


def smooth_law(gamma: Sequence[float]) -> FrictionLaw:
    """Law (3) from its six positive parameters gamma_1 ... gamma_6.

    ``gamma``: gamma_1 and gamma_4 in the unit of y, gamma_6 in y per x, the others in 1 per x.

    Examples
    --------
    >>> from whsklearn.effects import smooth_law
    >>> law = smooth_law([0.25, 100, 10, 0.5, 100, 0.01])
    >>> float(law(0.0, 10.0).round(3))  # gamma_4 + 10 gamma_6 at speed
    0.6
    """
    if len(gamma) != 6 or min(gamma) <= 0:
        raise ValueError(f"gamma is {list(gamma)}, expected six positive numbers gamma_1 ... gamma_6 of (3).")
    g1, g2, g3, g4, g5, g6 = (float(g) for g in gamma)
    return FrictionLaw([TanhDifference(g1, 1 / g2, 1 / g3), Tanh(g4, 1 / g5), Viscous(g6)])


def polynomial_law(coefficients: Sequence[float]) -> FrictionLaw:
    """v = sum of coefficients[k] x^k, a static nonlinearity of x.

    ``coefficients``: in ascending powers from the constant, in y per x to the k-th power.

    Examples
    --------
    >>> from whsklearn.effects import polynomial_law
    >>> float(polynomial_law([0.0, 1.0, 0.0, 0.3])(2.0, 0.0))
    4.4
    """
    return FrictionLaw([Power(c, k) for k, c in enumerate(coefficients) if c != 0.0 or k == 1])


def piecewise_linear_law(knots: Sequence[float], slopes: Sequence[float]) -> FrictionLaw:
    """The continuous characteristic through 0 with slopes[0] below knots[0], slopes[i] after knots[i-1].

    ``knots``: increasing, in the unit of x. ``slopes``: one more than knots, in y per x.

    Examples
    --------
    >>> from whsklearn.effects import piecewise_linear_law
    >>> piecewise_linear_law([-1.0, 1.0], [0.1, 1.0, 0.1])([-2.0, 0.0, 0.5, 2.0], 0.0).round(6).tolist()
    [-1.1, 0.0, 0.5, 1.1]
    """
    if len(slopes) != len(knots) + 1:
        raise ValueError(f"{len(slopes)} slopes for {len(knots)} knots; expected one more slope than knots.")
    if any(b <= a for a, b in itertools.pairwise(knots)):
        raise ValueError(f"knots are {list(knots)}, expected increasing numbers.")
    steps = np.diff(slopes)
    hinges = [Hinge(float(s), float(k)) for s, k in zip(steps, knots, strict=True)]
    shift = -sum(float(s) * max(-float(k), 0.0) for s, k in zip(steps, knots, strict=True))
    return FrictionLaw([Power(float(slopes[0]), 1.0), *hinges, *([Power(shift, 0.0)] if shift else [])])


def cubic_spline_law(knots: Sequence[float], values: Sequence[float]) -> FrictionLaw:
    """The natural cubic spline in x through the values at the knots, straight beyond the outer ones.

    ``knots``, ``values``: increasing positions, in the unit of x, and values there, in the unit of y.

    Examples
    --------
    >>> from whsklearn.effects.law import cubic_spline_law
    >>> law = cubic_spline_law([-1.0, 0.0, 1.0], [1.0, 0.0, 1.0])
    >>> law([-1.0, 0.0, 1.0], 0.0).round(12).tolist()
    [1.0, 0.0, 1.0]
    """
    if len(knots) != len(values) or len(knots) < 3:
        raise ValueError(f"{len(values)} values for {len(knots)} knots; expected equal numbers, 3 or more.")
    if any(b <= a for a, b in itertools.pairwise(knots)):
        raise ValueError(f"knots are {list(knots)}, expected increasing numbers.")
    law = FrictionLaw(spline_terms(np.asarray(knots, dtype=float)))
    return law.reweighted(np.linalg.solve(law.regressors(knots, 0.0), np.asarray(values, dtype=float)))


def as_law(law: str | FrictionLaw | StaticEffect | Iterable[StaticEffect] | None) -> FrictionLaw:
    """A law from None (law (4)), names joined by commas, terms, or a law.

    Names are those of memoryless effects, such as ``viscous``, of laws in x, ``linear``, ``offset``, ``polynomial``,
    ``piecewise_linear``, ``cubic_spline``, and ``reduced``, which is (4).

    ``law``: any of these. Raises ValueError if a name is unknown or its effect is not a memoryless term.

    Examples
    --------
    >>> from whsklearn.effects import as_law
    >>> as_law("viscous,coulomb").labels
    ('viscous', 'coulomb')
    """
    if law is None:
        return reduced_law()
    if isinstance(law, FrictionLaw):
        return law
    if isinstance(law, StaticEffect):
        return FrictionLaw([law])
    if isinstance(law, str):
        names = [n.strip() for n in law.split(",") if n.strip()]
        terms = [reduced_law().terms if n == "reduced" else static_terms(n) or (get_effect(n)(),) for n in names]
        return FrictionLaw(dict.fromkeys(itertools.chain.from_iterable(terms)))  # type: ignore[arg-type]
    if not isinstance(law, Iterable):
        raise ValueError(f"law is {law!r}, expected names joined by commas, effects, a FrictionLaw or None.")
    return FrictionLaw(law)
