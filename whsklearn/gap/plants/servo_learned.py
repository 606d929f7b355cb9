"""Learn what follows the motion without having a name, as a sparse sum of splines over one or two signals.

In the inverse view drive = J a + sum of terms + sum of curves is linear in the heights of the curves. A curve is a row
of cubic B-splines with a penalty on second differences (Eilers, Marx 1996, Stat. Sci. 11(2), 89-121). The base model
and the curve are solved together. Cross-validation over ten blocks of the record decides how smooth the curve is, over
which signals it goes, and whether there is one at all. Simple symmetric forms come first: a function of the angle, a
brake that depends on speed and is the same in both directions, and friction and damping that depend on the angle. A
free function of the velocity or of the drive is used only if those leave a larger residual.
"""

from __future__ import annotations

import dataclasses
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag
from scipy.sparse import csc_array, csr_array, diags_array

from whsklearn.effects import LearnedTorque
from whsklearn.effects.equations import hill
from whsklearn.gap import least_squares as ols
from whsklearn.gap.diagnosis import Curve
from whsklearn.gap.plant import PAYS, WORTH_A_WORD
from whsklearn.gap.plants.servo_candidates import TWO_MASS, Candidate, ColumnSignals
from whsklearn.gap.plants.servo_inverse import weighted
from whsklearn.gap.plants.servo_model import ServoHypothesis, ServoTerm
from whsklearn.gap.record import Array
from whsklearn.identification.joint_least_squares import BLOCKS

# Learned curves of one record: each is a function of one or two signals (`benchmarks.learned`).
MOST_CURVES = 2
KNOTS = (16, 48, 120)  # hills over the range of a signal; the finest are half a percent of the travel wide
PENALTIES = np.geomspace(1e-5, 1.0, 6)  # of second differences, as a share of the columns' power
# Gain of a learned curve, cross-validated: 25 kept every true first effect and no false one on 15 real logs and 21
# blind ones.
LEAST_GAIN = 25.0
PER_SAMPLE = 4  # samples kept for each judged one: 20 per period of the view's cut-off
RIDGE = 1e-4  # the same for the heights themselves, so that the base model explains whatever it can


class Form(NamedTuple):
    """One kind of curve: its name in `LearnedTorque.over`, its signals, its period and the range of the hills."""

    over: str
    period: float
    low: float
    high: float

    @property
    def kind(self) -> Candidate:
        """The candidate that one hill is."""
        return Candidate(LearnedTorque, (("over", self.over),))

    @property
    def knots(self) -> tuple[int, ...]:
        """Numbers of hills to try: effects of position may be narrow, those of speed and drive are not."""
        return KNOTS if self.over.startswith("position") else KNOTS[:-1]

    def along(self, s: ColumnSignals) -> Array:
        """The signal over which the hills stand."""
        if self.over == "speed":
            return np.abs(s.velocity)
        x = np.asarray(getattr(s, self.over.split()[0]))
        return np.mod(x, self.period) if self.period else x

    @property
    def signals(self) -> tuple[str, ...]:
        """Names of the signals in plain words."""
        first, *second = self.over.split(" and ")
        return ("angle in the turn" if self.period else first, *second)


class CurveFit(NamedTuple):
    """A curve solved together with the base model and the curves before it."""

    form: Form
    centres: Array
    width: float
    columns: Array  # columns, penalty (n, k), (k, k): columns and penalty of its k hills
    penalty: Array
    # weights of all columns: the linear numbers of the terms, the heights of earlier curves, its own heights
    numbers: Array
    covariance: Array  # (k, k): covariance of its heights
    error: float  # cross-validated sum of squares
    inertia: float  # inertia, timing: inertia and timing of the model without the curve; timing in samples
    timing: float


