"""Is the base model itself too small: would a higher order or a freer law do what no effect does?

A base of too low an order, or with a law of another shape, leaves errors that follow the input; some effect of the
catalogue will always follow them too.  Before a name is believed, the base model is given more: one and two more
poles and zeros in each block, and piecewise-linear functions of x and of dx beside its law.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from whsklearn.gap.plants import chain_evidence as rules
from whsklearn.gap.plants.chain_candidates import Candidate, Scales
from whsklearn.gap.plants.chain_fit import cost, refit
from whsklearn.gap.plants.chain_model import ChainModel, Setting, Term, chain
from whsklearn.systems import chain_probes as probes

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

N_HATS = 8  # triangles over x, and as many over dx
EXTRA = (1, 2)  # poles and zeros added to each block


@dataclass(frozen=True)
class Structure:
    """The better of the larger base models.

    Attributes
    ----------
    setting, model : Setting, ChainModel
        With its orders, and fitted.
    cost : float
        Sum of squares over the samples of the fit.
    orders : tuple of int
        (n_a, n_b, n_c, n_d).
    by_orders, by_law : float
        Share of the base model's sum of squares that more poles and zeros alone, or a free law alone, take away.
    """

    setting: Setting
    model: ChainModel
    cost: float
    orders: tuple[int, int, int, int]
    by_orders: float
    by_law: float


def raised(s: Setting, m: ChainModel, more: int) -> tuple[Setting, ChainModel]:
    """(setting, model) with ``more`` further numbers, all zero, in a, b, c and d: the same model of a higher order."""
    na, nb, nc, nd, nw = (int(i) for i in s.dims)
    parts = np.split(m.theta, np.cumsum([na - 1, nb, nw, nc - 1]))
    zero = np.zeros(more)
    theta = np.concatenate([parts[0], zero, parts[1], zero, parts[2], parts[3], zero, parts[4], zero])
    dims = np.array([na + more, nb + more, nc + more, nd + more, nw], dtype=np.int64)
    return dataclasses.replace(s, dims=dims), dataclasses.replace(m, theta=theta)


def freed(s: Setting, m: ChainModel) -> ChainModel:
    """The model with triangles over x and over dx, of weight zero, beside its law."""
    x = chain(s, m)[0]
    terms = []
    for code, signal in ((probes.HAT_X, x), (probes.HAT_DX, np.diff(x, prepend=0.0))):
        knots = np.quantile(signal, np.linspace(0.005, 0.995, N_HATS))
        width = float(np.max(np.diff(knots)))
        kind = Candidate("law_shape", code, ("weight", "knot", "width"), free=(False, False))
        terms += [Term(kind, (0.0, float(k), max(width, 1e-12))) for k in knots]
    return dataclasses.replace(m, terms=(*m.terms, *terms))


def larger_base(s: Setting, base: ChainModel, z: Scales) -> Structure:
    """The base model with more poles and zeros, with a free law, and with both; the least sum of squares answers."""
    value = cost(s, base)
    fits = []
    for more in EXTRA:
        fits.append((*_refitted(*raised(s, base, more), z), False))
    by_orders = min(f[2] for f in fits)
    fits.append((*_refitted(s, freed(s, base), z), True))
    by_law = fits[-1][2]
    best = min((f for f in fits if not f[3]), key=lambda f: f[2])
    fits.append((*_refitted(best[0], freed(best[0], best[1]), z), True))
    setting, model, least, _ = min(fits, key=lambda f: f[2])
    na, nb, nc, nd = (int(i) for i in setting.dims[:4])
    return Structure(setting, model, least, (na, nb, nc, nd), 1.0 - by_orders / value, 1.0 - by_law / value)


def _refitted(s: Setting, m: ChainModel, z: Scales) -> tuple[Setting, ChainModel, float]:
    fitted, value = refit(s, m, z)
    return s, fitted, value


def too_small(found_cost: float, larger: Structure) -> bool:
    """Whether the larger base leaves less than `TOO_SMALL` of what the model with the effects found leaves."""
    return larger.cost < rules.TOO_SMALL * found_cost


def sentence(larger: Structure, dims: Any) -> str:
    """What the base model lacks, and which options give it."""
    parts = []
    if larger.by_orders > rules.SPOKEN_OF:
        before, after = (",".join(str(int(n)) for n in o) for o in (dims[:4], larger.orders))
        parts.append(
            f"linear dynamics are left: more poles and zeros alone take {100 * larger.by_orders:.0f} % off the mean "
            f"square of the one-step error (orders {before} were given; try {after})"
        )
    if larger.by_law > rules.SPOKEN_OF:
        parts.append(
            f"the law has another shape: free functions of x and dx alone take {100 * larger.by_law:.0f} % off it "
            "(give another law)"
        )
    if not parts:
        parts.append("orders and law together are too small")
    return "The base model itself falls short: " + "; ".join(parts) + ". No effect is named before that is mended."
