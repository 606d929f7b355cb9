"""The numbers of one record, with a covariance that is valid for coloured or uneven errors and for a wrong model.

Three estimates of the same spread, none of which is sufficient alone. The spectrum of the residual gives the covariance
under stationary noise, whatever its colour.  Leaving out one block at a time shows where the errors are uneven.  The
halves of a record, which must agree, show what a wrong model makes of another part of the path.  Each may only widen.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy.fft import dct, idct

from whsklearn.compare.rows import Array, Regression
from whsklearn.gap.calibration import n_effective, smoothed_power

# Variance of the mean over a record that a drift within it stands for, over the power of that drift: of a random walk,
# the means of two records in a row lie twice the drift's rms apart, which is two times its power for either.
WANDERS = 2.0
RIDGE = 1e-9  # of the samples, on columns of unit rms: rounding
AT_MOST = 3.0  # times the rms drive: one standard deviation of any number before the record is seen
PARTS = (2, 4)  # of a record that must agree: whose own spread shows model error of a quarter of a record and longer
SHOWN = 1e-3  # of the mean square of columns of unit rms: a direction in which a part moves less is not asked of it
LEAST_ERROR = 0.0015  # of the rms drive, of every column
# Independent samples.  Over 63 pairs of real equal records (`benchmarks.compare --real`), the numbers of one leave 0.81
# of what its own leave of the other more than they do, rms; a tenth of its power for each of six or seven numbers.
WORTH = 10.0
WALKS = np.concatenate([[0.0], np.logspace(-6.0, 3.0, 37)])  # of which the likelihood takes the best, a quarter apart
INSIDE = 0.2  # of the lines: those below half of the filter's cut-off, where noise has not been filtered away
NEAR = 2.0  # standard deviations: what lies that near may be the same (95 %)
N_FEATURES = 60  # random functions of an axis's state: a curve over position, speed and direction has some ten bends
BENDS = 2.0  # of such a function, in rad a standard deviation of the state
JUDGED = 8.0  # degrees of freedom of what is set and not estimated: right to a quarter (GUM 2008, eq. G.3)


class Summand(NamedTuple):
    """A summand of a covariance, shape (p, p), and the degrees of freedom with which it is known.

    ``walker`` is the number that a drift lets walk; -1 of any other summand.

    >>> noise = Summand(np.diag([0.04, 0.01]), degrees=200.0)
    >>> noise.walker, np.sqrt(np.diag(noise.covariance)).tolist()
    (-1, [0.2, 0.1])
    """

    covariance: Array
    degrees: float
    walker: int = -1


def degrees_of(parts: Sequence[Summand], to: Array) -> float:
    """Degrees of freedom of the covariance of ``to @ values``, shape (k, p), as a whole.

    1 / nu = sum of q_j^2 / nu_j, where q_j is the share of summand j in the covariance.

    Source: Satterthwaite 1946, Biometrics Bulletin 2(6), 110-114; Welch 1947, Biometrika 34, 28-35.

    >>> known, guessed = Summand(np.eye(2), 100.0), Summand(np.diag([0.0, 1.0]), 4.0)
    >>> [round(degrees_of([known, guessed], unit[None]), 1) for unit in np.eye(2)]
    [100.0, 15.4]
    """
    each = [to @ part.covariance @ to.T for part in parts]
    inverse = np.linalg.pinv(np.sum(each, axis=0), rcond=1e-10, hermitian=True)
    shares = np.array([np.sum(inverse * one) for one in each]) / to.shape[0]
    return float(1.0 / max(float(np.sum(shares**2 / [p.degrees for p in parts])), 1e-9))


@dataclass(frozen=True)
class Estimate:
    """Numbers of a record.

    >>> noise, drift = Summand(np.array([[9.0]]), 200.0), Summand(np.array([[16.0]]), 4.0)
    >>> Estimate("monday.csv", np.array([1.0]), (noise, drift), left=np.array([0.1]), drift={}).errors.tolist()
    [5.0]
    """

    label: str
    values: Array  # (p,)
    parts: tuple[Summand, ...]  # of the covariance
    left: Array  # rms of the residual at each joint, as a share of its rms drive, (n_joints,)
    drift: dict[int, float]  # number -> rms by which it drifts within the record, beyond noise
    # number -> its half waves along the record, as fitted, from the longest on; none of an offset that walks, whose
    # course does not come again
    courses: dict[int, Array] = field(default_factory=dict)

    @cached_property
    def covariance(self) -> Array:
        """Of the values, shape (p, p)."""
        return np.asarray(np.sum([part.covariance for part in self.parts], axis=0))

    @cached_property
    def errors(self) -> Array:
        """Standard errors, shape (p,)."""
        return np.sqrt(np.diag(self.covariance))


def estimate(rows: Regression) -> Estimate:
    """Least squares of one record, with drift projected out.

    Source: Newey and West 1987, Econometrica 55(3), 703-708, for errors of any colour; Quenouille 1956 and Tukey 1958
    for the jackknife; Kuensch 1989, Annals of Statistics 17(3), 1217-1241, for its blocks.
    """
    x = np.column_stack([rows.columns, rows.nuisances])
    size = np.maximum(np.sqrt(np.mean(x**2, axis=0)), 1e-300)
    z, target = white(x / size, rows), white(rows.target, rows)
    prior = AT_MOST * float(np.linalg.norm(rows.scale))
    ridge = _ridge(z, target, prior)
    inverse = np.linalg.inv(z.T @ z + ridge * np.eye(z.shape[1]))
    fit = inverse @ (z.T @ target)
    left = (target - z @ fit) * np.sqrt(z.shape[0] / max(z.shape[0] - z.shape[1], 1))  # the fit took its share
    p = rows.columns.shape[1]
    noise = _wider(_stationary(z @ inverse, left, rows), _by_block(z, target, rows, ridge)) * _disagreement(
        z, rows, left
    )
    wider = _wider(noise, _stationary(z @ inverse, left, rows, again=repeating(rows, z, left)))
    wider = wider + (ridge * prior) ** 2 * (inverse @ inverse)
    wider[:p, :p] += np.diag((LEAST_ERROR * rows.scale) ** 2 @ rows.paid())
    by_noise = _walks(np.sqrt(np.diag(wider)[p:]), rows.of, size[p:], size[:p])
    power = _walks(fit[p:], rows.of, size[p:], size[:p])
    by_walk = offset_walks(
        rows, rows.target - x @ (fit / size), size
    )  # its half waves are weighted by it, and their errors are the walk itself
    power = {i: max(w - by_noise[i] * (i not in by_walk), by_walk.get(i, 0.0), 0.0) for i, w in power.items()}
    power = by_walk | power
    drift = {i: float(np.sqrt(w)) / size[i] for i, w in power.items() if w > 0.0}
    unit = np.outer(size[:p], size[:p])
    parts = (
        Summand(noise[:p, :p] / unit, float(rows.block.max())),
        Summand((wider - noise)[:p, :p] / unit, JUDGED),
        *(
            Summand(np.diag(WANDERS * w * np.eye(p)[i]) / unit, float(rows.of.count(i) or JUDGED), i)
            for i, w in power.items()
        ),
    )
    rest = rows.target - x @ (fit / size)
    share = np.array([np.linalg.norm(rest[those]) for those in rows.channels()]) / np.sqrt(rest.size) / rows.scale
    waves = fit[p:] / size[p:]
    courses = {i: waves[: len(rows.of)][[j == i for j in rows.of]] for i in power if i not in by_walk}
    return Estimate(rows.label, fit[:p] / size[:p], parts, share, drift, courses)


def _ridge(z: Array, target: Array, prior: float) -> float:
    """Noise over the prior of every number, columns of unit rms: numbers without data get a large error."""
    left = target - z @ np.linalg.lstsq(z, target, rcond=RIDGE)[0]
    noise = float(left @ left) / n_effective(left)
    return max(noise / prior**2, RIDGE * target.size)


def white(x: Array, rows: Regression) -> Array:
    """Signals weighted as noise beside an offset that walks asks for: W^-1/2 x, W = 1 + walk / (4 sin^2(pi j / 2n)).

    The lines j are those of the cosine transform, of which a walk about its own mean consists (its offset, line 0, and
    its half waves stay what they are).
    """
    if not any(rows.walk):
        return x
    out = np.array(x, dtype=float)
    for those, walk in zip(rows.channels(), rows.walk, strict=True):
        lines = dct(out[those], axis=0, norm="ortho")
        out[those] = idct((lines.T / np.sqrt(spectrum_of(walk, those.size))).T, axis=0, norm="ortho")
    return out


def spectrum_of(walk: float, n: int) -> Array:
    """Power of white noise and a walk about its mean in the lines of a cosine transform, shape (n,)."""
    lines = np.arange(1, n)
    return np.concatenate([[1.0], 1.0 + walk / (4.0 * np.sin(0.5 * np.pi * lines / n) ** 2)])


def walking(every: list[Regression]) -> list[Regression]:
    """The records with the walk of their offset, by Whittle's likelihood of all of them; one for each joint.

    Of what no function of the state explains: the errors of a model are slow too, but come again with the motion.

    Source: Whittle 1953, Arkiv foer Matematik 2(5), 423-434; Harvey 1989, Forecasting, Structural Time Series Models
    and the Kalman Filter, ch. 2, for noise beside a level that walks.
    """
    score = np.zeros((len(every[0].channels()), WALKS.size))
    for rows in every:
        z = np.column_stack([rows.columns, rows.nuisances, functions_of_state(rows)])
        z = z / np.maximum(np.sqrt(np.mean(z**2, axis=0)), 1e-300)
        left = rows.target - z @ np.linalg.lstsq(z, rows.target, rcond=RIDGE)[0]
        score += [whittle(left[those], rows)[0] for those in rows.channels()]
    best = tuple(float(WALKS[i]) for i in np.argmin(score, axis=1))
    return [replace(rows, walk=best) for rows in every]


def whittle(left: Array, rows: Regression) -> tuple[Array, Array]:
    """Twice the negative log likelihood of `WALKS` for a residual, and the noise's variance beside each."""
    first = 1 + max((list(rows.of).count(i) for i in rows.of), default=0)  # the half waves are fitted away
    lines = slice(first, max(int(INSIDE * left.size), first + 1))
    power = dct(left, norm="ortho")[lines] ** 2
    shapes = np.array([spectrum_of(walk, left.size)[lines] for walk in WALKS])
    noise = np.mean(power / shapes, axis=1)
    return power.size * np.log(np.maximum(noise, 1e-300)) + np.sum(np.log(shapes), axis=1), noise


