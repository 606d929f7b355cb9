"""The best linear approximation of a record: least squares, Steiglitz-McBride, output error."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple, Protocol, TypeVar

import numpy as np

from whsklearn._numba import njit
from whsklearn.effects.base import Array, Bools, Integers
from whsklearn.systems.stability import is_stable


def filter_rows(b: Array, a: Array, rows: Array, bounds: Integers) -> Array:
    """Apply b(q)/a(q) to every row, from rest at each of the bounds.

    ``b``, ``a``: coefficients in powers of the delay, a[0] = 1. ``rows`` (m, n): signals. ``bounds``: first samples of
    the experiments, and n at the end. Returns (m, n).
    """
    num, den = np.zeros((2, max(b.size, a.size)))
    num[: b.size], den[: a.size] = b, a
    out = np.zeros(rows.shape)
    _filter_rows(num, den, a.size > 1, rows, bounds, np.zeros(num.size), out)
    return out


@njit(error_model="numpy", counted=False)
def _filter_rows(num, den, has_poles, rows, bounds, state, out):
    """``filter_rows`` into zeros: what makes arrays or assigns to slices takes longer to compile than the rest."""
    order = num.size - 1
    for i in range(rows.shape[0]):
        for e in range(bounds.size - 1):
            first, stop = bounds[e], bounds[e + 1]
            if not has_poles:  # the same sums in the same order, tap by tap along the record: a third of the time
                for k in range(min(order, stop - first - 1), -1, -1):
                    later, earlier = out[i, first + k : stop], rows[i, first : stop - k]
                    for t in range(later.size):
                        later[t] += num[k] * earlier[t]
                continue
            for k in range(order + 1):  # transposed direct form II; the last entry stays zero
                state[k] = 0.0
            for t in range(first, stop):
                v = rows[i, t]
                y = num[0] * v + state[0]
                for k in range(order):
                    state[k] = num[k + 1] * v - den[k + 1] * y + state[k + 1]
                out[i, t] = y


@njit(cache=True, error_model="numpy")
def delayed_rows(signal, count, bounds):
    """The signal delayed by 0 ... count - 1 samples, shape (count, n); zeros before each experiment."""
    out = np.zeros((count, signal.size))
    for k in range(count):
        for e in range(bounds.size - 1):
            for t in range(bounds[e] + k, bounds[e + 1]):
                out[k, t] = signal[t - k]
    return out


# --- Levenberg-Marquardt over points of any kind: the loop of the batch fits -----------------------------------------
# SciPy's `least_squares` moves a vector within fixed bounds, which is not enough here.  A step is rejected if a pole
# leaves the unit circle, and shortened if friction would feed in energy.  Some parts of a point are solved for inside
# it (the states of pieces, variable projection).  Sensitivities are rows (p, n), and only J J' is needed: for 10,000
# samples and 8 parameters this takes a tenth of the time of the decomposition of J with which SciPy solves a step.
# `simulation_error.refine` has its own loop, because it places the knots of a law again on the way.
FIRST = 1e-2  # initial damping, for normal equations with a unit diagonal
LEAST = 1e-9  # damping by which the promise of a step is computed: none may be singular, as numbers may exchange
TRIES = 8  # dampings tried from one point, each four times the previous one


class HasCost(Protocol):
    """A point of a descent."""

    @property
    def cost(self) -> float:
        """The cost to minimise."""


Point = TypeVar("Point", bound=HasCost)


def descend(
    point: Point,
    equations: Callable[[Point], tuple[Array, Array] | None],
    moved: Callable[[Point, Array], Point | None],
    iterations: int,
    *,
    enough: float,
) -> Point:
    """The point of least cost reached from ``point`` (Levenberg 1944, Marquardt 1963).

    ``point``: the start.
    ``equations``: maps a point to its normal equations J J' (p, p) and J e (p,); None if the descent cannot continue
        there.
    ``moved``: maps (point, step of shape (p,)) to another point; None if the step is rejected.
    ``iterations``: largest number of iterations.
    ``enough``: the descent ends where no step promises to lower the cost by this share (Bates and Watts 1981, A
        Relative Offset Orthogonality Convergence Criterion, Technometrics 23(2), 179-183), or after one that does not.

    The damping falls after a step that keeps most of its promise, and stays after one that keeps half (Nielsen 1999,
    Damping Parameter in Marquardt's Method, IMM-REP-1999-05).  Lowered after every step, half of all steps of an axis
    were too long and their runs in vain.
    """
    damping = FIRST
    for _ in range(iterations):
        found = equations(point)
        if found is None or damped_step(*found, LEAST) @ found[1] < enough * point.cost:
            return point
        for _ in range(TRIES):
            step = damped_step(*found, damping)
            trial = moved(point, step)
            if trial is not None and trial.cost < point.cost:
                break
            damping *= 4
        else:
            return point
        promised = float(step @ (2.0 * found[1] - found[0] @ step))
        kept = min((point.cost - trial.cost) / max(promised, 1e-300), 1.0)
        damping *= max(1.0 / 8.0, 1.0 - (2.0 * kept - 1.0) ** 3)
        gain, point = 1 - trial.cost / point.cost, trial
        if gain < enough:
            return point
    return point


def damped_step(information: Array, gradient: Array, damping: float) -> Array:
    """(D + damping I)^-1 of the normal equations, scaled to a unit diagonal."""
    scale = np.sqrt(np.maximum(np.diag(information), 1e-300))
    matrix = information / np.outer(scale, scale)
    matrix[np.diag_indices_from(matrix)] += damping
    try:
        return np.linalg.solve(matrix, gradient / scale) / scale
    except np.linalg.LinAlgError:
        return np.zeros_like(gradient)


# --- the best linear approximation of a record: least squares, Steiglitz-McBride, output error -----------------------
EDGE = 0.9999  # poles stay inside the circle of this radius
BATCHES = 60  # of the scores, for a covariance that does not assume a white error


def sandwich(rows: Array, error: Array) -> Array:
    """(J J')^-1 S (J J')^-1 of sensitivities ``rows`` (p, n), with S from the sums of J e over batches of the record.

    The residual of a free run is seldom white, and then sigma^2 (J J')^-1 is too small. For a white error
    the two have the same mean.  Ljung 1999, (9.26).
    """
    scale = np.maximum(np.linalg.norm(rows, axis=1), 1e-150)
    unit = rows / scale[:, None]
    inverse = np.linalg.pinv(unit @ unit.T, rcond=1e-13, hermitian=True)
    edges = np.linspace(0, error.size, BATCHES + 1).astype(int)[:-1]
    scores = np.add.reduceat(unit * error, edges, axis=1) if error.size >= BATCHES else unit * error
    return np.asarray(inverse @ (scores @ scores.T) @ inverse / np.outer(scale, scale))


class IOData(NamedTuple):
    """Input and output, where experiments begin, and which samples count.

    The first samples of an experiment hold a transient that a model which starts at rest cannot know: on the
    benchmark the error is 1.2 mV with them and 0.28 mV without them.  ``u`` has one row per input, shape (m, n).
    ``root`` is the square root of each sample's weight, or None if all weights are equal.  If the output has a free
    ``level``, errors and sensitivities are taken without their means, which eliminates a constant (variable
    projection); fitting it in turns with the gain crawls where the input has a mean.
    """

    u: Array
    y: Array
    bounds: Integers
    counts: Bools
    root: Array | None = None
    level: bool = False

    def weighted(self, rows: Array) -> Array:
        """Errors or sensitivities, shape (..., n), times `scale`, and without their means if there is a free level."""
        if self.level:
            weights = self.scale**2 / max(float(np.sum(self.scale**2)), 1e-300)
            rows = rows - (rows @ weights)[..., None]
        return rows * self.scale

    @property
    def scale(self) -> Array:
        """Factor of the errors and sensitivities, shape (n,); it is 0 where a sample does not count."""
        return self.counts.astype(np.float64) if self.root is None else self.counts * self.root

    def head(self, n: int) -> IOData:
        """The first n samples."""
        n = min(n, self.y.size)
        ends = np.append(self.bounds[self.bounds < n], n)
        root = None if self.root is None else self.root[:n]
        return IOData(np.ascontiguousarray(self.u[:, :n]), self.y[:n], ends, self.counts[:n], root, self.level)


class Ratio(NamedTuple):
    """b(q)/a(q), a[0] = 1, from the first input."""

    b: Array
    a: Array

    def run(self, data: IOData) -> Array:
        """Free run, shape (n,)."""
        return filter_rows(self.b, self.a, data.u[:1], data.bounds)[0]


def least_squares_arx(data: IOData, n_poles: int, n_zeros: int) -> Ratio:
    """The transfer function with the least equation error a(q) y - b(q) u; its poles may be anywhere.

    Ljung 1999, (4.11).
    """
    return _equation_error(data, data.u[0], data.y, n_poles, n_zeros)


def steiglitz_mcbride(data: IOData, start: Ratio, passes: int = 3) -> Ratio:
    """Minimise the equation error of signals filtered by the last denominator, repeatedly.

    Stoica and Soderstrom 1981, The Steiglitz-McBride identification algorithm revisited, IEEE TAC 26(3).
    """
    ratio = start
    for _ in range(passes):
        filtered = filter_rows(np.ones(1), stabilised(ratio.a), np.vstack([data.u[:1], data.y]), data.bounds)
        ratio = _equation_error(data, filtered[0], filtered[1], start.a.size - 1, start.b.size - 1)
    return ratio


def output_error(data: IOData, start: Ratio, iterations: int = 40) -> Ratio:
    """The transfer function with the least free-run error, by Levenberg-Marquardt from ``start``.

    Ljung 1999, section 10.2; the derivatives are delayed copies of u/a and of -y_hat/a.
    """
    one, n_b = np.ones(1), start.b.size

    def equations(at: _Run) -> tuple[Array, Array]:
        inner = filter_rows(one, at.ratio.a, np.vstack([data.u[:1], at.y]), data.bounds)
        by_b = delayed_rows(inner[0], n_b, data.bounds)
        by_a = -delayed_rows(inner[1], at.ratio.a.size, data.bounds)[1:]
        rows = data.weighted(np.vstack([by_b, by_a]))
        return rows @ rows.T, rows @ at.error

    def moved(at: _Run, step: Array) -> _Run | None:
        trial = Ratio(at.ratio.b + step[:n_b], at.ratio.a + np.append(0.0, step[n_b:]))
        return _run(trial, data) if is_stable(np.ascontiguousarray(trial.a[1:]), EDGE) else None

    first = _run(Ratio(start.b, stabilised(start.a)), data)
    return descend(first, equations, moved, iterations, enough=1e-6).ratio


class _Run(NamedTuple):
    """The free run of a transfer function over a record, and its error on the samples that count."""

    ratio: Ratio
    y: Array
    error: Array
    cost: float


def _run(ratio: Ratio, data: IOData) -> _Run:
    """The free run of a transfer function."""
    y = ratio.run(data)
    error = data.weighted(data.y - y)
    return _Run(ratio, y, error, float(error @ error))


def best_linear(data: IOData, n_poles: int, n_zeros: int) -> Ratio:
    """ARX, three passes of Steiglitz-McBride, output error; the best of the starts is refined."""
    arx = least_squares_arx(data, n_poles, n_zeros)
    starts = [Ratio(r.b, stabilised(r.a)) for r in (arx, steiglitz_mcbride(data, arx))]
    costs = np.nan_to_num([_run(r, data).cost for r in starts], nan=np.inf, posinf=np.inf)
    return output_error(data, starts[int(np.argmin(costs))])


def stabilised(a: Array) -> Array:
    """The denominator with poles outside the unit circle reflected into it, and poles at its edge moved inside."""
    if is_stable(np.ascontiguousarray(a[1:]), EDGE):
        return a
    roots = np.roots(a)
    roots = np.where(np.abs(roots) > 1, 1 / np.conj(roots), roots)
    size = np.maximum(np.abs(roots), 1e-12)
    inside = np.real(np.poly(np.where(size > 0.995 * EDGE, roots / size * 0.995 * EDGE, roots)))
    return np.append(inside, np.zeros(a.size - inside.size))


def _equation_error(data: IOData, u: Array, y: Array, n_poles: int, n_zeros: int) -> Ratio:
    """Least squares of y(t) on -y(t-1) ... and u(t) ..., with the signals as given."""
    past = -delayed_rows(y, n_poles + 1, data.bounds)[1:]
    rows = np.vstack([past, delayed_rows(u, n_zeros + 1, data.bounds), *np.ones((int(data.level), y.size))])
    scale = np.maximum(np.sqrt(np.mean(rows**2, axis=1)), 1e-300)
    theta = np.linalg.lstsq((rows / scale[:, None])[:, data.counts].T, y[data.counts], rcond=1e-12)[0] / scale
    return Ratio(theta[n_poles : n_poles + n_zeros + 1], np.append(1.0, theta[:n_poles]))
