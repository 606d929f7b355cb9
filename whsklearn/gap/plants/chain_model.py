"""The model under diagnosis: two linear blocks, a law, the effects added so far and the colour of the noise.

The errors that a fit minimises are e = A(q) (y - y_hat), y_hat predicted one step ahead; A is an
autoregression of (2)'s noise, one where that noise is white, so that colour is not taken for a missing
effect (generalised least squares; Ljung 1999, ch. 7).
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from whsklearn._numba import njit
from whsklearn.effects import FrictionLaw
from whsklearn.effects.codes import N_NUMBERS, OUTPUT_OFFSET, QUANTIZATION, USER_OUTPUT
from whsklearn.effects.own import WHICH, address_of
from whsklearn.effects.terms import term
from whsklearn.estimators._model import inside
from whsklearn.gap.plants.chain_candidates import Scales
from whsklearn.gap.record import rms
from whsklearn.gap.values import FittedTerm
from whsklearn.systems.chain import Chain, Ports, run
from whsklearn.systems.stability import is_stable

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

AR_ORDER = 6  # of the colour of the noise
SKIP = 40  # samples at the start of a record, where the state is not known
LONGEST_COLOUR = 0.95  # modulus of the colour's roots at the most: with one at 1, A(q) takes the constant out of the
# errors, and a fit no longer sees that a model is off by one (`tests/gap/plants/test_chain_law.py`)


@dataclass(frozen=True)
class Term(FittedTerm):
    """A candidate (`whsklearn.gap.plants.chain_candidates.Candidate`) with its numbers."""

    def row(self) -> Array:
        """The numbers as the compiled chain takes them."""
        out = np.zeros(N_NUMBERS)
        out[: len(self.q)] = self.q
        return out


@dataclass(frozen=True)
class Setting:
    """What stays the same through a diagnosis: record, split, orders, law.

    ``fit`` marks the samples whose errors count in a fit, ``held`` numbers the held-out blocks (-1: none).
    """

    u: Array
    y: Array
    dt: float
    dims: NDArray[np.int64]
    law: FrictionLaw
    fit: NDArray[np.bool_]
    held: NDArray[np.intp]

    def on_all(self, skip: int) -> Setting:
        """The same with every sample but the first ones in the fit."""
        mask = np.ones(self.u.size, dtype=bool)
        mask[:skip] = False
        return dataclasses.replace(self, fit=mask)


@dataclass(frozen=True)
class ChainModel:
    """Natural parameters, effects, noise colour and the sharpness of the sign.

    ``on``, ``cost`` and ``before`` say what it was fitted to, the sum of squares there, and the model that it
    adds its last effect to.
    """

    theta: Array
    terms: tuple[Term, ...] = ()
    ar: Array = dataclasses.field(default_factory=lambda: np.zeros(AR_ORDER))
    kappa: float = np.inf
    on: Setting | None = dataclasses.field(default=None, repr=False, compare=False)
    cost: float = np.inf
    n_base: int = 0  # leading terms that are the base model's: none, as the law is in theta, but a folded reading
    before: ChainModel | None = dataclasses.field(default=None, repr=False, compare=False)

    def fitted(self, s: Setting, cost: float, before: ChainModel | None = None) -> ChainModel:
        """Marked as fitted to a setting at this sum of squares, on top of the model ``before``."""
        return dataclasses.replace(self, on=s, cost=cost, before=before)

    def with_terms(self, terms: tuple[Term, ...]) -> ChainModel:
        """With these effects in place of its own; not refitted where they are other ones."""
        same = sorted(map(id, terms)) == sorted(map(id, self.terms))
        model = dataclasses.replace(self, terms=terms)
        return model if same else model.fitted(None, np.inf)  # type: ignore[arg-type]

    def effects(self) -> tuple[NDArray[np.int64], Array]:
        """Codes and numbers of the effects."""
        codes = np.array([t.kind.code for t in self.terms], dtype=np.int64)
        rows = np.array([t.row() for t in self.terms]).reshape(-1, N_NUMBERS)
        own = [i for i, t in enumerate(self.terms) if t.kind.own is not None]
        rows[own, WHICH] = np.arange(len(own))
        return codes, rows

    def plus(self, term: Term) -> ChainModel:
        """With one effect more."""
        return dataclasses.replace(self, terms=(*self.terms, term), on=None, cost=np.inf)

    def without(self, i: int) -> ChainModel:
        """With one effect less."""
        terms = self.terms[:i] + self.terms[i + 1 :]
        return dataclasses.replace(self, terms=terms, on=None, cost=np.inf, before=None)

    def at(self, kappa: float) -> ChainModel:
        """At another sharpness."""
        return dataclasses.replace(self, kappa=kappa, on=None, cost=np.inf)


def chain(s: Setting, m: ChainModel, *, free: bool = False, noise: Array | None = None) -> tuple[Array, Array, Array]:
    """x, v and the predicted (or, if ``free``, simulated) output."""
    n = s.u.size
    x, v, y_hat = np.empty(n), np.empty(n), np.empty(n)
    d = np.zeros(n) if noise is None else noise
    theta = stable_output(s, m.theta) if free else m.theta
    run(theta, *compiled(s, m), s.u, s.y, d, free, x, v, y_hat)
    return x, v, y_hat


def compiled(s: Setting, m: ChainModel) -> tuple[Chain, Ports | None]:
    """All of a model but theta, as the compiled pass takes it."""
    codes, rows = m.effects()
    ports = Ports(codes, rows, own_functions(m.terms)) if m.terms else None
    return Chain(s.dims, s.law.codes, s.law.shapes, m.kappa, s.dt), ports


def own_functions(terms: tuple[Term, ...]) -> Any:
    """Compiled functions of effects of one's own; each row says which is its own."""
    return address_of(tuple(t.kind.own for t in terms if t.kind.own is not None))


