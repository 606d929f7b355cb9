"""A stream of the default reading, and the rows of a model that is linear in its parameters."""

from __future__ import annotations

import numpy as np

from whsklearn import WienerHammersteinSystem
from whsklearn.effects.law import polynomial_law
from whsklearn.recursion.memory import multistart
from whsklearn.recursion.rows.predictor import record_errors

LINEAR = WienerHammersteinSystem([1.0], [], [1.0], [0.3, -0.2], polynomial_law([0.0, 1.0, 0.5]))


EXAMPLE = WienerHammersteinSystem.example()


def reading(system, **settings):
    dims = np.array([system.a.size, system.b.size, system.c.size, system.d.size, len(system.law)], dtype=np.int64)
    defaults = {"p": 4, "p0": 100.0, "forgetting": 1.0, "n_starts": 4, "memory": 256, "frozen": False, "seed": 0}
    return multistart.Settings(dims=dims, codes=system.law.codes, shapes=system.law.shapes, **defaults | settings)


def streamed(r, X, y, chunks=1, restart_at=()):
    restart = np.zeros(len(y), dtype=bool)
    restart[[0, *restart_at]] = True
    state = multistart.initial_state(r)
    for part in np.array_split(np.arange(len(y)), chunks):
        multistart.run(state, r, X[part], y[part], restart[part])
    return state


def sizes(state):
    return {name: np.shape(value) for name, value in state.items()}


def rows_of(system, X, y):
    r = reading(system)
    rows = np.empty((len(y), r.size))
    record_errors(np.zeros(r.size), *r.law, 1.0, X, y, np.arange(len(y)) == 0, np.empty(len(y)), rows)
    return rows