def _stationary(weights: Array, left: Array, rows: Regression, again: Sequence[float] = ()) -> Array:
    """Covariance of ``weights.T @ noise`` for noise with the residual's spectrum; holes in the grid are zeros.

    The share ``again`` of it, for each joint, counts as `WORTH` independent samples at the most, however long the
    record: the errors of a model come again with every motion.
    """
    out = np.zeros((weights.shape[1], weights.shape[1]))
    for those, share in zip(rows.channels(), again or [0.0] * len(rows.scale), strict=True):
        at = rows.at[those] - rows.at[those[0]]
        n = int(at[-1]) + 1
        noise, w = np.zeros(n), np.zeros((n, weights.shape[1]))
        noise[at] = left[those]
        w[at] = weights[those]
        spectrum = smoothed_power(noise) / at.size
        spectrum *= 1.0 - share + share * max(1.0, n_effective(left[those]) / WORTH)
        f = np.fft.rfft(w, axis=0)
        twice = np.full(f.shape[0], 2.0)
        twice[0] = 1.0
        if n % 2 == 0:
            twice[-1] = 1.0
        out += np.real((f.conj().T * (twice * spectrum)) @ f) / n
    return out


def repeating(rows: Regression, z: Array, left: Array) -> list[float]:
    """Share of each joint's residual that is a function of its state, and so comes again with every motion.

    What functions of the state explain beyond what as many explain of noise is a lack of fit of the model; the rest is
    noise.  All is lack of fit where there are too few samples to tell.

    Source: Draper and Smith 1998, Applied Regression Analysis, sec. 2.1, for lack of fit and pure error.
    """
    beside, out, drawn = np.linalg.qr(z)[0], [], white(functions_of_state(rows), rows)
    drawn = drawn - beside @ (beside.T @ drawn)
    for those in rows.channels():
        q = np.linalg.qr(drawn[those])[0]
        rest = left[those] - q @ (q.T @ left[those])
        n = n_effective(rest)
        noise = float(np.sum(rest**2) / max(np.sum(left[those] ** 2), 1e-300)) * n / max(n - N_FEATURES, 1.0)
        out.append(float(np.clip(1.0 - noise, 0.0, 1.0)) if n > 2.0 * N_FEATURES else 1.0)
    return out


