"""Is anything left at all: whiteness of the one-step errors, and generic functions at every port of the chain."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from whsklearn.gap.plants import chain_evidence as rules
from whsklearn.gap.plants.chain_candidates import Candidate, Scales
from whsklearn.gap.plants.chain_fit import SOFTENED, rms_dx, weights_of
from whsklearn.gap.plants.chain_model import ChainModel, Setting, chain, coloured, jacobian, raw_errors
from whsklearn.gap.plants.chain_screening import Tangent, basis_of, change
from whsklearn.systems import chain_probes as probes
from whsklearn.validation.residuals import WhitenessTest, whiteness_test

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]


def sharp_tangent(s: Setting, m: ChainModel, z: Scales) -> Tangent:
    """The model's own errors beside sensitivities of a softer sign: for tests of what is left."""
    soft = m.at(min(m.kappa, SOFTENED / rms_dx(s, m)))
    base = raw_errors(s, soft)
    errors = coloured(raw_errors(s, m), m.ar)[s.fit]
    root = np.sqrt(weights_of(errors)[0])
    return Tangent(soft, root * errors, basis_of(jacobian(s, soft, z, base)[s.fit] * root[:, None]), base, root)


def probe_columns(s: Setting, tangent: Tangent, z: Scales) -> Array:
    """Signatures of generic functions at every port: hats over u, x, dx, q and time, lags, products."""
    x, _v, _ = chain(s, tangent.model)
    dx = np.diff(x, prepend=0.0)
    out = []

    def probe(code: int, numbers: tuple[float, ...], unit: float) -> None:
        kind = Candidate("probe", code, ("c", *("p",) * len(numbers)))
        column = change(s, tangent, kind, (unit, *numbers)) / unit
        if np.all(np.isfinite(column)) and np.linalg.norm(column) > 0:
            out.append(column)

    for code, signal, unit in (
        (probes.HAT_U, s.u, z.u), (probes.HAT_X, x, z.v), (probes.HAT_DX, dx, z.v), (probes.HAT_Q, s.y, z.y),
        (probes.HAT_T, np.arange(s.u.size, dtype=float), z.v),
    ):  # fmt: skip
        knots = np.quantile(signal, [0.01, 0.07, 0.18, 0.32, 0.5, 0.68, 0.82, 0.93, 0.99])
        width = 1.2 * max(float(np.max(np.diff(knots))), 1e-12)
        for knot in knots:
            probe(code, (float(knot), width), 1e-3 * unit)
    for lag in range(1, 6):
        probe(probes.LAG_U, (float(lag),), 1e-3)
        probe(probes.LAG_V, (float(lag + 1),), 1e-3)
    sizes = (z.x * z.dx, z.x, z.u * z.dx, z.u, z.n * z.dx, z.n, z.x * z.u, z.x * z.dx)
    for i, size in enumerate(sizes):
        probe(probes.PRODUCT, (float(i), 1.0), 1e-3 * z.v / size)
    return np.column_stack(out) if out else np.empty((int(s.fit.sum()), 0))


@dataclass(frozen=True)
class Remainder:
    """Whether the errors still depend on anything that the chain knows of.

    ``share`` is what generic functions take off the mean square of the errors, unbiased; ``p_value`` that of
    the F test.
    """

    share: float
    p_value: float


def remainder(s: Setting, m: ChainModel, z: Scales) -> Remainder:
    """The test of what is left, with generic functions at every port."""
    from scipy.stats import f as fisher

    tangent = sharp_tangent(s, m, z)
    basis = basis_of(tangent.leftover(probe_columns(s, tangent, z)), 1e-3)
    residual = tangent.leftover(tangent.errors[:, None])[:, 0]
    k, n = basis.shape[1], residual.size
    room = max(n - k - tangent.basis.shape[1], 1)
    explained = float(np.sum((basis.T @ residual) ** 2))
    rest = float(residual @ residual) - explained
    variance = rest / room
    return Remainder(
        max(explained - k * variance, 0.0) / max(float(residual @ residual), 1e-300),
        float(fisher.sf(explained / k / variance, k, room)),
    )


def whiteness(e: Array, lags: int = 20, n_params: int = 0) -> WhitenessTest:
    """Ljung-Box test of errors whose outliers are left out (set to zero).

    Beside a missed reversal several errors in a row are large; they would pass for colour.
    """
    e = e - e.mean()
    limit = rules.OUTLIER * rules.MAD * np.median(np.abs(e)) + 1e-300
    return whiteness_test(np.where(np.abs(e) > limit, 0.0, e), lags, n_params)
