"""Which number changed: how much of the whole difference between two estimates a change in each would explain.

The difference delta of two estimates with covariance S speaks for a hypothesis "delta = E s" by a Student law with as
many degrees of freedom as S has: twice the log likelihood falls from (nu + p) ln(1 + chi0 / nu) to the same of chi_E.

A gain scales every number a of the first record, which is known with an error itself: b - g a has the covariance
B + g^2 A, and where both records follow one path, so that d = b - a is known by itself, d - (g - 1) a has
D + (g - 1)^2 A.  Its determinant counts too: without it a large g explains everything by the errors of a.  Numbers of
which none is well known alone may still all be three times as large.

A number that changed alone must differ by itself too, with all others free.  To hold the others equal is to rely on the
correlations of the two covariances, which ten blocks of a record hardly determine where the numbers are six or nine
(Hotelling's T-squared loses a degree of freedom for each).
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import minimize_scalar
from scipy.stats import f as snedecor
from scipy.stats import t as student

from whsklearn.compare.comparison import Change
from whsklearn.compare.estimate import Estimate, Summand, degrees_of, estimate, from_a_cold_start, pooled
from whsklearn.compare.rows import Array, Regression, difference
from whsklearn.identification.payload import MASS, slopes_at

PRIOR = 0.3  # of the rms drive: a typical change, for the price of a free number (Occam)
BESIDE = 4.0  # nats: what explains the difference e^4 times worse is no rival
LEAST = 0.005  # of the rms drive: smaller changes are not reported
MOST_CHANGES = 3
MOST_GAIN = 20.0  # times, or a twentieth: beyond it one of the records shows no drive
OF_ZERO = 2.0  # standard errors: a load that is nearer to zero is none (95 %)
LOADS = ("mass at ", "moment at ")
FURTHEST = 0.5  # m, of a load's centre from the joint that carries it, while it is sought
N_ROUNDS = 8
N_GAINS = 61  # of the grid from which the best gain is sought: a tenth apart


@dataclass(frozen=True)
class Difference:
    """The second estimate minus the first.

    >>> noise = (Summand(np.diag([1e-4, 1e-4]), 50.0),)
    >>> first, second = (Estimate("log", np.array([inertia, 0.2]), noise, 0.1, {}) for inertia in (1.0, 1.3))
    >>> d = Difference(("inertia", "viscous"), {}, first, second, first.values, first.errors, np.ones(2))
    >>> d.values.round(2).tolist()
    [0.3, 0.0]
    """

    names: tuple[str, ...]  # names of the p numbers
    covers: dict[str, tuple[str, ...]]  # name -> names of numbers that change with it
    first: Estimate  # first, second: the second is the difference itself if both records follow one path
    second: Estimate
    mean: Array  # mean, errors (p,): the numbers themselves, pooled, and their standard errors
    errors: Array
    sizes: Array  # (p,): rms drive per unit of each number, as a share of the rms drive at which it is paid
    # name -> directions in which a change moves the numbers; if empty, every named number may change
    changes: dict[str, Array] = field(default_factory=dict)
    one_path: bool = False
    gain: float = 1.0  # factor on the first estimate

    @cached_property
    def forces(self) -> Array:
        """1 for every number that a gain scales, 0 for the age of the drive, shape (p,)."""
        return np.array([float(not n.startswith("delay")) for n in self.names])

    @cached_property
    def factor(self) -> Array:
        """By which the first estimate is subtracted, shape (p,)."""
        return 1.0 + (self.gain - 1.0) * self.forces - float(self.one_path)

    @cached_property
    def values(self) -> Array:
        """Of the difference, shape (p,)."""
        return np.asarray(self.second.values - self.factor * self.first.values)

    @cached_property
    def parts(self) -> tuple[Summand, ...]:
        """Of its covariance."""
        k = np.outer(self.factor, self.factor)
        return (*self.second.parts, *(Summand(k * p.covariance, p.degrees) for p in self.first.parts))

    @cached_property
    def weight(self) -> Array:
        """Inverse of its covariance, shape (p, p)."""
        return np.linalg.inv(np.sum([part.covariance for part in self.parts], axis=0))

    @cached_property
    def volume(self) -> float:
        """Logarithm of the determinant of its covariance."""
        return -float(np.linalg.slogdet(self.weight)[1])

    def before(self, rest: Array) -> Array:
        """The first numbers as estimated from both records, shape (p,), given how much of the difference is noise."""
        return np.asarray(self.first.values + self.first.covariance @ (self.factor * (self.weight @ rest)))


@dataclass(frozen=True)
class Hypothesis:
    """One possible change.

    >>> Hypothesis("coulomb", np.eye(3)[:, [1]]).basis.ravel().tolist()  # of three numbers the second alone
    [0.0, 1.0, 0.0]
    """

    name: str
    basis: Array  # (p, k): directions in which the numbers change
    body: Array | None = None  # (p, 10): of a load: what the mass, the moments and the inertias of a link change


@dataclass(frozen=True)
class FittedHypothesis:
    """A hypothesis, fitted together with others.

    >>> noise = (Summand(np.diag([1e-4, 1e-4]), 50.0),)
    >>> first, second = (Estimate("log", np.array([inertia, 0.2]), noise, 0.1, {}) for inertia in (1.0, 1.3))
    >>> d = Difference(("inertia", "viscous"), {}, first, second, first.values, first.errors, np.ones(2))
    >>> inertia = weigh(d, hypotheses(d)[0], np.zeros((2, 0)))
    >>> inertia.step.round(2).tolist(), inertia.p_value < 1e-6
    ([0.3], True)
    """

    hypothesis: Hypothesis
    step: Array  # (k,): step along its basis
    errors: Array  # (k,): standard errors
    chi2: float  # improvement in chi-squared of the difference
    evidence: float  # in nats, after subtracting the price of its numbers
    degrees: float  # degrees of freedom of the step's covariance
    p_value: float  # probability of such an improvement by chance, for one hypothesis
    size: float  # rms of the change in the drive, as a share of the rms drive
    taken: Array  # (k,): the part of the step that ``after`` no longer holds: all of a gain, nothing of another change
    after: Difference  # the difference less that part


def hypotheses(d: Difference) -> list[Hypothesis]:
    """One hypothesis per named number, and one for the gain of an axis: all scaled alike but the drive's age."""
    unit = np.eye(d.values.size)
    out = [
        Hypothesis(name, basis[:, :MASS], basis) if name.startswith(LOADS) else Hypothesis(name, basis)
        for name, basis in d.changes.items()
    ]
    if out:  # of an arm, with a gain of every joint
        return out
    for name in dict.fromkeys(d.names):
        those = (name, *d.covers.get(name, ()))
        out.append(Hypothesis(name, unit[:, [i for n in those for i, m in enumerate(d.names) if m == n]]))
    return [*out, Hypothesis("gain", (d.forces * d.mean)[:, None])]


