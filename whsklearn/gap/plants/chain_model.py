"""The model under diagnosis: two linear blocks, a law, effects, and the colour of the noise.

All errors are those of the free run from u alone, e = A(q) (y - y_hat).  A is an autoregression of the residual, so e
is white if only noise is left, wherever the noise enters.  A sample on the wrong side of a reversal is an outlier of
the height of the sign and counts no more than `CAP`.

The effects that may be missing are those of the catalogue, in the form that the compiled chain takes: ranges, starts
and scanned parameters come from each effect's `Quantity`.  A chain adds the ports that only it has
(`whsklearn.effects.chain`) and its own scales: x is its position, x(t) - x(t-1) its velocity, v its torque.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy.signal import lfilter

from whsklearn._numba import njit
from whsklearn.effects import FrictionLaw, Scales, codes, effect_names, get_effect
from whsklearn.effects.base import Array, Bools, Integers, rms
from whsklearn.effects.chain import CHAIN_FORMS
from whsklearn.effects.own import WHICH, address_of
from whsklearn.effects.rows import law_values
from whsklearn.effects.static import Power
from whsklearn.gap.plant import FittedTerm, WithTerms, with_vectors
from whsklearn.gap.plants.variant import WAVE_STEP, EffectVariant
from whsklearn.gap.record import MAD, OUTLYING
from whsklearn.logs.check import lattice, runs
from whsklearn.recursion.batch.axis_free_run import LARGEST, UNSEEN
from whsklearn.recursion.batch.best_linear import filter_rows, stabilised
from whsklearn.systems.chain import PackedChain, Ports, run

# A grid of the readings is visible directly, and friction that stops a body takes its inertia: neither is a term.
NO_TERM = ("quantization", "early_reversal")
HELD = ("centre",)  # fields that keep their start value: another rest position is the same as one more offset
# Waves over a signal of a chain, which has no revolution to count them by: two thirds of a period within three rms of
# the signal to twelve.
LEAST_ORDER, MOST_ORDER = 0.7, 12.0


@dataclass(frozen=True)
class Sizes:
    """Sizes of the signals of a fitted model, from which ranges and starts follow."""

    u: float  # rms
    u_peak: float
    x: float
    x_peak: float
    dx: float
    v: float
    y: float
    seconds: float
    dt: float
    step: float = 0.0  # of the grid of the readings

    def seen_from(self, kind: ChainCandidate) -> Scales:
        """The scales of the signals where a candidate acts, in the form of the scales of an axis."""
        place, at = kind.cls.place, kind.at
        torque, peak, reach = self.v, 3.0 * self.v, self.x_peak
        if at == "middle":
            torque, peak = self.x, self.x_peak
        elif at == "input" or place == "drive":
            torque, peak, reach = self.u, self.u_peak, self.u_peak
        elif place == "friction":
            reach = 6.0 * self.dx  # the distance of a friction is covered within a few samples
        elif kind.at_sensor:
            reach = 3.0 * self.y
        return Scales(
            torque=torque, peak=peak, speed=2.0 * self.dx, reach=reach, centre=0.0, duration=self.seconds, dt=self.dt,
            resonance=0.25 / self.dt,
        )  # fmt: skip


@dataclass(frozen=True)
class ChainCandidate(EffectVariant):
    """One effect, at one port or in one variant of its text fields."""

    @cached_property
    def free(self) -> tuple[int, ...]:
        """Numbers that a fit moves; an instant has no derivative, so it is found by stepping."""
        walked = (self.cls.scanned(),) if self.scanned == "step" else ()
        still = (*walked, *self.cls.held, *(HELD if self.cls.evaluate is None else ()))
        return tuple(i for i, f in enumerate(self.fields) if f not in still)

    @property
    def n_numbers(self) -> int:
        """Number of parameters that a record must determine."""
        return len(self.free) + (self.scanned == "step")

    @cached_property
    def scanned(self) -> str:
        """Which fine grid finds its one number; the order of a wave is a place, whatever its signal."""
        return "position" if "order" in self.fields else super().scanned

    @property
    def positive(self) -> bool:
        """Whether its one size must be positive."""
        return self.linear == 1 and self.cls.quantities[self.cls.size].positive

    @property
    def at(self) -> str:
        """The port, if there is a choice."""
        return self.options.get("at", "")

    @property
    def at_sensor(self) -> bool:
        """Whether it acts on the reading."""
        return self.cls.place == "sensor" or self.cls.port == "output" or self.at == "output"

    @property
    def delays(self) -> bool:
        """Whether its shape is a time of a few samples."""
        return self.linear == 0 and self.cls.quantities[self.fields[0]].scale == "dt"

    @property
    def folds(self) -> bool:
        """Whether its one size is a share between 0 and 1; a share of one is not a small change."""
        q = self.cls.quantities[self.cls.size]
        return self.linear == 1 and self.at_sensor and (q.low, q.high) == (0.0, 1.0)

    @property
    def pulls(self) -> bool:
        """Whether it is a force on the mass that L1 is: a function of x at the input."""
        return self.cls.place == "position" and self.at == "input"

    def range_of(self, i: int, z: Sizes) -> tuple[float, float]:
        """(low, high) of number i in one record."""
        field = self.fields[i]
        if i < self.linear:
            q = None if self.linear == 2 else self.cls.quantities[field]
            bounded = q is not None and q.unit == "1" and q.low == 0.0
            return (0.0, q.high) if bounded and q is not None else (-np.inf, np.inf)
        if field == "order":
            size = z.y if self.at_sensor else z.x
            # a wave of less than two steps of the grid of the readings is their rounding
            finest = np.pi / z.step if self.at_sensor and z.step else np.inf
            return LEAST_ORDER / size, max(LEAST_ORDER / size, min(MOST_ORDER / size, finest))
        if self.scanned == "time":
            return 0.7 / z.seconds, 0.5 / z.dt
        low, high = self.cls.quantities[field].bounds(z.seen_from(self))
        if field == "time_constant":  # behind a hold a shorter one does nothing, and a fit has no slope to return by
            low = -z.dt / np.log(SMALLEST)
        return (low, min(high, 0.49 / z.dt)) if field == "frequency" else (low, high)

    def shapes(self, z: Sizes) -> list[tuple[float, ...]]:
        """Values of the numbers after the linear ones at which a look tries it."""
        scales = z.seen_from(self)
        if self.scanned == "position":
            return [(float(o),) for o in np.arange(*self.range_of(self.linear, z), WAVE_STEP / scales.reach)]
        if self.delays:  # a delay between samples has a local minimum of its own
            return [(z.dt * float(n),) for n in (*np.arange(0.3, 6.0, 0.4), *np.geomspace(6.3, 60.0, 6))]
        found = self.grid(scales, np.inf)
        if self.fields[-1] == "centre" and len(self.fields) - 1 not in self.free:
            return list(dict.fromkeys((*shape[:-1], 0.0) for shape in found))
        return found


@dataclass(frozen=True)
class ChainTerm(FittedTerm):
    """A candidate with its numbers."""

    def row(self) -> Array:
        """The numbers in the form that the compiled chain takes."""
        return np.pad(self.q, (0, codes.N_NUMBERS - len(self.q)))


def catalogue(law: FrictionLaw) -> list[ChainCandidate]:
    """Every candidate besides a law: all defined effects at every port, except those that the law contains.

    A limit or a dead zone of x is the same as one of v if the law is a line; otherwise a look cannot see it.
    """
    held = {t.code for t in law.terms}
    dry = {t.name for t in law.terms}
    line = all(isinstance(t, Power) and t.degree <= 1 for t in law.terms)
    out = []
    for name in effect_names():
        cls = CHAIN_FORMS.get(name, get_effect(name))
        if name in NO_TERM or cls.code in held:
            continue
        for options in cls.variants():
            if cls.port == "input" and options.get("at") == "middle" and not line:
                continue
            parent = cls.parent_of(**options)
            if parent and parent in ("coulomb", "viscous") and parent not in dry:
                continue
            out.append(ChainCandidate(cls, tuple(options.items())))
    return out


# --- the model ------------------------------------------------------------------------------------

SKIP = 40  # samples at a record's start and after a hole that do not count: the state before them is not known
AR_ORDER = 6  # two for the denominator of L2, through which equation noise passes, and some for the noise itself
LONGEST_COLOUR = 0.95  # largest modulus of A's roots; closer to one, A would treat a tone or an offset as noise
CAP = OUTLYING * OUTLYING  # largest cost of a sample, in variances: that of an error that is clipped
# Share of the last sample that the smallest lag leaves behind a hold, as a delay of so many samples does.
SMALLEST = 0.01
# Step of a difference, of a linear effect as a share of its signal, and least drop of a sum of squares in a fit.
# A step in a linear number must move the output by a share of its rms between this times its root, below which it is
# rounding, and the root, above which it is not a slope.
SMALL = 1e-6
# Signals have any unit (x of four slow poles is 1e6 times u, and its cube 1e18): a run is limited where squares end.
LEAST = 1.0 / LARGEST
FAR = 100.0  # a term is rounding error if its values are as small a share as that of those so far away
# kappa times rms dx on the rungs of a fit, soft ones first: the first has a slope everywhere, under the third a sign is
# resolved, and the last is the sign itself.  Behind an input that is held, dx decays below any share of its rms.
RUNGS = (3.0, 10.0, 30.0, 100.0, 300.0, 1000.0, np.inf)
SHARPEST, HARD = RUNGS[-1], RUNGS[3:]


@dataclass(frozen=True)
class Record:
    """Everything that stays the same through a diagnosis: u and y of shape (n,), the orders and the law.

    ``fit`` marks the samples whose errors count, and ``seen`` those that were logged.  The samples of a hole stay on
    the grid, so that time goes on: the free run crosses them with an interpolated input, and their errors are zero.
    ``step`` is that of the grid of the readings, 0 if they lie on none.
    """

    u: Array
    y: Array
    dt: float
    dims: Integers
    law: FrictionLaw
    fit: Bools
    seen: Bools
    step: float = 0.0

    @classmethod
    def of(cls, u: Array, y: Array, dt: float, dims: Integers, law: FrictionLaw, seen: Bools | None = None) -> Record:
        """The record in which the first `SKIP` samples of every piece do not count.

        ``u``, ``y``, ``seen`` (n,); ``dims`` (5,).  By default all samples are seen.
        """
        seen = np.ones(u.size, dtype=bool) if seen is None else seen
        fit = seen.copy()
        for piece in pieces_of(seen):
            fit[piece][:SKIP] = False
        return cls(np.ascontiguousarray(u), np.ascontiguousarray(y), dt, dims, law, fit, seen, lattice(y[seen]))

    @cached_property
    def blocks(self) -> tuple[slice, slice, slice, slice, slice]:
        """Slices of a, b, the weights, c and d in theta."""
        na, nb, nc, nd, nw = (int(i) for i in self.dims)
        ends = np.cumsum([na - 1, nb, nw, nc - 1, nd])
        return tuple(slice(int(e - k), int(e)) for e, k in zip(ends, (na - 1, nb, nw, nc - 1, nd), strict=True))  # type: ignore[return-value]

    def chain(self, kappa: float) -> tuple[Any, ...]:
        """The chain for the compiled pass: plain, since Numba types a named tuple in Python, slower than a run."""
        return self.dims, self.law.codes, self.law.shapes, float(kappa), self.dt

    def with_law(self, law: FrictionLaw) -> Record:
        """The same record under another law."""
        return dataclasses.replace(self, law=law, dims=np.array([*self.dims[:4], len(law)]))

    def with_output(self, y: Array) -> Record:
        """The same record with other readings."""
        return dataclasses.replace(self, y=np.ascontiguousarray(y))


@dataclass(frozen=True)
class ChainHypothesis(WithTerms):
    """theta = [a[1:], b, weights of the law, c[1:], d], effects, and the colour A of the residual."""

    theta: Array
    terms: tuple[ChainTerm, ...] = ()
    ar: Array = dataclasses.field(default_factory=lambda: np.zeros(AR_ORDER))
    n_base: int = 0

    @property
    def at_sensor(self) -> bool:
        """Whether an effect acts on the reading."""
        return any(t.kind.at_sensor for t in self.terms)


def ports(terms: tuple[ChainTerm, ...]) -> tuple[Array, Integers, Any] | None:
    """Numbers, codes and user-defined laws of the effects, as the compiled pass takes them."""
    if not terms:
        return None
    rows = np.array([t.row() for t in terms])
    own = [t.kind.cls for t in terms if t.kind.cls.evaluate is not None]
    for row, t in zip(rows, terms, strict=True):
        if t.kind.cls.evaluate is not None:
            row[WHICH] = own.index(t.kind.cls)
    return rows, np.array([t.kind.code for t in terms], dtype=np.int64), address_of(tuple(own))


def simulate(
    s: Record, m: ChainHypothesis, kappa: float = np.inf, u: Array | None = None
) -> tuple[Array, Array, Array]:
    """x, v and y_hat of the free run, each of shape (n,); the sign of dx is tanh(kappa dx)."""
    u = s.u if u is None else u
    x, v, y = np.empty((3, u.size))
    _run(s, [m], kappa, u, (x, v, y[None]))
    return x, v, y


def outputs(s: Record, models: list[ChainHypothesis], kappa: float) -> Array:
    """y_hat of several models with the same effects, shape (n_models, n), in one compiled call."""
    x, v, out = *np.empty((2, s.u.size)), np.empty((len(models), s.u.size))
    if models:
        _run(s, models, kappa, s.u, (x, v, out))
    return out


def _at_vectors(s: Record, m: ChainHypothesis, vectors: Array, kappa: float) -> Array:
    """y_hat of a model at several vectors of `to_vector`, the rows of ``vectors``, in one compiled call."""
    effects, p, k = ports(m.terms), m.theta.size, len(vectors)
    if effects is not None:
        rows = np.tile(effects[0], (k, 1, 1))
        for i, t in enumerate(m.terms):
            for j in t.free:
                rows[:, i, j] = np.exp(vectors[:, p]) if t.kind.ratios(j) else vectors[:, p]
                p += 1
        effects = (rows, *effects[1:])
    out = np.empty((k, s.u.size))
    thetas = np.ascontiguousarray(vectors[:, : m.theta.size])
    _runs(thetas, effects, s.chain(kappa), s.u, s.y, (*np.empty((2, s.u.size)), out))
    return out


def _run(s: Record, models: list[ChainHypothesis], kappa: float, u: Array, out: tuple[Array, Array, Array]) -> None:
    """Fill y_hat of every model, and x and v of the last one."""
    found = [ports(m.terms) for m in models]
    effects = None if found[0] is None else (np.array([p[0] for p in found if p is not None]), *found[0][1:])
    _runs(np.array([m.theta for m in models]), effects, s.chain(kappa), u, s.y, out)


@njit(nogil=True, error_model="numpy")
def _runs(thetas, effects, packed, u, readings, out):
    dims, law, shapes, kappa, dt = packed
    chain, none = PackedChain(dims, law, shapes, kappa, dt), np.zeros(u.size)
    x, v, y = out
    # not a literal, for which Numba would compile `run` once more than `WienerHammersteinSystem` does
    free = u.size > 0
    for i in range(thetas.shape[0]):
        if effects is None:
            run(thetas[i], chain, None, u, readings, none, free, x, v, y[i])
        else:
            rows, codes, own = effects
            run(thetas[i], chain, Ports(codes, rows[i], own), u, readings, none, free, x, v, y[i])


def chain_free_run(s: Record, m: ChainHypothesis) -> Array:
    """y_hat under the sign itself, as `WienerHammersteinSystem` simulates it."""
    return simulate(s, m)[2]


def whiten(x: Array, ar: Array) -> Array:
    """A(q) x along the first axis."""
    return filtered(np.concatenate([[1.0], ar]), np.ones(1), np.ascontiguousarray(x.T)).T if ar.any() else x


def filtered(b: Array, a: Array, rows: Array) -> Array:
    """b(q) / a(q) of every row, from rest, with a[0] = 1; of the shape of ``rows``, (n,) or (k, n)."""
    return np.asarray(filter_rows(b, a, np.atleast_2d(rows), np.array([0, rows.shape[-1]])).reshape(rows.shape))


def pieces_of(seen: Bools) -> list[slice]:
    """The runs of logged samples between holes."""
    return [slice(int(a), int(b)) for a, b in zip(*runs(seen), strict=True)]


def left(s: Record, m: ChainHypothesis, kappa: float = np.inf) -> Array:
    """A(q) (y - y_hat), shape (n,); zero in holes, and no error in a hole enters those after it."""
    return left_by(s, m, simulate(s, m, kappa)[2])


def left_by(s: Record, m: ChainHypothesis, y_hat: Array) -> Array:
    """The same of a given free run."""
    return whiten(finite(s.y - y_hat, LARGEST) * s.seen, m.ar) * s.seen


def finite(x: Array, unknown: float = 0.0) -> Array:
    """The numbers held within `LARGEST`, with ``unknown`` for NaN: a run may have diverged."""
    held = np.clip(x, -LARGEST, LARGEST)
    held[np.isnan(held)] = unknown
    return held


def rms_dx(s: Record, m: ChainHypothesis) -> float:
    """Root mean square of dx, never zero."""
    return max(rms(np.diff(simulate(s, m)[0])), LEAST)


def sizes(s: Record, m: ChainHypothesis) -> Sizes:
    """Sizes of the signals under the model."""
    x, v, _ = simulate(s, m)

    def size(a: Array) -> float:
        return max(rms(a), LEAST)

    peaks = (max(float(np.quantile(np.abs(a), 0.999)), LEAST) for a in (s.u, x))
    u_peak, x_peak = peaks
    return Sizes(
        size(s.u), u_peak, size(x), x_peak, size(np.diff(x)), size(v), max(float(np.std(s.y[s.seen])), LEAST),
        s.u.size * s.dt, s.dt, s.step,
    )  # fmt: skip


# --- the residual, robustly ----------------------------------------------------------------------
def variance_of(e: Array) -> float:
    """Variance of the errors without outliers: a Gaussian over a low floor, by expectation-maximisation."""
    variance = float(np.mean(e**2)) + 1e-300
    for _ in range(20):
        w = share(e**2 / variance)
        new = float(np.sum(w * e**2) / max(float(np.sum(w)), 1.0)) + 1e-300
        done = abs(new - variance) < 1e-4 * variance
        variance = new
        if done:
            break
    return variance


def share(z: Array) -> Array:
    """Weight of squared errors z in the capped cost: its derivative, one if z is small and zero for an outlier."""
    g = np.exp(-0.5 * z)
    return np.asarray(g / (g + np.exp(-0.5 * CAP)))


def capped(z: Array) -> Array:
    """Cost of squared errors z, in variances: z itself if it is small, at most `CAP`."""
    floor = np.exp(-0.5 * CAP)
    return np.asarray(-2.0 * np.log((np.exp(-0.5 * z) + floor) / (1.0 + floor)))


def deviance(e: Array) -> float:
    """Sum of squares that has the same likelihood as the capped one."""
    variance = variance_of(e)
    return e.size * variance * float(np.exp(np.mean(capped(e**2 / variance)) - 1.0))


def held(e: Array) -> Array:
    """The errors, clipped at four robust deviations and scaled so that their squares sum to `deviance`."""
    out = clipped(e)
    return out * float(np.sqrt(deviance(e) / max(float(out @ out), 1e-300)))


def clipped(e: Array) -> Array:
    """The errors clipped at `OUTLYING` robust deviations."""
    limit = clip_at(e)
    return np.clip(e, -limit, limit)


def clip_at(e: Array) -> float:
    """`OUTLYING` robust deviations of errors."""
    return OUTLYING * MAD * float(np.median(np.abs(e))) + 1e-300


def colour(pieces: list[Array]) -> Array:
    """An autoregression of the residual of a model, piece by piece, without its outliers; shape (`AR_ORDER`,)."""
    ar = np.zeros(AR_ORDER)
    for _ in range(3):
        white = [whiten(r, ar) for r in pieces]
        limit, poles = clip_at(np.concatenate(white)), np.concatenate([[1.0], ar])
        ar = burg([np.asarray(lfilter([1.0], poles, np.clip(e, -limit, limit))) for e in white])
    return ar


def response(ar: Array, n: int) -> Array:
    """Impulse response of 1 / A, shape (n,)."""
    return np.asarray(lfilter([1.0], np.concatenate([[1.0], ar]), np.eye(1, n)[0]))


def loudness(ar: Array) -> float:
    """Rms of unit white noise after 1 / A."""
    return float(np.sqrt(np.sum(response(ar, 400) ** 2)))


def burg(pieces: list[Array]) -> Array:
    """Coefficients of an autoregression with its roots inside `LONGEST_COLOUR` (Burg 1975, PhD thesis, Stanford)."""
    pairs, a = [(x[1:], x[:-1]) for x in pieces], np.ones(1)
    for _ in range(AR_ORDER):
        power = sum(float(f @ f + b @ b) for f, b in pairs)
        k = -2.0 * sum(float(f @ b) for f, b in pairs) / max(power, 1e-300)
        a = np.concatenate([a, [0.0]]) + k * np.concatenate([[0.0], a[::-1]])
        pairs = [(f[1:] + k * b[1:], b[:-1] + k * f[:-1]) for f, b in pairs]
    largest = float(np.abs(np.roots(a)).max(initial=0.0))
    if largest > LONGEST_COLOUR:
        a = a * (LONGEST_COLOUR / largest) ** np.arange(a.size)
    return a[1:]


# --- the free numbers as one vector --------------------------------------------------------------
def to_vector(m: ChainHypothesis) -> Array:
    """theta, then the free numbers of the effects."""
    return np.concatenate([m.theta, *(t.vector() for t in m.terms)])


def from_vector(m: ChainHypothesis, x: Array) -> ChainHypothesis:
    """The inverse of `to_vector`."""
    n = m.theta.size
    return dataclasses.replace(m, theta=np.array(x[:n], dtype=float), terms=with_vectors(m.terms, x[n:]))


def bounds(m: ChainHypothesis, z: Sizes) -> tuple[Array, Array]:
    """(low, high) of the vector."""
    ends = [(-np.inf, np.inf)] * m.theta.size
    for t in m.terms:
        for i in t.free:
            low, high = t.kind.range_of(i, z)
            ends.append((np.log(low), np.log(high)) if t.kind.ratios(i) else (low, high))
    return np.array(ends)[:, 0], np.array(ends)[:, 1]


def sensitivities(s: Record, m: ChainHypothesis, kappa: float, at: tuple[Array, Array, Array] | None = None) -> Array:
    """Derivatives of A(q) (y - y_hat) by the vector of `to_vector`; shape (n, p).

    They are exact for the law's weights, c and d if nothing acts on the reading; the others are forward differences.
    ``at`` is the free run of `simulate` at this sharpness, if there is one.
    """
    x, v, y = at or simulate(s, m, kappa)
    vector, p = to_vector(m), m.theta.size
    _, _, weights, up, down = s.blocks
    moved = np.arange(vector.size) if m.at_sensor else np.r_[: weights.start, p : vector.size]
    out = np.zeros((vector.size, s.u.size))
    fine = np.array([True] * p + [bool(t.kind.linear) for t in m.terms for _ in t.free])
    steps = np.where(fine, SMALL * np.maximum(np.abs(vector), 0.05), 1e-4)[moved]
    out[moved] = _differences(s, m, moved, steps, kappa, y)
    # a weight or a size has the unit of its signals, so its step is set by what it does to the output
    for _ in range(3):  # what rounding leaves of a step that is by far too small is not its size yet
        does = np.sqrt(np.mean(out[moved] ** 2, axis=1)) * steps / max(rms(s.y), LEAST)
        off = linear_numbers(s, m)[moved] & (does > 0.0) & ((does < SMALL**1.5) | (does > SMALL**0.5))
        if not off.any():
            break
        steps[off] *= SMALL / does[off]
        out[moved[off]] = _differences(s, m, moved[off], steps[off], kappa, y)
    if not m.at_sensor:
        c, d = (np.concatenate([first, m.theta[block]]) for first, block in (([0.0, 1.0], up), ([1.0], down)))
        out[weights] = filtered(c, d, law_values(s.law.codes, s.law.shapes, x, np.diff(x, prepend=0.0), kappa))
        for block, first, signal in ((up, 2, v), (down, 1, -y)):
            late = filtered(np.ones(1), d, signal)
            for delay, i in enumerate(range(block.start, block.stop), start=first):
                out[i, delay:] = late[:-delay]
    return -whiten(finite(out).T, m.ar)


def _differences(s: Record, m: ChainHypothesis, moved: Integers, steps: Array, kappa: float, y: Array) -> Array:
    """Forward differences of y_hat by some numbers of the vector, shape (k, n); ``y`` is that of the model itself."""
    others = np.tile(to_vector(m), (moved.size, 1))
    others[np.arange(moved.size), moved] += steps
    return finite(_at_vectors(s, m, others, kappa) - y) / steps[:, None]


def linear_numbers(s: Record, m: ChainHypothesis) -> Bools:
    """Which numbers of the vector are weights of the law or sizes of effects, which have units; shape (p,)."""
    weights = np.zeros(m.theta.size, dtype=bool)
    weights[s.blocks[2]] = True
    return np.concatenate([weights, *([i < t.kind.linear for i in t.free] for t in m.terms)]).astype(bool)


def units_of(s: Record, m: ChainHypothesis, rows: Array, run: tuple[Array, Array, Array]) -> Array:
    """The unit in which a fit counts each number of the vector, shape (p,), from its column of ``rows`` (n, p).

    A weight or a size is counted by what moves the output by its own rms, every other number by one.  A term of the law
    that is rounding error at all x of the record, such as a kink far away from them, gets zero.
    """
    x = run[0]
    dx = np.diff(x, prepend=0.0)
    size = np.sqrt(np.mean(rows**2, axis=0))
    out = np.where(linear_numbers(s, m) & (size > 0.0), max(rms(s.y), LEAST) / np.where(size > 0.0, size, 1.0), 1.0)
    corners = FAR * np.array([[1.0, 1.0, -1.0, -1.0], [1.0, -1.0, 1.0, -1.0]])
    far, fast = corners[0] * np.abs(x).max(), corners[1] * np.abs(dx).max()
    there = np.abs(law_values(s.law.codes, s.law.shapes, far, fast, np.inf))
    here = np.abs(law_values(s.law.codes, s.law.shapes, x, dx, np.inf))
    out[s.blocks[2]][here.max(axis=1) <= UNSEEN * there.max(axis=1)] = 0.0
    return out


def stable(s: Record, m: ChainHypothesis) -> ChainHypothesis:
    """The model with its poles moved inside the unit circle, as the library's system requires."""
    theta = m.theta.copy()
    _, b, _, _, d = s.blocks
    for part in (b, d):
        theta[part] = stabilised(np.concatenate([[1.0], theta[part]]))[1:]
    return dataclasses.replace(m, theta=theta)


