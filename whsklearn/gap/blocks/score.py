"""Signatures and scores: what each candidate would do to the errors, beside what the model itself can do.

A signature is the change of A(q) (y - y_hat) that the effect makes; the model's own sensitivities are
projected out, so an effect that the orders or the law absorb has none left.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from whsklearn.gap.blocks.candidates import Candidate, Scales
from whsklearn.gap.blocks.fit import climb, rms_dx, weights_of
from whsklearn.gap.blocks.model import BlockModel, Setting, Term, chain, coloured, jacobian, raw_errors
from whsklearn.systems import block_effects as be

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

SHARPNESS = 100.0
SOFT = 10.0  # of the sign while signatures are taken, times rms dx
FITS = 2e-3  # p-value below which an effect that was taken leaves something over
ABSORBED = 0.02  # least part of a signature that the model's own parameters must leave over


@dataclass
class Screened:
    """The best shape of a candidate by its score.

    Attributes
    ----------
    term : Term
        With the numbers from which a refit starts.
    gain : float
        Drop of the sum of squares, linearised.
    left : float
        Share of the signature that the model's own parameters cannot make.
    signature : ndarray
        What is left of it, over the samples of the fit, unit length columns.
    soft : bool
        Whether it showed under a soft sign, by way of which a refit should then go.
    """

    term: Term
    gain: float
    left: float
    signature: Array
    soft: bool = False

    @property
    def name(self) -> str:
        """Canonical name."""
        return self.term.kind.name


@dataclass
class Stand:
    """The model's errors and an orthonormal basis of its own sensitivities, over the samples of the fit."""

    model: BlockModel
    errors: Array
    basis: Array
    smooth_base: Array
    root: Array  # square roots of the samples' weights

    def leftover(self, columns: Array) -> Array:
        """Columns without what the model's own parameters can make."""
        return columns - self.basis @ (self.basis.T @ columns)


def take_stand(s: Setting, m: BlockModel, z: Scales, sharpness: float = SHARPNESS) -> Stand:
    """Errors and sensitivities under a sign that is soft enough to have a slope.

    Under a much softer one a sample on the wrong side of a reversal tells by how far; what the softness itself
    does, the sensitivity to kappa, then counts as the model's own.
    """
    soft = m.at(min(m.kappa, sharpness / rms_dx(s, m)))
    much = sharpness < SHARPNESS
    if much:
        soft, _ = climb(s, soft, z, steps=4)
    base = raw_errors(s, soft)
    errors = coloured(base, soft.ar)[s.fit]
    root = np.ones(errors.size) if much else np.sqrt(weights_of(errors)[0])
    rows = jacobian(s, soft, z, base)[s.fit]
    if much:
        moved = [coloured(raw_errors(s, soft.at(f * soft.kappa)) - base, soft.ar)[s.fit] for f in (0.6, 0.8, 1.3, 2.0)]
        rows = np.column_stack([rows, *moved])
    rows = rows * root[:, None]
    rows = rows / np.maximum(np.linalg.norm(rows, axis=0), 1e-300)
    left, values, _ = np.linalg.svd(rows, full_matrices=False)
    return Stand(soft, root * errors, left[:, values > 1e-9 * values[0]], base, root)


def sharp_stand(s: Setting, m: BlockModel, z: Scales) -> Stand:
    """The model's own errors beside sensitivities of a softer sign: for tests of what is left."""
    soft = m.at(min(m.kappa, 30.0 / rms_dx(s, m)))
    base = raw_errors(s, soft)
    errors = coloured(raw_errors(s, m), m.ar)[s.fit]
    root = np.sqrt(weights_of(errors)[0])
    rows = jacobian(s, soft, z, base)[s.fit] * root[:, None]
    rows = rows / np.maximum(np.linalg.norm(rows, axis=0), 1e-300)
    left, values, _ = np.linalg.svd(rows, full_matrices=False)
    return Stand(soft, root * errors, left[:, values > 1e-9 * values[0]], base, root)


