"""Long records: the search runs over a first stretch, what it found is refitted to the whole.

A search fits dozens of models, and its time grows with the record; a name rarely needs more than some thousand
samples.  What shows only in the whole record is left to one more round there.
"""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

import numpy as np

from whsklearn.gap.blocks.fit import refit
from whsklearn.gap.blocks.score import FITS, remainder
from whsklearn.gap.blocks.trial import Found, delta_bic
from whsklearn.gap.record import blocks

if TYPE_CHECKING:
    from whsklearn.gap.blocks.model import BlockModel, Setting

LONG, STRETCH = 12_000, 8_000  # samples


def first_stretch(s: Setting, n: int = STRETCH) -> Setting:
    """The first n samples as a record of their own, with a split of their own."""
    skip = int(np.argmax(s.fit))
    held, train = blocks(n)
    fit = train.copy()
    fit[:skip] = False
    held = np.where(np.arange(n) < skip, -1, held)
    return dataclasses.replace(s, u=s.u[:n], y=s.y[:n], fit=fit, held=held)


def carried_over(s: Setting, found: Found) -> Found:
    """What was found on a stretch, refitted to the whole record."""
    z = dataclasses.replace(found.scales, n=s.u.size)
    base, base_cost = refit(s, found.base, z)
    model, cost = refit(s, found.model, z) if found.taken else (base, base_cost)
    n = int(s.fit.sum())
    for i, t in enumerate(found.taken):
        without = refit(s, model.without(i), z)[1] if len(found.taken) > 1 else base_cost
        t.model, t.cost = _up_to(model, i), cost
        t.delta_bic = delta_bic(n, without, cost, t.kind.n_estimated, t.kind.scanned)
    left = remainder(s, model, z)
    base_left = remainder(s, base, z) if found.taken else left
    return dataclasses.replace(
        found, base=base, base_cost=base_cost, minima=[(base, base_cost)], scales=z, model=model, cost=cost, left=left,
        base_left=base_left,
    )  # fmt: skip


def speaks(found: Found) -> bool:
    """Whether the whole record shows more than the stretch did."""
    return found.left is not None and found.left.p_value < FITS


def _up_to(m: BlockModel, i: int) -> BlockModel:
    """The model with its first i + 1 effects."""
    return dataclasses.replace(m, terms=m.terms[: i + 1])