def made(s: Record, m: ChainHypothesis, rng: np.random.Generator) -> Record:
    """A record that the model makes from the same input, with Gaussian noise of the colour and size of its residual.

    It is rounded to the same grid: rounding errors are a function of the output, not noise, and whatever explains them
    in the record must find them here too.
    """
    variance = max(variance_of(left(s, m)[s.fit]) - (1.0 + float(m.ar @ m.ar)) * s.step**2 / 12.0, 0.0)
    noise = lfilter([1.0], np.concatenate([[1.0], m.ar]), rng.standard_normal(s.u.size + 200))[200:]
    y = chain_free_run(s, m) + np.sqrt(variance) * np.asarray(noise)
    # readings that are never negative have also lost the sign of their noise
    if any(t.kind.folds for t in m.terms) and float(s.y.min()) >= 0.0:
        y = np.abs(y)
    if s.step:
        y = s.y[0] + s.step * np.round((y - s.y[0]) / s.step)
    return s.with_output(y)


def numbers_of(s: Record, m: ChainHypothesis) -> dict[str, Any]:
    """Natural parameters by name."""
    a, b, _, c, d = s.blocks
    names = [f"a_{i}" for i in range(2, a.stop - a.start + 2)] + [f"b_{i}" for i in range(1, b.stop - b.start + 1)]
    names += list(s.law.labels) + [f"c_{i}" for i in range(2, c.stop - c.start + 2)]
    names += [f"d_{i}" for i in range(1, d.stop - d.start + 1)]
    return dict(zip(names, map(float, m.theta), strict=True))
