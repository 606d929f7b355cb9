"""Whether two records share samples: a test must not use the data of the fit."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from whsklearn.logs.findings import Array

# Samples in a row in which every signal agrees.  Two runs with the same reference differ by their noise: if nine
# samples in ten of a coarse encoder agree by chance, one window in 40,000 does, and the drive has to agree as well.
RUN = 100
NEAR = 1e-3  # as a share of the deviation of a signal's steps: differences due to units, digits and rounding
DISTINCT = 0.5  # share of the samples of a run that must differ: an axis at rest looks the same in every record


def shared_run(first: ArrayLike, second: ArrayLike) -> tuple[int, int, int] | None:
    """(start in the first, start in the second, length) of a run of samples that both records contain, or None.

    Contents are compared, not names: a copy, a part of the other record, or an overlapping record.

    ``first``, ``second`` (n, k) and (m, k): signals of the two records, in the same units.

    >>> import numpy as np
    >>> rng = np.random.default_rng(0)
    >>> record = rng.standard_normal((1000, 2))
    >>> shared_run(record, record[400:900]), shared_run(record, rng.standard_normal((1000, 2)))
    ((400, 0, 500), None)
    """
    a, b = (np.atleast_2d(np.asarray(x, dtype=float)) for x in (first, second))
    if min(len(a), len(b)) < RUN:
        return None
    near = np.array([_near(x, y) for x, y in zip(a.T, b.T, strict=True)])
    finest = int(np.argmax([np.unique(np.round(x / t)).size for x, t in zip(a.T, near, strict=True)]))
    order = np.argsort(a[:, finest], kind="stable")
    keys = a[order, finest]
    for start in range(0, len(b) - RUN + 1, RUN // 2):
        window = b[start : start + RUN]
        if len(np.unique(np.round(window / near), axis=0)) < DISTINCT * RUN:
            continue
        low, high = np.searchsorted(keys, window[0, finest] + near[finest] * np.array([-1.0, 1.0]))
        places = order[low:high]
        places = places[places <= len(a) - RUN]
        for k in range(RUN):
            if not places.size:
                break
            places = places[np.all(np.abs(a[places + k] - window[k]) <= near, axis=1)]
        if places.size:
            place = int(places.min())
            before = _agree(a[:place][::-1], b[:start][::-1], near)
            return place - before, start - before, before + _agree(a[place:], b[start:], near)
    return None


def _near(x: Array, y: Array) -> float:
    """Tolerance between two readings of the same sample."""
    steps = [np.diff(np.unique(s)) for s in (x, y)]
    finest = [float(s.min()) if s.size else 0.0 for s in steps]  # for quantized signals, the step
    return max(0.51 * max(finest), NEAR * float(np.std(np.diff(y))), 1e-9 * float(np.ptp(y)), 1e-300)


def _agree(a: Array, b: Array, near: Array) -> int:
    """The number of samples from the first on in which two records agree."""
    n = min(len(a), len(b))
    return int(np.argmin(np.r_[np.all(np.abs(a[:n] - b[:n]) <= near, axis=1), False]))