def forms(view: Any, torque: Array | None) -> list[Form]:
    """Curves that a record can show, simple ones first."""
    s = view.motion
    low, high = (float(x) for x in np.quantile(s.position, [0.0, 1.0]))
    places = [(0.0, low, high)]
    if high - low > 2 * np.pi:  # a function that repeats every turn needs the hills of one turn only
        places.insert(0, (2 * np.pi, 0.0, 2 * np.pi))
    fast = float(np.quantile(np.abs(s.velocity), 0.999))
    out = [Form("speed", 0.0, 0.0, fast)]
    for over in ("position", "position and direction", "position and velocity"):
        out += [Form(over, *place) for place in places]
    out.append(Form("velocity", 0.0, -fast, fast))
    if torque is not None:
        most = float(np.quantile(np.abs(torque), 0.999))
        out.append(Form("drive", 0.0, -most, most))
    return out


def learn(view: Any, model: ServoHypothesis) -> tuple[ServoHypothesis, tuple[Curve, ...]] | None:
    """(model with learned curves for what it still lacks, the curves); or None if cross-validation supports none."""
    if any(t.kind.code in TWO_MASS for t in model.terms):
        return None
    torque = view.torque(model)
    problem = CurveProblem(view, model, torque)
    found: list[CurveFit] = []
    while len(found) < MOST_CURVES:
        open_forms = [f for f in forms(view, torque) if f not in [g.form for g in found]]
        fits = [fit for f in open_forms for n in f.knots if (fit := problem.fitted(f, n)) is not None]
        if not fits:
            break
        best = min(f.error for f in fits)
        gain = problem.gain(best)
        if gain < LEAST_GAIN or 1.0 - best / problem.error < WORTH_A_WORD:
            break
        chosen = next(f for f in fits if problem.gain(f.error) > gain - PAYS)  # the simplest of the best
        found.append(chosen)
        problem = CurveProblem(view, model, torque, tuple(found))
    if not found:
        return None
    # the model's own numbers and the heights of the hills of every curve, solved together with the last one
    hills = np.cumsum([f.centres.size for f in found])
    own, *heights = np.split(found[-1].numbers, found[-1].numbers.size - hills[-1] + np.r_[0, hills[:-1]])
    curves = tuple(curve_of(f, w) for f, w in zip(found, heights, strict=True))
    return with_curves(view, model, found, own, heights), curves


class Normal(NamedTuple):
    """Normal equations of the blocks of a record, from which every penalty is judged."""

    grams: Array  # (b, k, k): Z'Z of each
    rights: Array  # (b, k): Z'y
    powers: Array  # (b,): y'y


