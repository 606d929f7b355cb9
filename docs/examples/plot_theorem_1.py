"""
Theorem 1: the bound (22) beside the measured error
===================================================

With the true regressors of (6), least squares is what Theorem 1 speaks of. Its condition, persistent excitation,
is measured on the regressors; its bound is drawn beside the squared parameter error of thirty records.
"""

import matplotlib.pyplot as plt
import numpy as np

from whsklearn import RLSRegressor, WienerHammersteinLags
from whsklearn.datasets import make_wiener_hammerstein
from whsklearn.validation import convergence_bound, excitation

P0 = 1e3
instants = np.unique(np.geomspace(20, 5000, 40).astype(int))
errors = np.empty((30, instants.size))
for seed, row in enumerate(errors):
    X, y, truth = make_wiener_hammerstein(5000, snr_db=20, random_state=seed, return_truth=True)
    phi = WienerHammersteinLags(theta=truth.theta).fit_transform(X, y)
    model, seen = RLSRegressor(P0=P0), 0
    for i, t in enumerate(instants):
        model.partial_fit(phi[seen:t], y[seen:t])
        seen = t
        row[i] = np.sum((model.theta_ - truth.theta) ** 2)

# %%
# The excitation of the last record. alpha is small: some directions of theta are hardly seen, so the bound is wide.

seen = excitation(phi, names=WienerHammersteinLags().fit(X).get_feature_names_out())
print(f"alpha {seen.alpha:.2e}, beta {seen.beta:.2f}, effective rank {seen.rank} of {phi.shape[1]}")

# %%
# The bound holds, and it is loose: it takes every direction for the least excited one.

bound = convergence_bound(instants, seen.alpha, seen.beta, phi.shape[1], P0, float(np.var(truth.d)))
figure, axes = plt.subplots(figsize=(7, 4.2), layout="constrained")
axes.loglog(instants, bound, "k--", label="bound (22)")
axes.loglog(instants, errors.mean(axis=0), label="measured, mean of 30 records")
axes.fill_between(instants, *np.quantile(errors, [0.05, 0.95], axis=0), alpha=0.25, label="5 to 95 %")
axes.set(xlabel="samples", ylabel=r"$\|\hat\theta(t) - \theta\|^2$", title="Theorem 1 on Example 5.1 at 20 dB")
axes.legend()
print(f"largest measured mean over the bound: {np.max(errors.mean(axis=0) / bound):.2g}")
plt.show()
