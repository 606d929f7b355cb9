"""An identified Wiener-Hammerstein model: its parameters in three forms, its free run, its predictions.

natural : [a_2 .. , b_1 .. , weights, c_2 .. , d_1 ..], the form that the exact gradient uses
paper   : theta of (6), products with the key term's weight g
named   : a dict of ``a``, ``b``, ``c``, ``d`` and one weight per term of the law
"""

from __future__ import annotations

import itertools
import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from whsklearn.effects import FrictionLaw
from whsklearn.effects.base import Array, Bools, Integers
from whsklearn.effects.codes import VISCOUS
from whsklearn.effects.rows import law_values
from whsklearn.recursion.batch.best_linear import filter_rows
from whsklearn.recursion.memory.blocks import LARGEST, ahead, first_block
from whsklearn.recursion.memory.linearised import jumps
from whsklearn.systems.stability import is_stable

RADIUS = 0.9995


class Structure(NamedTuple):
    """Orders, number of inputs, law, the index of its key term (-1 if it has none), and the lead of the response.

    ``advance`` is the number of samples by which the chain responds earlier than the paper's, whose blocks
    delay by one sample each. It is 2 where both blocks have a direct path.
    """

    dims: Integers
    n_inputs: int
    law: FrictionLaw
    key: int
    advance: int = 0

    @property
    def differs(self) -> bool:
        """Whether the key term is in dx, so that theta holds g b_1 + g."""
        return self.key >= 0 and int(self.law.codes[self.key]) == VISCOUS

    def under(self, law: FrictionLaw) -> Structure:
        """The same blocks about another law, whose key term is at the same place."""
        return self._replace(law=law, dims=np.append(self.dims[:4], len(law)))

    def slices(self) -> tuple[slice, slice, slice, slice, slice]:
        """Positions of a[1:], b, weights, c[1:] and d in the natural vector."""
        na, nb, nc, nd, nw = self.dims.tolist()
        ends = itertools.accumulate([0, na - 1, nb, nw, nc - 1, nd])
        return tuple(itertools.starmap(slice, itertools.pairwise(ends)))  # type: ignore[return-value]


def paper_vector(natural: Array, s: Structure) -> Array:
    """Theta of (6); the natural vector itself where the law has no key term."""
    if s.key < 0:
        return natural.copy()
    a, b, w, c, d = (natural[i] for i in s.slices())
    g = w[s.key]
    shift = np.zeros(b.size)
    if s.differs and b.size:
        shift[0] = g
    return np.concatenate([[g], g * a, g * b + shift, np.delete(w, s.key), c, d])


def paper_jacobian(natural: Array, s: Structure) -> Array:
    """Derivatives of `paper_vector`, shape (n, n)."""
    n = natural.size
    if s.key < 0:
        return np.eye(n)
    ia, ib, iw, ic, _ = s.slices()
    g_at = iw.start + s.key
    g = natural[g_at]
    out = np.zeros((n, n))
    out[0, g_at] = 1.0
    for row, at in enumerate(range(ia.start, ib.stop), start=1):
        out[row, at] = g
        out[row, g_at] = natural[at] + (1.0 if s.differs and at == ib.start else 0.0)
    rest = [i for i in range(iw.start, iw.stop) if i != g_at] + list(range(ic.start, n))
    for row, at in enumerate(rest, start=ib.stop + 1):
        out[row, at] = 1.0
    return out


def natural_vector(paper: Array, s: Structure) -> Array:
    """The inverse of `paper_vector`."""
    if s.key < 0:
        return paper.copy()
    ia, ib, _, _, _ = s.slices()
    na1, nb, nw = ia.stop, ib.stop - ib.start, len(s.law)
    g = paper[0] if abs(paper[0]) > 1e-9 else math.copysign(1e-9, paper[0])
    b = paper[1 + na1 : 1 + na1 + nb] / g
    if s.differs and nb:
        b[0] -= 1.0
    others = paper[1 + na1 + nb : na1 + nb + nw]
    weights = np.insert(others, s.key, paper[0])
    return np.concatenate([paper[1 : 1 + na1] / g, b, weights, paper[na1 + nb + nw :]])


def named(natural: Array, s: Structure) -> dict[str, Any]:
    """A dict of ``a``, ``b``, ``c``, ``d`` and the law's weights by label."""
    a, b, w, c, d = (natural[i].copy() for i in s.slices())
    a = np.concatenate([[1.0], a])
    if s.n_inputs > 1:
        a = a.reshape(-1, s.n_inputs)
    blocks: dict[str, Any] = {"a": a, "b": b, "c": np.concatenate([[1.0], c]), "d": d}
    return blocks | {label: float(v) for label, v in zip(s.law.labels, w, strict=True)}