def functions_of_state(rows: Regression) -> Array:
    """Smooth functions of columns and path at each joint, drawn at random, shape (n, `N_FEATURES`).

    Source: Rahimi and Recht 2007, Random features for large-scale kernel machines, NIPS 20.
    """
    rng = np.random.default_rng(0)
    state, out = np.column_stack([rows.columns, rows.path]), np.zeros((rows.target.size, N_FEATURES))
    for those in rows.channels():
        own = state[those] - state[those].mean(axis=0)
        size = np.linalg.norm(own, axis=0)
        varies = size > RIDGE * np.linalg.norm(state[those], axis=0)
        own = own[:, varies] / size[varies] * np.sqrt(those.size)
        bends = rng.normal(size=(own.shape[1], N_FEATURES)) * BENDS / np.sqrt(own.shape[1])
        out[those] = np.cos(own @ bends + rng.uniform(0.0, 2.0 * np.pi, N_FEATURES))
    return out


def _wider(a: Array, b: Array) -> Array:
    """The covariance ``a``, wider in every direction in which ``b`` is wider.

    Not number by number: without one of its blocks a record may not separate two numbers any more, and still know their
    sum.
    """
    values, vectors = np.linalg.eigh(a)
    root = vectors * np.sqrt(np.maximum(values, values[-1] * RIDGE))
    inverse = np.linalg.pinv(root)
    more, along = np.linalg.eigh(inverse @ b @ inverse.T)
    turned = root @ along
    return np.asarray((turned * np.maximum(more, 1.0)) @ turned.T)


