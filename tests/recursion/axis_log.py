"""An axis under a slow random drive."""

from __future__ import annotations

import numpy as np
from scipy.signal import lfilter

from whsklearn.recursion.batch.axis_free_run import AxisForm, AxisLog

TRUTH = np.array([0.05, 0.1, 0.3, 0.02])


def slow_drive(n, seed):
    return 1.2 * lfilter([0.1], [1.0, -0.98], np.random.default_rng(seed).standard_normal(n)) * 2.0


def axis_log(u, dt=0.005, knots=(), **form):
    n, held = u.size, np.repeat(u[:, None], 4, axis=1)
    form = AxisForm(np.array(knots, dtype=float), **form)
    return AxisLog(held, np.zeros(n), np.ones(n, bool), np.array([0, n]), np.zeros((1, 2)), dt, form)