def own_numbers(d: Difference, h: Hypothesis) -> Array:
    """Indices of the numbers of an axis that a hypothesis names; none of a gain or of an arm's directions."""
    return np.array([i for i, n in enumerate(d.names) if n == h.name and not d.changes], dtype=np.intp)


def alone(d: Difference, h: Hypothesis) -> float:
    """Probability of such a difference of the hypothesis's own numbers by chance, with all others free.

    Zero where it names none (a gain) or a direction among the numbers of an arm.
    """
    at = own_numbers(d, h)
    if at.size == 0:
        return 0.0
    own = np.eye(d.values.size)[at]
    covariance = np.linalg.inv(d.weight)[np.ix_(at, at)]
    chi2 = float(d.values[at] @ np.linalg.pinv(covariance, hermitian=True) @ d.values[at])
    return float(snedecor.sf(chi2 / at.size, at.size, degrees_of(d.parts, own)))


def weigh(d: Difference, h: Hypothesis, given: Array) -> FittedHypothesis:
    """Fit a hypothesis in addition to the directions ``given``, shape (p, m), that are assumed to have changed.

    The evidence is minus infinity for a load that is none.
    """
    nothing, after = _left(d, given), d
    taken = np.zeros(h.basis.shape[1])
    if h.name == "gain":
        after = replace(d, gain=best_gain(d, given))
        known = d.forces * after.before(after.values - _project(after.values, after.weight, given))
        h, taken = Hypothesis("gain", known[:, None]), np.array([after.gain - 1.0])
    if h.body is not None:
        h = replace(h, basis=at_one_point(h.body, d, given))
    w = after.weight
    beside = h.basis - _project(h.basis, w, given)
    information = beside.T @ w @ beside
    inverse = np.linalg.pinv(information, rcond=1e-10, hermitian=True)
    to = inverse @ beside.T @ w
    step = taken + to @ after.values
    p, k = h.basis.shape
    left = _left(after, np.column_stack([given, h.basis])) + after.volume - d.volume
    chi2 = float(np.clip(nothing - left, 0.0, nothing))
    nu = degrees_of(d.parts, np.eye(p))
    gained = 0.5 * (nu + p) * (np.log1p(nothing / nu) - np.log1p((nothing - chi2) / nu))
    size = float(np.linalg.norm(d.sizes * (h.basis @ step)))
    errors = np.sqrt(np.maximum(np.diag(inverse), 0.0))
    if h.body is not None and not shown(h.name, step, inverse):
        gained = -np.inf  # what moved is an inertia, and no load
    own = degrees_of(after.parts, to)
    return FittedHypothesis(
        h, step, errors, chi2, gained - _occam(d, h, information), own,
        float(snedecor.sf(chi2 / k, k, own)), size, taken, after,
    )  # fmt: skip