def change(s: Setting, stand: Stand, kind: Candidate, numbers: tuple[float, ...]) -> Array:
    """What the effect with these numbers does to the errors."""
    moved = raw_errors(s, stand.model.plus(Term(kind, numbers)))
    return stand.root * coloured(moved - stand.smooth_base, stand.model.ar)[s.fit]


def signature(s: Setting, stand: Stand, kind: Candidate, shape: tuple[float, ...], z: Scales) -> Array:
    """Columns of the effect at one shape, per unit of its linear numbers (or at its size); shape (n_fit, 1 or 2)."""
    if kind.linear == 0:
        return change(s, stand, kind, shape)[:, None]
    unit = kind.unit(z)  # small, so that no sign turns
    columns = []
    for i in range(kind.linear):
        numbers = [0.0] * kind.linear
        numbers[i] = unit
        columns.append(change(s, stand, kind, (*numbers, *shape)) / unit)
    return np.column_stack(columns)


def screen(s: Setting, stand: Stand, kinds: list[Candidate], z: Scales) -> list[Screened]:
    """Every candidate at its best shape, the largest gain first."""
    residual = stand.leftover(stand.errors[:, None])[:, 0]
    found = []
    for kind in kinds:
        shapes = _tone_shapes(s, stand, kind, z) if kind.name == "disturbance_tone" else kind.shapes(z)
        best: Screened | None = None
        for shape in shapes:
            one = _score(s, stand, kind, shape, z, residual)
            if one is not None and (best is None or one.gain > best.gain):
                best = one
        if best is not None:
            found.append(best)
    return sorted(found, key=lambda f: -f.gain)


def _score(
    s: Setting, stand: Stand, kind: Candidate, shape: tuple[float, ...], z: Scales, residual: Array
) -> Screened | None:
    """The score of one shape."""
    raw = signature(s, stand, kind, shape, z)
    size = np.linalg.norm(raw, axis=0)
    if not np.all(np.isfinite(raw)) or not np.all(size > 1e-12):
        return None
    columns = stand.leftover(raw)
    left = float(np.linalg.norm(columns) / np.linalg.norm(raw))
    if left < 1e-4:
        return Screened(Term(kind, (*([0.0] * kind.linear), *shape)), 0.0, left, columns)
    weights, *_ = np.linalg.lstsq(columns, -residual, rcond=1e-9)
    gain = float(residual @ residual - np.sum((residual + columns @ weights) ** 2))
    if kind.linear == 0 and weights[0] <= 0.05:
        gain = 0.0
    if kind.linear == 1 and kind.positive and weights[0] <= 0:
        gain = 0.0
    numbers = tuple(float(w) for w in weights) if kind.linear else ()
    return Screened(Term(kind, (*numbers, *shape)), gain, left, columns / np.linalg.norm(columns, axis=0))


def _tone_shapes(s: Setting, stand: Stand, kind: Candidate, z: Scales) -> list[tuple[float, ...]]:
    """Frequencies worth a look: the largest lines of the errors."""
    e = np.zeros(s.u.size)
    e[s.fit] = stand.errors
    spectrum = np.abs(np.fft.rfft(e, 4 * e.size))
    hertz = np.fft.rfftfreq(4 * e.size, s.dt)
    spectrum[hertz < 0.7 / z.seconds] = 0.0
    out: list[tuple[float, ...]] = []
    for _ in range(4):
        i = int(np.argmax(spectrum))
        out.append((float(hertz[i]),))
        spectrum[max(0, i - 8) : i + 9] = 0.0
    return out


def refine_scan(s: Setting, stand: Stand, best: Screened, z: Scales) -> Screened:
    """Shapes between those of the scan, where a refit could not walk (orders and times)."""
    kind = best.term.kind
    if kind.name == "parameter_change":
        step = z.seconds * 0.02
    elif "order" in kind.fields:
        step = 0.35 / (z.y if kind.name == "encoder_eccentricity" else z.x)
    else:
        return best
    residual = stand.leftover(stand.errors[:, None])[:, 0]
    low, high = kind.ranges(z)[0]
    for _ in range(5):
        centre = best.term.q[kind.linear]
        for shift in (-0.5, 0.5):
            value = min(max(centre + shift * step, low), high)
            one = _score(s, stand, kind, (value,), z, residual)
            if one is not None and one.gain > best.gain:
                best = one
        step *= 0.5
    return best


