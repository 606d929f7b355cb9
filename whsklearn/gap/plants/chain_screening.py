"""Signatures and scores: what each candidate would do to the errors, beside what the model itself can do.

A signature is the change of A(q) (y - y_hat) that the effect makes; the model's own sensitivities are
projected out, so an effect that the orders or the law absorb has none left.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from whsklearn.gap.plants import chain_evidence as rules
from whsklearn.gap.plants.chain_candidates import Candidate, Scales
from whsklearn.gap.plants.chain_fit import climb, rms_dx, weights_of
from whsklearn.gap.plants.chain_model import ChainModel, Setting, Term, coloured, jacobian, raw_errors

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

# Sharpness of the sign while signatures are taken, kappa times rms dx: sharp enough that few samples lie between the
# signs; and soft, under which a sample on the wrong side of a reversal tells by how far.
SHARPNESS, SOFT = 100.0, 10.0


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
class Tangent:
    """The model's errors and an orthonormal basis of its tangent space (its sensitivities), over the fit's samples."""

    model: ChainModel
    errors: Array
    basis: Array
    smooth_base: Array
    root: Array  # square roots of the samples' weights

    def leftover(self, columns: Array) -> Array:
        """Columns without what the model's own parameters can make."""
        return columns - self.basis @ (self.basis.T @ columns)


def tangent_of(s: Setting, m: ChainModel, z: Scales, sharpness: float = SHARPNESS) -> Tangent:
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
    return Tangent(soft, root * errors, basis_of(rows * root[:, None]), base, root)


def basis_of(columns: Array, least: float = 1e-9) -> Array:
    """Orthonormal basis of columns of unit length, shape (n, r), of singular values above ``least`` of the first."""
    left, values, _ = np.linalg.svd(columns / np.maximum(np.linalg.norm(columns, axis=0), 1e-300), full_matrices=False)
    return left[:, values > least * values[0]]


def change(s: Setting, tangent: Tangent, kind: Candidate, numbers: tuple[float, ...]) -> Array:
    """What the effect with these numbers does to the errors."""
    moved = raw_errors(s, tangent.model.plus(Term(kind, numbers)))
    return tangent.root * coloured(moved - tangent.smooth_base, tangent.model.ar)[s.fit]


def signature(s: Setting, tangent: Tangent, kind: Candidate, shape: tuple[float, ...], z: Scales) -> Array:
    """Columns of the effect at one shape, per unit of its linear numbers (or at its size); shape (n_fit, 1 or 2)."""
    if kind.linear == 0:
        return change(s, tangent, kind, shape)[:, None]
    unit = kind.unit(z)  # small, so that no sign turns
    columns = []
    for i in range(kind.linear):
        numbers = [0.0] * kind.linear
        numbers[i] = unit
        columns.append(change(s, tangent, kind, (*numbers, *shape)) / unit)
    return np.column_stack(columns)


def screen(s: Setting, tangent: Tangent, kinds: list[Candidate], z: Scales) -> list[Screened]:
    """Every candidate at its best shape, the largest gain first."""
    residual = tangent.leftover(tangent.errors[:, None])[:, 0]
    found = []
    for kind in kinds:
        shapes = _tone_shapes(s, tangent, z) if kind.name == "disturbance_tone" else kind.shapes(z)
        best: Screened | None = None
        for shape in shapes:
            one = _score(s, tangent, kind, shape, z, residual)
            if one is not None and (best is None or one.gain > best.gain):
                best = one
        if best is not None:
            found.append(best)
    return sorted(found, key=lambda f: -f.gain)


def _score(
    s: Setting, tangent: Tangent, kind: Candidate, shape: tuple[float, ...], z: Scales, residual: Array
) -> Screened | None:
    """The score of one shape."""
    raw = signature(s, tangent, kind, shape, z)
    size = np.linalg.norm(raw, axis=0)
    if not np.all(np.isfinite(raw)) or not np.all(size > 1e-12):
        return None
    columns = tangent.leftover(raw)
    left = float(np.linalg.norm(columns) / np.linalg.norm(raw))
    if left < rules.NOTHING_LEFT:
        return Screened(Term(kind, (*([0.0] * kind.linear), *shape)), 0.0, left, columns)
    weights, *_ = np.linalg.lstsq(columns, -residual, rcond=1e-9)
    gain = float(residual @ residual - np.sum((residual + columns @ weights) ** 2))
    if kind.linear == 0 and weights[0] <= rules.ASKS_FOR:
        gain = 0.0
    if kind.linear == 1 and kind.positive and weights[0] <= 0:
        gain = 0.0
    numbers = tuple(float(w) for w in weights) if kind.linear else ()
    return Screened(Term(kind, (*numbers, *shape)), gain, left, columns / np.linalg.norm(columns, axis=0))


def _tone_shapes(s: Setting, tangent: Tangent, z: Scales) -> list[tuple[float, ...]]:
    """Frequencies worth a look: the largest lines of the errors."""
    e = np.zeros(s.u.size)
    e[s.fit] = tangent.errors
    spectrum = np.abs(np.fft.rfft(e, 4 * e.size))
    hertz = np.fft.rfftfreq(4 * e.size, s.dt)
    spectrum[hertz < 0.7 / z.seconds] = 0.0
    out: list[tuple[float, ...]] = []
    for _ in range(4):
        i = int(np.argmax(spectrum))
        out.append((float(hertz[i]),))
        spectrum[max(0, i - 8) : i + 9] = 0.0
    return out


def refine_scan(s: Setting, tangent: Tangent, best: Screened, z: Scales) -> Screened:
    """Shapes between those of the scan, where a refit could not walk (orders and times)."""
    kind = best.term.kind
    if kind.name == "parameter_change":
        step = z.seconds * 0.02
    elif "order" in kind.fields:
        step = 0.35 / (z.y if kind.name == "encoder_eccentricity" else z.x)
    else:
        return best
    residual = tangent.leftover(tangent.errors[:, None])[:, 0]
    low, high = kind.ranges(z)[0]
    for _ in range(5):
        centre = best.term.q[kind.linear]
        for shift in (-0.5, 0.5):
            value = min(max(centre + shift * step, low), high)
            one = _score(s, tangent, kind, (value,), z, residual)
            if one is not None and one.gain > best.gain:
                best = one
        step *= 0.5
    return best


def coherence(a: Array, b: Array) -> float:
    """Largest canonical correlation of two signatures without the base."""
    qa, qb = np.linalg.qr(a)[0], np.linalg.qr(b)[0]
    return float(np.linalg.svd(qa.T @ qb, compute_uv=False)[0])
