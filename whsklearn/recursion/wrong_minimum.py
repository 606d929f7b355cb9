"""Leave a wrong minimum of the free-run error by moves that a descent cannot make."""

from __future__ import annotations

from typing import TYPE_CHECKING

from whsklearn.recursion.block_split import reflections
from whsklearn.recursion.missing_dynamics import missing_poles
from whsklearn.recursion.simulation_error import Fitted, refine

if TYPE_CHECKING:
    from whsklearn.recursion.best_linear import IOData

# on drawn systems (benchmarks/drawn_laws.py) moves that help take 5 % and more away; what takes less bends poles to
# what the law cannot say, and on the benchmark would go on for all rounds
ROUNDS, WORTH = 10, 0.02  # at most, and the share of the sum of squares that a round has to take away
LARGEST = 8  # poles of a block
PLACES = 2  # where a pole is tried in each block in a round
SHORT, TRIED, REFINED = 5_000, 14, 40  # samples and iterations of each trial, iterations of the best


def improved(fitted: Fitted, data: IOData) -> Fitted:
    """Leave a wrong minimum: add poles where the error shows some are missing, and reflect zeros at the unit circle.

    One round of moves is made in any case, and no further one once the error says that no pole is missing.

    Parameters
    ----------
    fitted : Fitted
        A chain of one input at a minimum for these data.
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
        anew = refine(best.chain, data, REFINED)
        if not anew.cost < (1.0 - WORTH) * fitted.cost:
            break
        fitted = anew
    return fitted