def named_errors(variances: Array, s: Structure) -> dict[str, Any]:
    """Standard errors in the layout of `named`; zero for fixed entries."""
    errors = named(np.sqrt(np.maximum(variances, 0.0)), s)
    errors["a"].flat[0] = 0.0
    errors["c"][0] = 0.0
    return errors


def inside(denominator: Array) -> Array:
    """The denominator with its poles moved inside the unit circle, so that a free run stays finite."""
    if denominator.size == 0 or is_stable(np.ascontiguousarray(denominator), 1.0):
        return denominator
    largest = np.abs(np.roots(np.concatenate([[1.0], denominator]))).max()
    return denominator * (RADIUS / largest) ** np.arange(1, denominator.size + 1)


def linear_blocks(natural: Array, s: Structure, delays: tuple[int, int], dt: float) -> tuple[Any, Any]:
    """(L1, L2) as `scipy.signal.dlti`; L1 is a tuple of systems if there are several inputs."""
    if isinstance(dt, bool) or not isinstance(dt, (int, float, np.number)) or not 0.0 < dt < math.inf:
        raise ValueError(f"dt is {dt!r}, expected a positive number, the sampling interval in seconds.")
    a, b, _, c, d = (natural[i] for i in s.slices())
    numerators = np.append(1.0, a).reshape(-1, s.n_inputs).T
    first = tuple(_block(n, b, delays[0], dt) for n in numerators)
    return (first if s.n_inputs > 1 else first[0]), _block(np.append(1.0, c), d, delays[1], dt)


def _block(numerator: Array, denominator: Array, delay: int, dt: float) -> Any:
    """q^-delay numerator / (1 + denominator), in powers of z."""
    from scipy.signal import dlti

    both = np.zeros((2, max(delay + numerator.size, 1 + denominator.size)))
    both[0, delay : delay + numerator.size] = numerator
    both[1, : 1 + denominator.size] = np.append(1.0, denominator)
    used = np.flatnonzero(both.any(axis=0))[-1] + 1  # behind them are poles at z = 0 that zeros cancel
    under = np.trim_zeros(both[0, :used], "f")
    return dlti(under if under.size else np.zeros(1), both[1, :used], dt=float(dt))


def free_run(natural: Array, s: Structure, u: Array, restart: Bools, covariance: Array | None = None) -> Array:
    """The output y from u alone, starting each experiment at rest; shape (n,).

    With a ``covariance`` of the natural parameters, this is the expected output, averaged over the uncertainty
    of L1: sign(dx) becomes its mean, erf(dx / (sqrt(2) sd(t))), with sd(t) from the sensitivities of dx at t.
    """
    return predictions(natural, s, u, np.zeros(len(u)), restart, 0, covariance)


def wrong_signs(natural: Array, s: Structure, u: Array, restart: Bools, covariance: Array) -> Array:
    """How many signs of dx the simulation of ``natural`` is expected to get wrong in each experiment.

    The sum of min(p, 1 - p): p(t) is the probability of a positive sign under the Gaussian (natural, covariance).
    """
    begins = np.flatnonzero(restart)
    if not begins.size or not jumps(s.law.codes).any():
        return np.zeros(begins.size)
    if s.advance:
        u, _, restart, *_ = shifted(u, np.zeros(len(u)), restart, s.advance)
        begins = np.flatnonzero(restart)
    wrong: Array = np.add.reduceat(_before_l2(natural, s, u, restart, covariance)[1], begins)
    return wrong


def predictions(
    natural: Array, s: Structure, u: Array, y: Array, restart: Bools, horizon: int,
    covariance: Array | None = None,
) -> Array:  # fmt: skip
    """Y_hat(t | t - horizon): outputs up to t - horizon are known; horizon 0 means that none are."""
    if s.advance:
        # Both delays commute with the static law, so a chain with a lead is the same chain with its output shifted.
        u, y, restart, _, back = shifted(u, y, restart, s.advance)
        return predictions(natural, s._replace(advance=0), u, y, restart, horizon, covariance)[back]
    v = _before_l2(natural, s, u, restart, covariance)[0]
    d = natural[s.slices()[4]]
    d = inside(d) if horizon != 1 else d
    if horizon == 0:
        return _from_rest(np.ones(1), np.append(1.0, d), v, restart)
    return ahead(v, np.ascontiguousarray(d), y, restart, horizon)


