"""Twins: records of the model without the effect, in the same experiment, on which the effect must not show."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

import numpy as np

from whsklearn.gap.blocks.fit import weights_of
from whsklearn.gap.blocks.model import BlockModel, Setting, chain, coloured, raw_errors

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]


def twin(s: Setting, m: BlockModel, rng: np.random.Generator) -> Setting:
    """The setting with an output that the model itself has made, with noise of the same size and colour."""
    from scipy.signal import lfilter

    variance = weights_of(coloured(raw_errors(s, m), m.ar)[s.fit])[1]
    white = np.sqrt(variance) * rng.standard_normal(s.u.size)
    noise = lfilter([1.0], np.concatenate([[1.0], stable_colour(m.ar)]), white)
    return dataclasses.replace(s, y=np.ascontiguousarray(chain(s, m, free=True, noise=noise)[2]))


def stable_colour(ar: Array) -> Array:
    """The colour's polynomial with its roots drawn inside the unit circle."""
    from whsklearn.estimators._model import inside

    return inside(np.ascontiguousarray(ar, dtype=float))