class CurveProblem:
    """Penalised least squares of one record: friction and effects of the base model, and the curves found so far."""

    def __init__(self, view: Any, model: ServoHypothesis, torque: Array | None, curves: tuple[CurveFit, ...] = ()):
        self.view, self.model, self.torque, self.curves = view, model, torque, curves
        fitted, full, target, sizes, _ = view.solved(model)
        x, positive = view.columns(model, torque)
        self.inertia, self.timing, p = float(sizes[0]), fitted.timing, x.shape[1]
        # a curve over the position of a periodic motion can replace inertia and timing, so these are held
        told = view.told(model)
        self.target = weighted((target - full[:, p:] @ sizes[p:] - x[:, 0] * self.inertia)[view.at], told)
        base = x[view.at, 1:]
        self.base, self.positive = base if told is None else base * told[:, None], positive[1:]
        self.signals, smoother = thinned(view, view.motion if torque is None else view.motion._replace(drive=torque))
        self.smoother = smoother if told is None else diags_array(told) @ smoother
        nothing = np.zeros((0, 0))
        self.error = (
            curves[-1].error if curves else self.cross_validated(self.normal(self.base), self._penalty(nothing))
        )

    def _penalty(self, new: Array) -> Array:
        """Quadratic form of [base, earlier curves, heights of the new curve]."""
        base = ols.RIDGE * self.target.size * np.diag(np.mean(self.base**2, axis=0))
        return block_diag(base, *(c.penalty for c in self.curves), new)

    def columns(self, new: Array) -> Array:
        """Columns of the base, the earlier curves and the new hills, side by side."""
        return np.column_stack([self.base, *(c.columns for c in self.curves), new])

    def normal(self, z: Array) -> Normal:
        """Normal equations of [columns] on the target."""
        blocks = [*zip(np.array_split(z, BLOCKS), np.array_split(self.target, BLOCKS), strict=True)]
        grams, rights = (np.array(x) for x in zip(*((zb.T @ zb, zb.T @ yb) for zb, yb in blocks), strict=True))
        return Normal(grams, rights, np.array([yb @ yb for _, yb in blocks]))

    def solved(self, normal: Normal, penalty: Array) -> tuple[Array, NDArray[np.bool_]]:
        """Weights of all columns; columns that must be positive but are not are dropped."""
        gram, right = normal.grams.sum(axis=0) + penalty, normal.rights.sum(axis=0)
        free = np.diag(gram) > 0.0
        numbers = np.zeros(free.size)
        for _ in range(self.positive.size):
            numbers[:] = 0.0
            numbers[free] = scaled_solve(gram[np.ix_(free, free)], right[free])
            bad = np.flatnonzero((numbers[: self.positive.size] < 0.0) & self.positive)
            if not bad.size:
                break
            free[bad[np.argmin(numbers[bad])]] = False
        return numbers, free

    def cross_validated(self, normal: Normal, penalty: Array) -> float:
        """Sum of squares of every block predicted from the others."""
        _, free = self.solved(normal, penalty)
        grams, rights = normal.grams[:, free][:, :, free], normal.rights[:, free]
        # a hill that only one block reaches cannot be determined by the others: its penalty keeps it at zero
        gram = grams.sum(axis=0) + penalty[np.ix_(free, free)]
        numbers = scaled_solve(gram - grams, rights.sum(axis=0) - rights)
        predicted = np.einsum("bij,bj->bi", grams, numbers)
        return float(np.sum(normal.powers) + np.sum(numbers * (predicted - 2.0 * rights)))

    def gain(self, error: float) -> float:
        """n_eff ln(CV before / CV after), as for every candidate of this view."""
        return float(self.view.n_effective * np.log(self.error / max(error, 1e-300)))

    def hills(self, form: Form, n: int) -> tuple[Array, Array, float]:
        """(weighted columns of n hills behind the Gaussian at the judged samples, their centres, their width)."""
        if form.period:
            width = form.period / n
            centres = width * np.arange(n)
        else:
            width = (form.high - form.low) / (n - 1)
            centres = form.low + width * np.arange(-1, n + 1)
        s = self.signals
        x = form.along(s)
        order = np.argsort(x)
        rising = x[order]
        ways = (-form.period, 0.0, form.period) if form.period else (0.0,)
        rows, values = [], []
        for c in centres:  # on its own samples only: a hill is four widths wide
            ends = np.searchsorted(rising, [(c + way - 2.0 * width, c + way + 2.0 * width) for way in ways])
            at = np.concatenate([order[a:b] for a, b in ends])
            part = ColumnSignals(s.time[at], s.position[at], s.velocity[at], s.acceleration[at], s.drive[at], s.kappa)
            values.append(form.kind.unit_columns((float(c), width, form.period), part)[:, 0])
            rows.append(at)
        first = np.cumsum([0, *(r.size for r in rows)])
        raw = csc_array((np.concatenate(values), np.concatenate(rows), first), shape=(x.size, centres.size))
        return (self.smoother @ raw).toarray(), centres, width

    def fitted(self, form: Form, n: int) -> CurveFit | None:
        """The curve of a form at its best smoothness; None if the record does not reach its hills."""
        new, centres, width = self.hills(form, n)
        seen = np.sqrt(np.mean(new**2, axis=0))
        if seen.max() <= 0.0 or not np.all(np.isfinite(new)):
            return None
        k, power = centres.size, self.target.size * float(np.mean(seen**2))
        rough, z = second_differences(k, bool(form.period)), self.columns(new)
        penalties = [power * (weight * rough + RIDGE * np.eye(k)) for weight in PENALTIES]
        normal = self.normal(z)
        errors = [self.cross_validated(normal, self._penalty(p)) for p in penalties]
        own = penalties[int(np.argmin(errors))]
        penalty = self._penalty(own)
        numbers, free = self.solved(normal, penalty)
        left = self.target - z @ numbers
        inverse = np.linalg.pinv((normal.grams.sum(axis=0) + penalty)[np.ix_(free, free)])[-k:, -k:]
        variance = float(left @ left) / max(self.view.n_effective - z.shape[1], 1.0)
        covariance = variance * inverse * self.target.size / self.view.n_effective
        return CurveFit(form, centres, width, new, own, numbers, covariance, min(errors), self.inertia, self.timing)


