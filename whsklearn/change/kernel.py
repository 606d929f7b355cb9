"""The compiled step of the change alarm: whiten, look up the cell, bet, learn."""

from __future__ import annotations

import numpy as np

from whsklearn._numba import njit


@njit(cache=True)
def watch(innovations, first, past, ar, edges, tilt, counts, evidence, threshold, most):
    """Take samples from ``first`` on until the evidence reaches the threshold.

    ``evidence`` holds R of each bet and is updated by R <- (1 + R) e, with e = f(cell) / E f, the
    expectation under the cell frequencies seen so far.  Returns the index of the sample that
    raised the alarm, or -1.
    """
    order, n_cells, n_bets = ar.size, counts.size, evidence.size
    total = 0.0
    for j in range(n_cells):
        total += counts[j]
    for t in range(first, innovations.size):
        w = innovations[t]
        for i in range(order):
            w -= ar[i] * past[i]
        for i in range(order - 1, 0, -1):
            past[i] = past[i - 1]
        if order > 0:
            past[0] = innovations[t]
        cell = np.searchsorted(edges, w)
        mean = 0.0
        for k in range(n_bets):
            expected = 0.0
            for j in range(n_cells):
                expected += tilt[k, j] * counts[j]
            evidence[k] = (1.0 + evidence[k]) * tilt[k, cell] * total / expected
            mean += evidence[k]
        counts[cell] += 1.0
        total += 1.0
        if total > most:
            total = 0.0
            for j in range(n_cells):
                counts[j] *= 0.5
                total += counts[j]
        if mean >= threshold * n_bets:
            return t
    return -1