def _before_l2(natural: Array, s: Structure, u: Array, restart: Bools, covariance: Array | None) -> tuple[Array, Array]:
    """The signal that enters L2's denominator, and min(p, 1 - p) for each sign."""
    a, b, w, c, _ = (natural[i] for i in s.slices())
    n1 = a.size + b.size
    spread = np.zeros((0, 0)) if covariance is None else np.ascontiguousarray(covariance[:n1, :n1])
    stable = np.concatenate([a, inside(b)])
    moved, _ = first_block(stable, s.dims, u, restart, spread)
    x, dx = moved[:2]
    certainty = moved[2] if len(moved) > 2 else np.ones(x.size)
    v = np.zeros(x.size)
    values = law_values(s.law.codes, s.law.shapes, x, dx, math.inf)
    for weight, value, jumping in zip(w, values, jumps(s.law.codes), strict=True):
        v += weight * (value * certainty if jumping else value)
    v = np.clip(v, -LARGEST, LARGEST)
    out = _from_rest(np.concatenate([[0.0, 1.0], c]), np.ones(1), v, restart)
    return out, np.where(dx == 0.0, 0.0, 0.5 * (1.0 - certainty))  # at rest the sign does not matter


def _from_rest(b: Array, a: Array, signal: Array, restart: Bools) -> Array:
    """b(q)/a(q) of a signal, from rest at the start of each experiment."""
    bounds = np.unique(np.concatenate([[0], np.flatnonzero(restart), [signal.size]]))
    return filter_rows(b, a, signal[None], bounds)[0]


def shifted(
    u: Array, y: Array, restart: Bools, advance: int, weights: Array | None = None
) -> tuple[Array, Array, Bools, Array | None, NDArray[np.intp]]:
    """Experiments and weights with y (u, if negative) delayed by ``advance`` samples, and where their samples are."""
    more, late = abs(advance), max(advance, 0)
    n = restart.size + more * int(restart.sum())
    u_new, y_new, restart_new = np.zeros((n, u.shape[1])), np.zeros(n), np.zeros(n, dtype=np.bool_)
    at = np.arange(restart.size) + more * (np.cumsum(restart) - 1)
    to = at + late
    restart_new[at[restart]] = True
    u_new[to - advance], y_new[to] = u, y
    moved = None if weights is None else np.bincount(to, weights, n).astype(float)
    return u_new, y_new, restart_new, moved, to


DRAWS = 100  # a standard deviation from this many draws is accurate to 7 %
SEED = 0  # the same draws for every call, so that predicting twice gives the same


def rows_spread(rows: Array, covariance: Array, noise_variance: float) -> Array:
    """sqrt(phi' P phi + sigma^2) of each row, shape (n,); infinite if sigma or P is not known."""
    variance = np.einsum("ti,ij,tj->t", rows, covariance, rows) + noise_variance
    return _known(np.sqrt(np.maximum(variance, 0.0)))


def draws(natural: Array, covariance: Array, s: Structure, u: Array, restart: Bools) -> Array:
    """Standard deviation of the free runs of parameters drawn from N(natural, covariance), shape (n,).

    Draws are used, not sensitivities: where the law jumps, a free run is not a smooth function of its parameters.
    """
    if not np.isfinite(covariance).all():
        return np.full(len(u), np.inf)
    scale = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
    values, vectors = np.linalg.eigh(covariance / np.outer(scale, scale))
    root = scale[:, None] * vectors * np.sqrt(np.maximum(values, 0.0))
    shifts = np.random.default_rng(SEED).standard_normal((DRAWS, natural.size)) @ root.T
    mean, squares = np.zeros(len(u)), np.zeros(len(u))
    for k, shift in enumerate(shifts, start=1):  # Welford 1962: one run in memory at a time
        y = np.clip(np.nan_to_num(free_run(natural + shift, s, u, restart), nan=1e30), -1e30, 1e30)
        away = y - mean
        mean += away / k
        squares += away * (y - mean)
    return np.sqrt(squares / (DRAWS - 1))


def noise_spread(variance: float, denominator: Array, restart: Bools) -> Array:
    """Standard deviation of white noise of this variance behind 1/(1 + denominator), from rest, shape (n,)."""
    from scipy.signal import lfilter

    begins = np.append(np.flatnonzero(restart), restart.size)
    lengths = np.diff(begins)
    longest = int(lengths.max(initial=0))
    impulse = np.zeros(longest)
    impulse[:1] = 1.0
    power = np.cumsum(lfilter([1.0], np.append(1.0, denominator), impulse) ** 2)
    return _known(np.sqrt(variance * np.concatenate([power[:n] for n in lengths] or [power])))


def _known(std: Array) -> Array:
    return np.where(np.isfinite(std), std, np.inf)
