"""A record in the form that a re-run takes, and what a plain run over it gives."""

from __future__ import annotations

import numpy as np

from tests.recursion.reruns import refine, replay
from whsklearn.datasets import make_wiener_hammerstein
from whsklearn.recursion.memory.gauss_newton import Memory as KeptSamples
from whsklearn.recursion.memory.gauss_newton import Prior
from whsklearn.recursion.rows.predictor import record_errors, state_size

KAPPA = 3.0


def natural(system):
    return np.concatenate([system.a[1:], system.b, system.law.weights, system.c[1:], system.d])


class Memory:
    """A record in the form that `replay` takes, and what a plain run over it gives."""

    def __init__(self, system, n=120, seed=0, snr_db=15.0, restart_at=()):
        self.law = system.law
        self.dims = np.array(
            [system.a.size, system.b.size, system.c.size, system.d.size, len(system.law)], dtype=np.int64
        )
        self.X, self.y = make_wiener_hammerstein(n, snr_db=snr_db, random_state=seed, system=system)
        self.restart = np.zeros(n, dtype=bool)
        self.restart[[0, *restart_at]] = True
        self.still = np.zeros(n, dtype=bool)
        self.history = int(max(self.dims[0], self.dims[3], 1))
        self.n = natural(system).size

    @property
    def kernel(self):
        return self.dims, self.law.codes, self.law.shapes

    def padded(self, values):
        return np.concatenate([np.zeros((self.history, *values.shape[1:])), values])

    def shared(self, tail=1, forgetting=1.0, origin=None):
        origin = np.zeros(state_size(self.dims)) if origin is None else origin
        return KeptSamples(
            origin, self.padded(self.X), self.padded(self.y), self.restart, self.y.size, self.history, tail,
            forgetting ** np.arange(self.y.size)[::-1] * ~self.still[: self.y.size],
        )  # fmt: skip

    def replay(self, theta, kappa=KAPPA, **settings):
        information, slope = np.zeros((self.n, self.n)), np.zeros(self.n)
        state = np.zeros(state_size(self.dims))
        cost = replay(theta, self.kernel, kappa, self.shared(**settings), information, slope, state)
        return cost, information, slope, state

    def errors(self, theta, kappa=KAPPA):
        e, rows = np.empty(self.y.size), np.empty((self.y.size, self.n))
        law = self.law.codes, self.law.shapes
        record_errors(theta, self.dims, *law, kappa, self.X, self.y, self.restart, e, rows)
        return e, rows

    def refine(self, theta, prior_theta, prior_information, iterations=30, **settings):
        information, state = np.zeros((self.n, self.n)), np.zeros(state_size(self.dims))
        prior = Prior(prior_theta, prior_information)
        cost = refine(theta, self.kernel, KAPPA, self.shared(**settings), prior, iterations, information, state)
        return cost, information
