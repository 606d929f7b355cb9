"""Whether a simulator's error follows the motion at all: nameless functions of it, cross-validated."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from whsklearn.gap.plants.simulator_model import SimulatorModel

Array = NDArray[Any]


def explainable(plant: Any, model: SimulatorModel) -> float:
    """Cross-validated share of the error's second derivative that nameless functions of the motion explain."""
    m = plant.motion
    s = m.signals
    q = (s.position - s.position.mean()) / (np.std(s.position) or 1.0)
    v = s.velocity / (2 * np.std(s.velocity) or 1.0)
    sign, u = np.tanh(s.kappa * s.velocity), s.drive / (np.std(s.drive) or 1.0)
    waves = [f(k * s.position) for k in range(1, 9) for f in (np.cos, np.sin)]
    columns = [q, q**2, q**3, np.abs(v), v * np.abs(v), sign * q, sign * np.abs(u), u, *waves]
    columns += [np.exp(-0.5 * ((v - c) / 0.15) ** 2) for c in np.linspace(-1, 1, 11)]
    columns += [np.exp(-0.5 * ((q - c) / 0.2) ** 2) for c in np.linspace(-2, 2, 15)]
    e = plant.gap(model)
    base = np.column_stack([s.acceleration, s.velocity, sign, np.ones_like(e)])
    nuisance = np.column_stack([m.seen(base), m.seen(e), m.seen(e, 1)])[m.usable]
    x, y = m.seen(np.column_stack(columns))[m.usable], m.seen(e, 2)[m.usable]
    train = plant.train[:: m.every][m.usable]
    return share_explained(nuisance, np.column_stack([nuisance, x]), y, train)


def share_explained(nuisance: Array, whole: Array, y: Array, train: NDArray[np.bool_]) -> float:
    """Share of the held-out sum of squares that the whole basis predicts beyond the nuisance one."""
    left = []
    for x in (nuisance, whole):
        scale = x[train].std(axis=0) + 1e-12
        z = x / scale
        gram = z[train].T @ z[train] + 1e-3 * train.sum() * np.eye(z.shape[1])
        r = y[~train] - z[~train] @ np.linalg.solve(gram, z[train].T @ y[train])
        left.append(float(r @ r))
    return 1.0 - left[1] / max(left[0], 1e-300)
