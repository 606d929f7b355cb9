"""Rows of a regression whose numbers are known, for tests that need no axis."""

from __future__ import annotations

import numpy as np

from whsklearn.compare.rows import Regression, blocks_between, drifting

NAMES = ("inertia", "viscous", "coulomb", "input_offset", "delay")
TRUTH = np.array([0.05, 0.1, 0.2, 0.05, 0.0])


def rows(truth=TRUTH, seed=0, n=3000, noise=0.02, walk=0.0, step=0.01, label="a"):
    """An axis along a drawn motion, its drive with white noise and an offset that walks (rms of it)."""
    rng = np.random.default_rng(seed)
    t = np.arange(n) * step
    hertz, phase = rng.uniform(0.2, 1.5, 5), rng.uniform(0, 2 * np.pi, 5)
    w = 2 * np.pi * hertz
    q, v, a = (np.sum([f(x, p, t) for x, p in zip(w, phase, strict=True)], axis=0) for f in (
        lambda w, p, t: np.sin(w * t + p), lambda w, p, t: w * np.cos(w * t + p),
        lambda w, p, t: -w * w * np.sin(w * t + p)))  # fmt: skip
    columns = np.column_stack([a, v, np.tanh(50 * v), np.ones(n), np.gradient(a * truth[0], step)])
    target = columns @ truth + noise * rng.standard_normal(n)
    if walk:
        drift = np.cumsum(rng.standard_normal(n))
        target = target + walk * (drift - drift[0]) / np.std(drift)
    turns = np.flatnonzero(np.diff(np.sign(v))) + 1
    nuisances, of = drifting(columns, NAMES, t, 0.2)
    units = ("kg m²", "Nm s/rad", "Nm", "Nm", "s")
    return Regression(
        label, NAMES, units, columns, target, np.arange(n), step, t, q, blocks_between(turns, n), nuisances, of,
        np.array([np.sqrt(np.mean(target**2))]), 0.2, {}, frozenset({"inertia", "viscous", "coulomb"}),
    )  # fmt: skip
