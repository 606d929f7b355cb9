"""The data check of a u-y record."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from whsklearn.gap.data_check import Problem, flat_share
from whsklearn.gap.plants import chain_evidence as rules

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]


def check_chain(u: Array, y: Array) -> list[Problem]:
    """Problems of a record, all of them fatal.

    Examples
    --------
    >>> import numpy as np
    >>> [p.code for p in check_chain(np.ones(1000), np.random.default_rng(0).normal(size=1000))]
    ['data-no-drive']
    """
    bad = [name for name, x in (("input", u), ("output", y)) if not np.all(np.isfinite(x))]
    if bad:
        text = f"The {' and the '.join(bad)} holds values that are missing or not finite; repair or cut them."
        return [Problem("data-not-finite", "Missing values", text)]
    if u.size < rules.FEWEST:
        text = f"{u.size} samples; at least {rules.FEWEST} are needed to tell an effect from noise. Log longer."
        return [Problem("data-too-short", "Record too short", text)]
    if np.ptp(u) == 0 or np.mean(np.diff(u) == 0) > rules.STANDING:
        text = "The input is constant or changes in fewer than 2 % of the samples; pick the input that was applied."
        return [Problem("data-no-drive", "The input does not change", text)]
    if np.ptp(y) == 0 or np.mean(np.diff(y) == 0) > rules.STANDING:
        text = "The output is constant or changes in fewer than 2 % of the samples; pick the measured output."
        return [Problem("data-not-moving", "The output does not change", text)]
    out = []
    share = flat_share(y)
    if share > rules.CLIPPED and np.unique(y).size > rules.LEVELS:
        text = (
            f"The output stands at its extreme for {100 * share:.0f} % of the record: it is clipped in the log. "
            "Log with a wider range, or pass the part that is not clipped."
        )
        out.append(Problem("data-clipped-position", "The output is clipped", text))
    jumps = np.abs(y - np.median(y))
    spikes = int(np.sum(jumps > rules.FAR * (np.quantile(jumps, 0.99) + 1e-300)))
    if spikes:
        text = f"{spikes} samples of the output lie far beyond the rest; repair the outliers."
        out.append(Problem("data-spikes", "Outliers in the output", text))
    return out
