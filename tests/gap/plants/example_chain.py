"""The record of Example 5.1 with a model under diagnosis at its truth."""

from __future__ import annotations

import numpy as np

from whsklearn import WienerHammersteinSystem
from whsklearn.effects import as_law
from whsklearn.gap.plants.chain_model import ChainHypothesis, ChainTerm, Record, catalogue, sizes

THETA = np.array([2.2, 1.0, 0.5, 0.05, 0.7, 0.2, 0.2, 0.15, 0.4])
PARTS = {"a": [1.0, 2.2], "b": [1.0, 0.5], "c": [1.0, 0.2], "d": [0.15, 0.4]}
U = np.random.default_rng(1).normal(size=900)
TRUE = ChainHypothesis(THETA)


def kind(name, at=""):
    """The candidate of a name, at a port."""
    return next(k for k in catalogue(as_law(None)) if k.name == name and (not at or k.at == at))


def term(name, *q, at=""):
    """An effect with its numbers."""
    return ChainTerm(kind(name, at), q)


def record(*effects, noise=0.02, seed=0, u=U):
    """A record of the example with these effects of the library in it."""
    d = noise * np.random.default_rng(seed).normal(size=u.size)
    y = WienerHammersteinSystem(**PARTS, effects=effects).simulate(u, d)
    return Record.of(u, y, 1.0, np.array([2, 2, 2, 2, 3]), as_law(None))


PLAIN = record()
SIZES = sizes(PLAIN, TRUE)