def stable_output(s: Setting, theta: Array) -> Array:
    """theta with the poles of L2 drawn inside the unit circle, so that a free run stays finite."""
    nd = int(s.dims[3])
    out = theta.copy()
    if nd:
        out[-nd:] = inside(out[-nd:])
    return out


def raw_errors(s: Setting, m: ChainModel) -> Array:
    """y - y_hat, one step ahead; shape (n,)."""
    return np.clip(np.nan_to_num(s.y - chain(s, m)[2], nan=1e6), -1e6, 1e6)


def free_run(s: Setting, m: ChainModel) -> Array:
    """The output from u alone."""
    return chain(s, m, free=True)[2]


def coloured(e: Array, ar: Array) -> Array:
    """A(q) e along the first axis."""
    out = e.copy()
    for i, a in enumerate(ar, start=1):
        if a != 0.0:
            out[i:] += a * e[:-i]
    return out


def stable_blocks(s: Setting, theta: Array) -> bool:
    """Whether L1 is stable, with room."""
    na, nb = int(s.dims[0]), int(s.dims[1])
    return bool(is_stable(np.ascontiguousarray(theta[na - 1 : na - 1 + nb]), 0.9995))


def signal_scales(s: Setting, m: ChainModel) -> Scales:
    """Sizes of the signals under the model."""
    x, v, _ = chain(s, m)

    def size(a: Array) -> float:
        return max(rms(a), 1e-12)

    return Scales(
        size(s.u), float(np.abs(s.u).max()), size(x), max(float(np.quantile(np.abs(x), 0.999)), 1e-12),
        size(np.diff(x)), size(v), max(float(np.std(s.y)), 1e-12), s.u.size, s.dt,
    )  # fmt: skip


# --- the free numbers as one vector ------------------------------------------------------------
def free_slots(m: ChainModel) -> list[tuple[int, int]]:
    """(effect, number) of every number of an effect that takes part in the joint fit."""
    return [(i, j) for i, t in enumerate(m.terms) for j in range(t.kind.n_numbers) if t.kind.is_free(j)]


def bounds_of(t: Term, j: int, z: Scales) -> tuple[float, float]:
    """Range of number j of an effect."""
    i = j - t.kind.linear
    return (-np.inf, np.inf) if i < 0 else t.kind.ranges(z)[i]


def to_vector(m: ChainModel, z: Scales) -> Array:
    """theta, then the free numbers (logarithms where they span ratios), then the noise colour."""
    extra = []
    for i, j in free_slots(m):
        low, high = bounds_of(m.terms[i], j, z)
        value = m.terms[i].q[j]
        extra.append(np.log(min(max(value, low), high)) if np.isfinite(low) and low > 0 else value)
    return np.concatenate([m.theta, extra, m.ar])


def from_vector(m: ChainModel, x: Array, z: Scales) -> ChainModel:
    """The inverse of `to_vector`; numbers are kept inside their ranges."""
    n = m.theta.size
    numbers = [list(t.q) for t in m.terms]
    slots = free_slots(m)
    for (i, j), value in zip(slots, x[n : n + len(slots)], strict=True):
        low, high = bounds_of(m.terms[i], j, z)
        value = float(np.exp(np.clip(value, -700, 700))) if np.isfinite(low) and low > 0 else float(value)
        numbers[i][j] = float(min(max(value, low), high))
    terms = tuple(Term(t.kind, tuple(q)) for t, q in zip(m.terms, numbers, strict=True))
    ar = shortened_colour(x[n + len(slots) :])
    return dataclasses.replace(m, theta=x[:n].copy(), terms=terms, ar=ar, on=None, cost=np.inf)


