"""Rivals of a named effect: which others explain the record as well, and how surely it beats the next one."""

from __future__ import annotations

from typing import Any

import numpy as np

from whsklearn.gap import evidence as rules
from whsklearn.gap.evidence import bootstrap_share
from whsklearn.gap.old_search import Found


def rivals_of(
    plant: Any, found: Found, rng: np.random.Generator
) -> tuple[list[list[str]], list[float], list[list[str]]]:
    """For each effect: its rivals, the share of draws in which it beats all of them, and its aliases.

    Each taken effect and its rivals are compared as they were when it was taken, in the same view.
    """
    names: list[list[str]] = []
    shares: list[float] = []
    same: list[list[str]] = []
    for i, (taken, others, view) in enumerate(zip(found.taken, found.rivals, found.views, strict=True)):
        able = [o for o in others if o.name != taken.name and o.name not in plant.aliases(taken.name)]
        if not able:
            names.append([])
            shares.append(1.0)
            same.append([])
            continue
        errors = view.compare([taken.fitted.model, *(o.fitted.model for o in able)], 0)
        close, equal, share = [], [], 1.0
        for other, j in zip(able, errors[1:], strict=True):
            s = bootstrap_share(errors[0].errors, j.errors, rng)
            near = taken.delta_bic - other.delta_bic < rules.LEAST_MARGIN or s < rules.SURE
            near = near or plant.doubtful(found.model, found.model.n_base + i, taken, other)
            if near and not _stands(plant, view, taken, other):
                continue
            if near and view.same_signature(taken.fitted.model, other.fitted.model):
                equal.append(other.name)
                continue
            share = min(share, s)
            if near:
                close.append(other.name)
        same.append(list(dict.fromkeys(equal)))
        names.append(list(dict.fromkeys(close)))
        shares.append(share)
    return names, shares, same


def _stands(plant: Any, view: Any, taken: Any, other: Any) -> bool:
    """Whether a rival is another effect, physical, and not one that was passed over on purpose."""
    if view.objection(other.fitted.model, len(other.fitted.model.terms) - 1):
        return False
    if taken.name in plant.commoner(other.name):
        return True
    return other.delta_bic <= taken.delta_bic + rules.LEAST_MARGIN