def load_of(name: str, step: Array, covariance: Array) -> tuple[float, float]:
    """(mass in kg, or moment about its joint in kg m, of a load; its standard error)."""
    if name.startswith("mass at "):
        return float(step[0]), float(np.sqrt(max(covariance[0, 0], 0.0)))
    moment = float(np.linalg.norm(step[1:4]))
    along = step[1:4] / max(moment, 1e-300)
    return moment, float(np.sqrt(max(float(along @ covariance[1:4, 1:4] @ along), 0.0)))


def shown(name: str, step: Array, covariance: Array) -> bool:
    """Whether a load's mass or moment is beyond two standard errors."""
    size, error = load_of(name, step, covariance)
    return abs(size) > OF_ZERO * error


def at_one_point(body: Array, d: Difference, given: Array) -> Array:
    """Directions (p, 4) in which mass and moments of a load move the numbers, if all of it is at one place.

    See `whsklearn.identification.payload.slopes_at`.
    """
    w = d.weight
    rest = d.values - _project(d.values, w, given)
    basis = body[:, :4]
    for _ in range(N_ROUNDS):
        beside = basis - _project(basis, w, given)
        m, *h = np.linalg.pinv(beside.T @ w @ beside, rcond=1e-10, hermitian=True) @ (beside.T @ w @ rest)
        place = np.array(h) / (m if m else np.inf)
        place *= min(1.0, FURTHEST / max(float(np.linalg.norm(place)), 1e-300))
        basis = body @ slopes_at(place)
    return np.asarray(basis)


def best_gain(d: Difference, given: Array) -> float:
    """The factor on all numbers that explains the difference best."""

    def left(log_gain: float) -> float:
        after = replace(d, gain=float(np.exp(log_gain)))
        return _left(after, given) + after.volume  # the numbers themselves are integrated out

    grid = np.linspace(-np.log(MOST_GAIN), np.log(MOST_GAIN), N_GAINS)
    k = int(np.argmin([left(x) for x in grid]))
    ends = grid[max(k - 1, 0)], grid[min(k + 1, N_GAINS - 1)]
    return float(np.exp(minimize_scalar(left, bounds=ends, method="bounded").x))


def _left(d: Difference, given: Array) -> float:
    """Chi-squared that no step along ``given`` explains."""
    rest = d.values - _project(d.values, d.weight, given)
    return float(rest @ d.weight @ rest)


def _project(x: Array, w: Array, given: Array) -> Array:
    if given.shape[1] == 0:
        return np.zeros_like(x)
    return given @ (np.linalg.pinv(given.T @ w @ given, rcond=1e-10, hermitian=True) @ (given.T @ w @ x))


