"""What chance reaches: the best score that any candidate reaches on records in which nothing is missing."""

from __future__ import annotations

from typing import Any

import numpy as np


def best_score(view: Any, model: Any, n_surrogates: int, rng: np.random.Generator) -> float:
    """Best delta BIC of any candidate on records that the model itself made in the same experiment.

    Only what one linear look can score counts, which is nearly all.
    """
    best = 0.0
    for _ in range(n_surrogates):
        other = view.surrogate(model, rng)
        fitted = other.fit(model)
        n = other.compare([fitted], 0)[0].n_effective
        for look in other.look(fitted):
            if look.costly:
                continue
            score = -n * np.log(max(1.0 - look.gain, 1e-3)) - view.limits.price * look.n_numbers * np.log(n)
            best = max(best, float(score) - (2 * float(np.log(look.n_looks)) if look.n_looks > 1 else 0.0))
    return best
