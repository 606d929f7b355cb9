"""One model run over a record in windows of p samples."""

from __future__ import annotations

import numpy as np

from whsklearn import WienerHammersteinSystem
from whsklearn.datasets import make_wiener_hammerstein
from whsklearn.effects.law import polynomial_law
from whsklearn.recursion.rows.predictor import Past, advance, copy_past, respond, state_size
from whsklearn.recursion.rows.subinnovations import (
    Models,
    Samples,
    Schedule,
    run_windows,
)

LINEAR = polynomial_law([0.0, 1.0, 0.5])  # with n_a = 1, n_b = 0, n_c = 1 the model is linear in its parameters


def one_sample_on(blocks, codes, shapes, kappa, past, u_past):
    """The past one sample later."""
    line = Past(*(np.zeros((len(values) + 1, *values.shape[1:])) for values in past))
    copy_past(past, 0, line, 1, past)
    advance(blocks, line, 0, u_past)
    respond(blocks, codes, shapes, kappa, line, 0)
    copy_past(line, 0, past, 0, past)


def run(
    dims, law, theta0, X, y, p=4, frozen=False, p0=1.0, kappa=3.0, forgetting=(1.0, 1.0, 0.99), chunks=1, weight=None
):
    """All state arrays of one model after the record."""
    n = theta0.size
    lags = p + max(dims[0], dims[3], 1)
    s = {
        "theta": theta0[None].copy(), "ud": np.eye(n)[None] * p0, "before": np.zeros((1, state_size(dims))),
        "loss": np.zeros((1, 2)), "motion": np.zeros((1, 2)), "sharpness": np.array([kappa]),
        "recent_u": np.zeros(lags), "recent_y": np.zeros(lags),
    }  # fmt: skip
    since, seen, forgetting = 0, 0, np.array(forgetting)
    weight, recent_weight = np.ones(len(y)) if weight is None else weight, np.ones(lags)
    for part in np.array_split(np.arange(len(y)), chunks):
        since = run_windows(
            Models(*(s[name] for name in Models._fields)), Samples(s["recent_u"], s["recent_y"], recent_weight), since,
            seen, Schedule(forgetting, np.inf, 0.0), (dims, law.codes, law.shapes), p, frozen,
            Samples(X[part], y[part], weight[part]), np.zeros(len(part), dtype=np.uint8),
        )  # fmt: skip
        seen += len(part)
    return s


def example_problem(n=80):
    system = WienerHammersteinSystem.example()
    X, y = make_wiener_hammerstein(n, snr_db=15, random_state=1)
    theta = np.concatenate([system.a[1:], system.b, system.law.weights, system.c[1:], system.d])
    return np.array([2, 2, 2, 2, 3], dtype=np.int64), system.law, theta * 0.8, X, y