def shortened_colour(ar: Array) -> Array:
    """An autoregression with its roots drawn inside `LONGEST_COLOUR`."""
    if ar.size == 0 or is_stable(np.ascontiguousarray(ar), LONGEST_COLOUR):
        return ar.copy()
    largest = np.abs(np.roots(np.concatenate([[1.0], ar]))).max()
    return np.asarray(ar * (0.999 * LONGEST_COLOUR / largest) ** np.arange(1, ar.size + 1))


@njit(nogil=True, error_model="numpy")
def _sensitivities(theta, steps, chain, ports, slots, slot_steps, u, y, base, sensor, out):
    """Derivatives of y - y_hat by theta and by the chosen numbers of the effects.

    Forward differences for L1 and the effects; where no sensor stands behind L2, the law's weights, c and d are
    exact, as y_hat is linear in them.
    """
    n = u.size
    dims, law, shapes, kappa = chain.dims, chain.law, chain.shapes, chain.kappa
    na, nb, nc, nd, nw = dims[0], dims[1], dims[2], dims[3], dims[4]
    n1 = na - 1 + nb
    n_moved = theta.size if sensor else n1
    x, v, y_hat, zero = np.empty(n), np.empty(n), np.empty(n), np.zeros(n)
    for i in range(n_moved):
        moved = theta.copy()
        moved[i] += steps[i]
        run(moved, chain, ports, u, y, zero, False, x, v, y_hat)
        for t in range(n):
            out[t, i] = (y[t] - y_hat[t] - base[t]) / steps[i]
    if ports is not None:
        for i in range(slots.shape[0]):
            rows = ports.rows.copy()
            rows[slots[i, 0], slots[i, 1]] += slot_steps[i]
            run(theta, chain, Ports(ports.codes, rows, ports.own), u, y, zero, False, x, v, y_hat)
            for t in range(n):
                out[t, theta.size + i] = (y[t] - y_hat[t] - base[t]) / slot_steps[i]
    if sensor:
        return
    run(theta, chain, ports, u, y, zero, False, x, v, y_hat)
    c0 = n1 + nw
    d0 = c0 + nc - 1
    f = np.zeros((n, nw))
    for t in range(n):
        dx = x[t] - (x[t - 1] if t > 0 else 0.0)
        for i in range(nw):
            f[t, i] = term(law[i], shapes[i, 0], shapes[i, 1], shapes[i, 2], x[t], dx, kappa)[0]
            s = f[t - 1, i] if t > 0 else 0.0
            for m in range(1, min(nc, t)):
                s += theta[c0 + m - 1] * f[t - 1 - m, i]
            out[t, n1 + i] = -s
        for m in range(1, nc):
            out[t, c0 + m - 1] = -v[t - 1 - m] if t > m else 0.0
        for m in range(nd):
            out[t, d0 + m] = y[t - 1 - m] if t > m else 0.0


def jacobian(s: Setting, m: ChainModel, z: Scales, base: Array) -> Array:
    """Derivatives of A(q) (y - y_hat) by the vector of `to_vector`; shape (n, n_free)."""
    codes, _ = m.effects()
    slots = free_slots(m)
    scales, factors = [], []
    for i, j in slots:
        t, (low, high) = m.terms[i], bounds_of(m.terms[i], j, z)
        value = t.q[j]
        spans = np.isfinite(low) and low > 0
        step = 1e-4 * abs(value) if spans else 1e-3 * max(t.kind.unit(z), 1e-2 * abs(value))
        if spans and value + step > high:
            step = -step
        scales.append(step)
        factors.append(value if spans else 1.0)
    n, p = s.u.size, m.theta.size
    out = np.empty((n, p + len(slots)))
    steps = 1e-6 * np.maximum(np.abs(m.theta), 0.05)
    where = np.array(slots, dtype=np.int64).reshape(-1, 2)
    sensor = bool(np.any((codes >= OUTPUT_OFFSET) & (codes <= QUANTIZATION) | (codes == USER_OUTPUT)))
    _sensitivities(m.theta, steps, *compiled(s, m), where, np.array(scales, dtype=float), s.u, s.y, base, sensor, out)
    out[:, p:] *= np.array(factors, dtype=float)
    out = coloured(np.clip(np.nan_to_num(out), -1e12, 1e12), m.ar)
    lagged = np.zeros((n, m.ar.size))
    for i in range(m.ar.size):
        lagged[i + 1 :, i] = base[: -i - 1]
    return np.concatenate([out, lagged], axis=1)