def coherence(a: Array, b: Array) -> float:
    """Largest canonical correlation of two signatures without the base."""
    qa, qb = np.linalg.qr(a)[0], np.linalg.qr(b)[0]
    return float(np.linalg.svd(qa.T @ qb, compute_uv=False)[0])


# --- is anything left at all -------------------------------------------------------------------
def probe_columns(s: Setting, stand: Stand, z: Scales) -> Array:
    """Signatures of generic functions at every port: hats over u, x, dx, q and time, lags, products."""
    x, _v, _ = chain(s, stand.model)
    dx = np.diff(x, prepend=0.0)
    out = []

    def probe(code: int, numbers: tuple[float, ...], unit: float) -> None:
        kind = Candidate("probe", code, ("c", *("p",) * len(numbers)))
        column = change(s, stand, kind, (unit, *numbers)) / unit
        if np.all(np.isfinite(column)) and np.linalg.norm(column) > 0:
            out.append(column)

    for code, signal, unit in (
        (be.HAT_U, s.u, z.u), (be.HAT_X, x, z.v), (be.HAT_DX, dx, z.v), (be.HAT_Q, s.y, z.y),
        (be.HAT_T, np.arange(s.u.size, dtype=float), z.v),
    ):  # fmt: skip
        knots = np.quantile(signal, [0.01, 0.07, 0.18, 0.32, 0.5, 0.68, 0.82, 0.93, 0.99])
        width = 1.2 * max(float(np.max(np.diff(knots))), 1e-12)
        for knot in knots:
            probe(code, (float(knot), width), 1e-3 * unit)
    for lag in range(1, 6):
        probe(be.LAG_U, (float(lag),), 1e-3)
        probe(be.LAG_V, (float(lag + 1),), 1e-3)
    sizes = (z.x * z.dx, z.x, z.u * z.dx, z.u, z.n * z.dx, z.n, z.x * z.u, z.x * z.dx)
    for i, size in enumerate(sizes):
        probe(be.PRODUCT, (float(i), 1.0), 1e-3 * z.v / size)
    return np.column_stack(out) if out else np.empty((int(s.fit.sum()), 0))


@dataclass(frozen=True)
class Remainder:
    """Whether the errors still depend on anything that the chain knows of.

    ``share`` is what generic functions take off the mean square of the errors, unbiased; ``p_value`` that of
    the F test.
    """

    share: float
    p_value: float


def remainder(s: Setting, m: BlockModel, z: Scales) -> Remainder:
    """The test of what is left, with generic functions at every port."""
    from scipy.stats import f as fisher

    stand = sharp_stand(s, m, z)
    columns = stand.leftover(probe_columns(s, stand, z))
    columns = columns / np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
    left, values, _ = np.linalg.svd(columns, full_matrices=False)
    basis = left[:, values > 1e-3 * values[0]]
    residual = stand.leftover(stand.errors[:, None])[:, 0]
    k, n = basis.shape[1], residual.size
    room = max(n - k - stand.basis.shape[1], 1)
    explained = float(np.sum((basis.T @ residual) ** 2))
    rest = float(residual @ residual) - explained
    variance = rest / room
    return Remainder(
        max(explained - k * variance, 0.0) / max(float(residual @ residual), 1e-300),
        float(fisher.sf(explained / k / variance, k, room)),
    )


def whiteness(e: Array, lags: int = 20) -> float:
    """p-value of Ljung and Box (1978, Biometrika 65(2))."""
    from scipy.stats import chi2

    n = e.size
    e = e - e.mean()
    limit = 4.5 * 1.4826 * np.median(np.abs(e)) + 1e-300
    e = np.where(np.abs(e) > limit, 0.0, e)  # beside a missed reversal several errors in a row are large
    r = np.array([e[i:] @ e[:-i] for i in range(1, lags + 1)]) / max(float(e @ e), 1e-300)
    q = n * (n + 2) * np.sum(r**2 / (n - np.arange(1, lags + 1)))
    return float(chi2.sf(q, lags))
