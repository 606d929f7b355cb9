"""Which other names could stand in an effect's place."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from whsklearn.gap.blocks.candidates import Scales
from whsklearn.gap.blocks.model import BlockModel, Setting, Term
from whsklearn.gap.blocks.score import Stand, coherence, signature, take_stand
from whsklearn.gap.blocks.trial import Round, Trial

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

MARGIN = 10.0  # delta BIC over the next name
# at rest nothing moves in a chain whose |sgn(dx)| is always one: a constant of v is one of y through L2
CONSTANTS = frozenset({"output_offset", "asymmetric_coulomb", "input_offset"})
EXACT = ("output_offset", "asymmetric_coulomb")
SIMILAR = 0.97  # coherence of two signatures that no record like this one tells apart


def aliases_of(s: Setting, one: Round, taken: Trial, z: Scales) -> tuple[list[str], list[str]]:
    """(names that no such record tells from the one taken, names that this record leaves open)."""
    i = len(taken.model.terms) - 1
    stand = take_stand(s, taken.model.without(i), z)
    mine = signature_of(s, stand, taken.model.terms[i], z)
    alike: list[str] = []
    close: list[str] = []
    for t in one.trials:
        if t.name == taken.name or taken.delta_bic - t.delta_bic >= MARGIN:
            continue
        c = coherence(mine, signature_of(s, stand, t.model.terms[-1], z))
        same = c >= SIMILAR or {t.name, taken.name} <= CONSTANTS
        (alike if same else close).append(t.name)
    if taken.name in EXACT:  # one that was not even refitted is no less alike
        tried = {t.name for t in one.trials}
        alike += [n for n in EXACT if n != taken.name and n not in tried]
    return list(dict.fromkeys(alike)), [n for n in dict.fromkeys(close) if n not in alike]


def simplest(s: Setting, m: BlockModel, sound: list[Trial], z: Scales) -> Trial:
    """The trial with the fewest numbers among those that the record cannot tell from the best."""
    best = sound[0]
    rivals = [t for t in sound[1:] if best.delta_bic - t.delta_bic < MARGIN]
    rivals = [t for t in rivals if t.kind.n_estimated < best.kind.n_estimated]
    if not rivals:
        return best
    stand = take_stand(s, m, z)
    mine = signature_of(s, stand, best.model.terms[-1], z)
    alike = [t for t in rivals if coherence(mine, signature_of(s, stand, t.model.terms[-1], z)) >= SIMILAR]
    return min(alike, key=lambda t: t.kind.n_estimated, default=best)


def signature_of(s: Setting, stand: Stand, term: Term, z: Scales) -> Array:
    """What an effect does beyond the model's own parameters, at its fitted shape."""
    columns = stand.leftover(signature(s, stand, term.kind, term.q[term.kind.linear :], z))
    return columns / np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