def _occam(d: Difference, h: Hypothesis, information: Array) -> float:
    """Price of the hypothesis's numbers, 1/2 ln det(1 + prior information): the posterior's share of the prior."""
    one = np.linalg.norm(d.sizes[:, None] * h.basis, axis=0)  # rms drive a unit step
    prior = np.divide(PRIOR, one, out=np.zeros_like(one), where=one > 0.0)
    return 0.5 * float(np.linalg.slogdet(np.eye(prior.size) + np.outer(prior, prior) * information)[1])


def shows(f: FittedHypothesis, alpha: float) -> bool:
    """Whether a hypothesis explains more than chance does, more than its numbers cost, and enough to matter."""
    return f.p_value <= alpha and f.evidence >= BESIDE and f.size >= LEAST


def changed(d: Difference, alpha: float) -> list[tuple[FittedHypothesis, list[FittedHypothesis]]]:
    """What changed, the most certain first, each with its rivals; empty if nothing did.

    Of hypotheses that explain the difference about as well, the best for which no other number can stand in is named.
    An offset and a gravity that is nearly constant along the path had tied, and nothing was told.  A second change must
    be as sure as the first beside it, and explain e^4 times more than the first alone.  A load is sought as a point;
    beside it, what the inertias of a body at its link would explain is no change of anything else.
    """
    out: list[tuple[FittedHypothesis, list[FittedHypothesis]]] = []
    given = np.zeros((d.values.size, 0))
    open_to = hypotheses(d)
    while open_to and len(out) < MOST_CHANGES:
        found = sorted((weigh(d, h, given) for h in open_to), key=lambda f: -f.evidence)
        close = [f for f in found if f.evidence > found[0].evidence - BESIDE]
        tested = [close[0], *(f for f in close[1:] if own_numbers(d, f.hypothesis).size)]
        best = next((f for f in tested if shows(f, alpha / len(found)) and alone(d, f.hypothesis) <= alpha), None)
        if best is None:
            break
        rivals = [f for f in close if f is not best]
        out.append((best, rivals))
        d = best.after
        given = np.column_stack([given, best.hypothesis.basis])
        if best.hypothesis.body is not None:
            given = np.column_stack([given, best.hypothesis.body[:, MASS:]])
        open_to = [h for h in open_to if h.name != best.hypothesis.name]
    return out


def smallest(d: Difference, alpha: float) -> dict[str, float]:
    """Name -> the smallest change that would have been detected, in the number's unit (for a pair, its amplitude)."""
    w, every, out = d.weight, hypotheses(d), {}
    nu = degrees_of(d.parts, np.eye(d.values.size))
    for h in every:
        one = np.linalg.norm(d.sizes[:, None] * h.basis, axis=0)
        information = h.basis.T @ w @ h.basis
        inverse = np.linalg.pinv(information, rcond=1e-10, hermitian=True)
        to = inverse @ h.basis.T @ w
        if h.body is not None:  # the others of mass and moments are free
            told = [0] if h.name.startswith("mass at ") else [1, 2, 3]
            error = np.sqrt(max(inverse[i, i] for i in told))
            one, to = one[told], to[told]
        else:
            error = 1.0 / np.sqrt(np.maximum(np.linalg.eigvalsh(information)[0], 1e-300))
        z = float(student.isf(alpha / len(every) / 2.0, degrees_of(d.parts, to)))
        price = 2.0 * (BESIDE + _occam(d, h, information)) / (nu + d.values.size)
        need = max(z, float(np.sqrt(nu * np.expm1(price))))
        if (at := own_numbers(d, h)).size:
            by_itself = float(student.isf(alpha / 2.0, degrees_of(d.parts, np.eye(d.values.size)[at])))
            error = max(float(error), by_itself / need * float(np.sqrt(np.diag(np.linalg.inv(w))[at].max())))
        out[h.name] = max(need * float(error), LEAST / max(float(one.max()), 1e-300))
    return out