def _by_block(z: Array, target: Array, rows: Regression, ridge: float) -> Array:
    """Covariance by the jackknife over blocks."""
    parts = [np.flatnonzero(rows.block == k) for k in np.unique(rows.block)]
    grams = np.array([z[s].T @ z[s] for s in parts])
    crosses = np.array([z[s].T @ target[s] for s in parts])
    total, cross = grams.sum(axis=0), crosses.sum(axis=0)
    held = ridge * np.eye(z.shape[1])
    without = np.array([np.linalg.solve(total - g + held, cross - c) for g, c in zip(grams, crosses, strict=True)])
    apart, m = without - without.mean(axis=0), len(parts)
    return np.asarray((m - 1.0) / m * apart.T @ apart)


def _disagreement(z: Array, rows: Regression, left: Array) -> float:
    """Birge's ratio: by how much more the parts of a record disagree than its noise says; at least 1.

    Of halves or quarters, whichever is larger, each in the directions that it shows.  What drifts keeps its course: it
    is known from the whole record.
    """
    p, n = rows.columns.shape[1], rows.target.size
    z = z / np.maximum(np.sqrt(np.mean(z**2, axis=0)), 1e-300)
    most = 1.0
    for m in PARTS:
        beyond, information, asked = [], [], -p  # the mean of the parts takes p
        part = rows.block * m // (rows.block.max() + 1)
        for k in np.unique(part):
            at = part == k
            x = z[at, :p]
            power, along = np.linalg.eigh(x.T @ x / at.sum())
            shown = power > SHOWN
            weights = np.zeros((n, int(shown.sum())))
            weights[at] = x @ along[:, shown] / (power[shown] * at.sum())
            known = np.linalg.pinv(_stationary(weights, left, rows), hermitian=True)  # zero of a record and itself
            beyond.append(along[:, shown] @ (weights.T @ left))
            information.append(along[:, shown] @ known @ along[:, shown].T)
            asked += int(shown.sum())
        mean = np.linalg.pinv(np.sum(information, axis=0), rcond=RIDGE, hermitian=True) @ np.sum(
            [w @ v for w, v in zip(information, beyond, strict=True)], axis=0
        )
        chi2 = sum(float((v - mean) @ w @ (v - mean)) for v, w in zip(beyond, information, strict=True))
        most = max(most, chi2 / max(asked, 1))
    return most


