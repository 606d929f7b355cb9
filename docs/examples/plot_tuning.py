"""
Tuning p and P0
===============

The innovation length p and the scale P0 of the initial covariance are the two knobs of a multi-innovation recursion.
How much do they matter? Here the pure recursion (``memory=0``) and the default are run over both, on records of 600
samples.
"""

# %%
# A grid, over several seeds
# --------------------------
# One seed tells nothing: the spread over records is as large as the difference between settings.
import matplotlib.pyplot as plt
import numpy as np

from whsklearn import RMILSRegressor, WienerHammersteinLags
from whsklearn.datasets import make_wiener_hammerstein
from whsklearn.metrics import nmse

P, P0, SEEDS = (1, 2, 4, 8), (1e-2, 1.0, 1e2, 1e4), range(5)
records = [make_wiener_hammerstein(600, snr_db=20, random_state=s) for s in SEEDS]
X_test, y_test = make_wiener_hammerstein(1000, snr_db=None, random_state=100)


def median_nmse(**settings):
    """Median free-run error over the records."""
    errors = []
    for seed, (X, y) in zip(SEEDS, records, strict=True):
        model = RMILSRegressor(WienerHammersteinLags(), random_state=seed, **settings).fit(X, y)
        errors.append(nmse(y_test, model.predict(X_test)))
    return float(np.median(errors)), float(np.max(errors))


grid = np.array([[median_nmse(p=p, P0=p0, memory=0, n_starts=16)[0] for p0 in P0] for p in P])
figure, ax = plt.subplots(figsize=(6.4, 3.6), layout="constrained")
image = ax.imshow(np.log10(grid), cmap="viridis_r")
ax.set(xticks=range(len(P0)), xticklabels=[f"{v:g}" for v in P0], yticks=range(len(P)), yticklabels=P)
ax.set(xlabel="P0", ylabel="p", title="pure recursion, median free-run NMSE")
for i, j in np.ndindex(grid.shape):
    shade = image.norm(np.log10(grid[i, j]))  # of viridis_r: from yellow, which is light, to purple
    ax.text(j, i, f"{grid[i, j]:.2g}", ha="center", va="center", color="black" if shade < 0.5 else "white", fontsize=9)

# %%
# With the memory
# ---------------
# The default re-runs what it has kept, and then p hardly matters.
for p in (1, 4):
    middle, worst = median_nmse(p=p)
    print(f"default memory, p = {p}: median {middle:.2g}, worst {worst:.2g}")

# %%
# ``whsklearn tune`` searches p, P0, forgetting, orders and laws with cross-validation over time, and records every
# candidate in MLflow; `Tuning p, P0 and orders <../tuning.html>`_ says how to read the runs.
plt.show()
