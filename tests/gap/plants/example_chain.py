"""The record of Example 5.1 with a model under diagnosis at its truth."""

from __future__ import annotations

import numpy as np

from whsklearn import WienerHammersteinSystem
from whsklearn.effects import as_law
from whsklearn.gap.plants.chain_candidates import CATALOGUE
from whsklearn.gap.plants.chain_model import ChainModel, Setting, Term, signal_scales
from whsklearn.gap.record import held_out_blocks

THETA = np.array([2.2, 1.0, 0.5, 0.05, 0.7, 0.2, 0.2, 0.15, 0.4])
PARTS = {"a": [1.0, 2.2], "b": [1.0, 0.5], "c": [1.0, 0.2], "d": [0.15, 0.4]}
U = np.random.default_rng(1).normal(size=900)
TRUE = ChainModel(THETA)


def kind(name):
    """The first candidate of a name."""
    return next(k for k in CATALOGUE if k.name == name)


def term(name, *q):
    """An effect with its numbers."""
    return Term(kind(name), q)


def setting(*effects, noise=0.02, seed=0):
    """A record of the example with these effects of the library in it."""
    d = noise * np.random.default_rng(seed).normal(size=U.size)
    y = WienerHammersteinSystem(**PARTS, effects=effects).simulate(U, d)
    held, train = held_out_blocks(U.size)
    first = np.arange(U.size) < 40
    dims = np.array([2, 2, 2, 2, 3])
    return Setting(U, y, 1.0, dims, as_law(None), train & ~first, np.where(first, -1, held))


PLAIN = setting()
SCALES = signal_scales(PLAIN, TRUE)
