"""Leave a wrong minimum of the free-run error by moves that a descent cannot make."""

from __future__ import annotations

from typing import TYPE_CHECKING

from whsklearn.recursion.batch.block_split import reflections
from whsklearn.recursion.batch.missing_dynamics import missing_poles
from whsklearn.recursion.batch.simulation_error import Fitted, refine

if TYPE_CHECKING:
    from whsklearn.recursion.batch.best_linear import IOData

# On random systems (benchmarks/drawn_laws.py), useful moves reduce the sum of squares by 5 % or more.  Moves with less
# effect only shift the poles to compensate for a deficient law, and on the benchmark they would use up all rounds.
ROUNDS, WORTH = 10, 0.02  # rounds at most, and the share of the sum of squares that a round must remove
LARGEST = 8  # poles of a block
PLACES = 2  # locations at which a pole is tried in each block in a round
SHORT, TRIED, REFINED = 5_000, 14, 40  # samples and iterations of each trial, iterations of the best


def improved(fitted: Fitted, data: IOData) -> Fitted:
    """Leave a wrong minimum: add poles where the error shows that some are missing, and reflect zeros.

    Zeros are reflected at the unit circle.  One round of moves is always made; there is no further round once the error
    shows that no pole is missing.

    Parameters
    ----------
    fitted : Fitted
        A chain with one input, at a minimum for these data.
    data : IOData
        The record.
    """
    short = data.head(SHORT)
    for i in range(ROUNDS):
        chain = fitted.chain
        trials = [p.chain for p in missing_poles(fitted, data, LARGEST, PLACES)]
        if i and not trials:
            break
        trials += [chain._replace(b1=b[None, :]) for b in reflections(chain.b1[0])]
        trials += [chain._replace(b2=b) for b in reflections(chain.b2)]
        if not trials:
            break
        best = min((refine(t, short, TRIED) for t in trials), key=lambda f: f.cost)
        refitted = refine(best.chain, data, REFINED)
        if not refitted.cost < (1.0 - WORTH) * fitted.cost:
            break
        fitted = refitted
    return fitted