def scaled_solve(gram: Array, right: Array) -> Array:
    """Solutions of systems (..., k, k) whose columns differ in unit, and so in size by many powers of ten."""
    scale = 1.0 / np.sqrt(np.maximum(np.diagonal(gram, axis1=-2, axis2=-1), 1e-300))
    scaled = gram * scale[..., :, None] * scale[..., None, :]
    return np.asarray(scale * np.linalg.solve(scaled, (scale * right)[..., None])[..., 0])


def thinned(view: Any, s: ColumnSignals) -> tuple[ColumnSignals, csr_array]:
    """(signals at the lowest rate that the view's filter allows, its Gaussian from these to the judged samples)."""
    step = max(d for d in range(1, view.every + 1) if view.every % d == 0 and (d == 1 or view.every // d >= PER_SAMPLE))
    half = view.g.size // 2
    kernel = view.g[half % step :: step]
    kernel = kernel * (view.g.sum() / kernel.sum())
    time, position, velocity, acceleration, drive = (np.ascontiguousarray(x[::step]) for x in s[:5])
    thin = ColumnSignals(time, position, velocity, acceleration, drive, s.kappa)
    reach = np.arange(kernel.size) - kernel.size // 2
    taken = np.clip(view.at[:, None] * (view.every // step) + reach, 0, time.size - 1)
    first = kernel.size * np.arange(view.at.size + 1)
    weights = np.tile(kernel, view.at.size)
    return thin, csr_array((weights, taken.ravel(), first), shape=(view.at.size, time.size))


def second_differences(k: int, periodic: bool) -> Array:
    """D'D of the second differences of k heights, across the turn if they are periodic; shape (k, k)."""
    eye = np.eye(k)
    d = np.roll(eye, 1, axis=1) - 2 * eye + np.roll(eye, -1, axis=1)
    d = d if periodic else d[1:-1]
    return d.T @ d


def with_curves(
    view: Any, model: ServoHypothesis, fits: list[CurveFit], own: Array, heights: list[Array]
) -> ServoHypothesis:
    """The model with its own numbers as solved beside the curves, and with the hills of the curves as terms."""
    last = fits[-1]
    model = view.with_sizes(model, np.array([last.inertia, *own, last.timing * view.scene.dt]))
    terms = list(model.terms)
    for f, weights in zip(fits, heights, strict=True):
        for centre, weight in zip(f.centres, weights, strict=True):
            terms.append(ServoTerm(f.form.kind, (float(weight), float(centre), f.width, f.form.period)))
    return dataclasses.replace(model, terms=tuple(terms))


def curve_of(fit: CurveFit, weights: Array) -> Curve:
    """The curve at 200 places, with two standard deviations on either side."""
    x = np.linspace(fit.form.low, fit.form.high, 200)
    d = x[:, None] - fit.centres[None, :]
    if fit.form.period:
        d -= fit.form.period * np.round(d / fit.form.period)
    basis = np.array([[hill(z) for z in row] for row in d / fit.width])
    band = 2.0 * np.sqrt(np.maximum(np.einsum("ij,jk,ik->i", basis, fit.covariance, basis), 0.0))
    return Curve(fit.form.signals, x, basis @ weights, band)
