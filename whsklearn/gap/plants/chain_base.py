"""The base model of a chain: several minima, and knots of its law where its x is."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from whsklearn.gap.plants import chain_evidence as rules
from whsklearn.gap.plants.chain_candidates import CATALOGUE, Scales
from whsklearn.gap.plants.chain_fit import fit_base, minima_from, sharpen
from whsklearn.gap.plants.chain_law import LawChoice
from whsklearn.gap.plants.chain_model import ChainModel, Setting, Term, chain, signal_scales, stable_blocks
from whsklearn.gap.record import rms
from whsklearn.recursion.starts import least_squares_start, random_start, term_scales

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

PLACED = 2  # times that knots are put at the quantiles of x, and the blocks fitted to the law they make
# random starts behind a lost sign, guesses of the sign for each, and the best of them that are fitted: most starts end
# in a wrong sign somewhere
FOLDED_STARTS, GUESSES, KEPT = 60, 8, 8


@dataclass(frozen=True)
class Base:
    """Separate minima, the least first, in a setting whose law has its knots."""

    setting: Setting
    scales: Scales
    minima: list[ChainModel]
    folded: ChainModel | None = None  # the base model of the readings as they are, where their sign was lost


def base_of(s: Setting, choice: LawChoice, rng: np.random.Generator) -> Base:
    """The minima of the base model; a law with knots is fitted from the polynomial that stands in for it."""
    found = [(m, value) for m, value in fit_base(s, rng) if np.isfinite(value)]
    least = found[0][1]
    minima = [m.fitted(s, v) for m, v in found[:3] if v < rules.OTHER_MINIMUM * least]
    if not choice.has_knots:
        straight = unfolded(s, rng) if never_negative(s.y) else None
        if straight is not None and straight.cost < rules.SIGN_LOST * least:
            return Base(s, signal_scales(s, straight), [straight], minima[0])
        return Base(s, signal_scales(s, minima[0]), minima)
    at, model = s, minima[0]
    for _ in range(PLACED):
        at, model = with_knots(at, model, choice)
    return Base(at, signal_scales(at, model), [model])


def never_negative(y: Array) -> bool:
    """Whether a signal stays on one side of zero and touches it: what is left of one whose sign was lost."""
    return bool(0.0 <= y.min() < rules.TOUCHES_ZERO * rms(y))


def unfolded(s: Setting, rng: np.random.Generator) -> ChainModel | None:
    """The base model behind a sensor that loses the sign; None if no start gives one.

    From a random first block and friction the sign of the output is guessed, then weights and second block are
    fitted by least squares to the readings under that sign, and the guess is made anew (as Gerchberg and Saxton 1972
    retrieve a phase, Optik 35(2)).
    """
    kernel = (s.dims, s.law.codes, s.law.shapes)
    dims = tuple(int(d) for d in s.dims)
    restart = np.zeros(s.u.size, dtype=bool)
    restart[0] = True
    u = np.ascontiguousarray(s.u[:, None])
    scales = np.abs(term_scales(kernel, u, s.y, restart, rng))
    found: list[tuple[float, Array]] = []
    for _ in range(FOLDED_STARTS):
        theta = random_start(dims, rng, scales)
        for _ in range(GUESSES):
            model = ChainModel(theta, kappa=np.inf)
            guess = chain(s, model, free=True)[2]
            signed = np.copysign(s.y, guess)
            theta = least_squares_start(theta, kernel, u, signed, restart)
        if not np.isfinite(theta).all() or not stable_blocks(s, theta):
            continue
        miss = s.y - np.abs(chain(s, ChainModel(theta), free=True)[2])
        found.append((float(np.mean(miss[s.fit] ** 2)), theta))
    found.sort(key=lambda f: f[0])
    if not found:
        return None
    kind = next(k for k in CATALOGUE if k.name == "sensor_rectification")
    model, value = minima_from(s, [t for _, t in found[:KEPT]], keep=2, terms=(Term(kind, (1.0,)),))[0]
    return dataclasses.replace(model.fitted(s, value), n_base=1)


def with_knots(s: Setting, m: ChainModel, choice: LawChoice) -> tuple[Setting, ChainModel]:
    """(setting, model) whose law has its knots at the quantiles of the model's x, fitted."""
    x = chain(s, m)[0]
    law = choice.placed(x)
    dims = s.dims.copy()
    dims[4] = len(law)
    at = dataclasses.replace(s, law=law, dims=dims)
    na, nb, nw = int(s.dims[0]), int(s.dims[1]), int(s.dims[4])
    first, rest = m.theta[: na - 1 + nb], m.theta[na - 1 + nb + nw :]
    restart = np.zeros(s.u.size, dtype=bool)
    restart[0] = True
    kernel = (dims, law.codes, law.shapes)
    theta = np.concatenate([first, np.zeros(len(law)), rest])
    theta = least_squares_start(theta, kernel, np.ascontiguousarray(s.u[:, None]), s.y, restart)
    start = dataclasses.replace(m, theta=theta, on=None, cost=np.inf)
    fitted, value = sharpen(at, start, signal_scales(at, start), (30.0, 300.0, 1000.0), steps=15)
    return at, fitted.fitted(at, value)