# --- the difference between two records, or two groups of records, and what changed, as shown to the reader ----------
def between(rows: list[Regression], first: list[Estimate], second: list[Estimate]) -> Difference:
    """The difference of two groups of estimates, or of two single records themselves if they share one path.

    ``rows``: rows of all records.
    """
    a, b = pooled(first), pooled(second)
    every = pooled([a, b])
    sizes, drives = (np.sqrt(np.mean(x, axis=0)) for x in ([r.sizes**2 for r in rows], [r.drives**2 for r in rows]))
    same = difference(rows[0], rows[1], every.values) if len(rows) == 2 else None
    if same is not None:
        b = estimate(same)
    elif len(first) == len(second) == 1:
        a, b = from_a_cold_start(a, b)
    return Difference(
        rows[0].names, rows[0].covers, a, b, every.values, every.errors, sizes / drives, rows[0].changes,
        one_path=same is not None,
    )  # fmt: skip


def changes_between(d: Difference, units: tuple[str, ...], alpha: float) -> list[Change]:
    """What changed, as shown to the reader."""
    found = changed(d, alpha)
    if not found:
        return []
    n_asked = len(hypotheses(d))
    basis = np.column_stack([f.hypothesis.basis for f, _ in found])
    after = found[-1][0].after
    inverse = np.linalg.pinv(basis.T @ after.weight @ basis, rcond=1e-10, hermitian=True)
    to = inverse @ basis.T @ after.weight
    step = to @ after.values
    start = after.before(after.values - basis @ step)
    step = step + np.concatenate([f.taken for f, _ in found])
    out, i = [], 0
    for best, rivals in found:
        k = best.step.size
        at = slice(i, i + k)
        nu = degrees_of(after.parts, to[at])
        out.append(_told(d, best, rivals, ChangeFit(start, step[at], inverse[at, at], nu), units, n_asked))
        i += k
    return out


class ChangeFit(NamedTuple):
    """The first numbers (p,), the step of one change (k,) with its covariance (k, k), and degrees of freedom.

    >>> fit = ChangeFit(np.array([1.0]), np.array([0.3]), np.array([[1e-4]]), 20.0)
    >>> float(fit.start[0] + fit.step[0]), float(np.sqrt(fit.covariance[0, 0]))  # after it, and its standard error
    (1.3, 0.01)
    """

    start: Array
    step: Array
    covariance: Array
    degrees: float


def _told(
    d: Difference,
    best: FittedHypothesis,
    rivals: list[FittedHypothesis],
    fit: ChangeFit,
    units: tuple[str, ...],
    asked: int,
) -> Change:
    """One change with its numbers from the joint fit of all of them."""
    start, step, covariance, degrees = fit
    h = best.hypothesis
    names = [f.hypothesis.name for f in rivals]

    def change(before: float, after: float, error: float, unit: str, direction: Any = None) -> Change:
        p_value = min(1.0, best.p_value * asked)
        return Change(h.name, before, after, error, degrees, unit, p_value, names, best.size, direction)

    if h.name.partition(" at ")[0] == "gain":
        ratio = 1.0 + float(step[0])  # of the numbers: twice the gain halves all of them
        return change(1.0, 1.0 / ratio, float(np.sqrt(covariance[0, 0])) / ratio**2, "1")
    if h.body is not None:
        size, error = load_of(h.name, step, covariance)
        return change(0.0, size, error, "kg" if h.name.startswith("mass") else "kg m")
    at = [i for i, n in enumerate(d.names) if n == h.name]
    if not at:  # one with other numbers: only its change is known
        return change(0.0, float(step[0]), float(np.sqrt(covariance[0, 0])), "kg m²")
    unit = units[at[0]]
    step, covariance = step[: len(at)], covariance[: len(at), : len(at)]  # what it covers comes behind
    a, b = start[at], start[at] + step
    if len(at) == 1:
        return change(float(a[0]), float(b[0]), float(np.sqrt(covariance[0, 0])), unit)
    size_a, size_b = float(np.linalg.norm(a)), float(np.linalg.norm(b))
    along = (b if size_b > size_a else a) / max(size_a, size_b, 1e-300)
    error = float(np.sqrt(along @ covariance @ along))
    turn = float(np.arctan2(a[0] * b[1] - a[1] * b[0], a @ b)) if len(at) == 2 else 0.0
    across = float(np.sqrt(np.trace(covariance) - error**2)) / max(min(size_a, size_b), 1e-300)
    return change(size_a, size_b, error, unit, (turn, across) if len(at) == 2 and across < 1.0 else None)