def _walks(fit: Array, of: tuple[int, ...], size: Array, unit: Array) -> dict[int, float]:
    """Mean square by which each number moves along its half waves; scaled as the numbers are."""
    power: dict[int, float] = {}
    for i, c, s in zip(of, fit, size, strict=False):  # behind them come the shapes
        power[i] = power.get(i, 0.0) + 0.5 * float((c * unit[i] / s) ** 2)
    return power


def offset_walks(rows: Regression, left: Array, size: Array) -> dict[int, float]:
    """Mean square by which each offset walks about its mean, scaled as the numbers are.

    n steps of variance s walk by s n / 6.  Of all that is left (n,): what a model lacks moves an offset as a walk does.
    """
    out: dict[int, float] = {}
    for i, name in enumerate(rows.names if any(rows.walk) else ()):
        if name.partition(" at ")[0] == "input_offset":
            those = rows.channels()[int(np.argmax(rows.paid()[:, i]))]
            score, noise = whittle(left[those], rows)
            k = int(np.argmin(score))
            paid = float(np.mean(rows.columns[those, i] ** 2)) / size[i] ** 2
            out[i] = float(WALKS[k] * noise[k]) * those.size / 6.0 / paid
    return out


def from_a_cold_start(a: Estimate, b: Estimate) -> tuple[Estimate, Estimate]:
    """Two records with what drifts alike in both taken for a course that each began anew, as warming does.

    What a drift leaves open is by how much a number may have wandered from one record to the other.  It is the drift in
    which they differ that says so: a course that comes again in the second record ends where it ended in the first.
    Only if the second record continues where the first has ended may all of the drift be what lies between them: where
    the two differ less at their ends than in their means, and by no more than the half waves that were not fitted, of a
    walk with those that were, may hide there.
    """
    kept: dict[int, float] = {}
    for i, first in a.courses.items():
        n = min(first.size, b.courses.get(i, first[:0]).size)
        if n:
            first, second = first[:n], b.courses[i][:n]
            moved = float(b.values[i] - a.values[i])
            jump = moved + float(second.sum()) - float(first @ (-1.0) ** np.arange(1, n + 1))
            fitted = float(np.sum(1.0 / np.arange(1, n + 1) ** 2))
            hidden = float(np.sum(first**2 + second**2)) * (np.pi**2 / 6.0 / fitted - 1.0)
            if jump**2 > min(moved**2, NEAR**2 * hidden):
                kept[i] = WANDERS / 4.0 * float(np.sum((second - first) ** 2))

    def held(part: Summand) -> Summand:
        i = part.walker
        if i not in kept or part.covariance[i, i] <= kept[i]:
            return part
        return part._replace(covariance=part.covariance * (kept[i] / part.covariance[i, i]))

    return tuple(replace(e, parts=tuple(map(held, e.parts))) for e in (a, b))  # type: ignore[return-value]


def pooled(parts: list[Estimate]) -> Estimate:
    """Several records combined into one: their mean, weighted by information."""
    if len(parts) == 1:
        return parts[0]
    weights = [np.linalg.inv(e.covariance) for e in parts]
    covariance = np.linalg.inv(np.sum(weights, axis=0))
    shares = [covariance @ w for w in weights]
    return Estimate(
        ", ".join(e.label for e in parts),
        np.sum([s @ e.values for s, e in zip(shares, parts, strict=True)], axis=0),
        tuple(Summand(s @ p.covariance @ s.T, p.degrees) for s, e in zip(shares, parts, strict=True) for p in e.parts),
        np.sqrt(np.mean([e.left**2 for e in parts], axis=0)), {},
    )  # fmt: skip
