"""
A fleet of axes
===============

Three hundred axes of one kind, identified together; three of them are not like the others. Least squares over many axes
is compiled and takes all of them at once; outliers are found by robust distances from the fleet's median.
"""

# %%
# Three hundred records
# ---------------------
# Two seconds each, made by the fleet's spread: 3 % of inertia, 8 % of friction. In three of them something is wrong.
import matplotlib.pyplot as plt
import numpy as np

from whsklearn.recursion import least_squares_of_many

rng = np.random.default_rng(0)
n_axes, t = 300, np.arange(1000) / 500
truth = np.c_[0.05 * rng.normal(1, 0.03, n_axes), 0.12 * rng.normal(1, 0.08, n_axes), 0.3 * rng.normal(1, 0.08, n_axes)]
truth[17, 2] *= 1.6  # a dry bearing
truth[101, 1] *= 1.7  # cold grease
truth[240, 0] *= 1.25  # a load that was left on
phases = rng.uniform(0, 2 * np.pi, (n_axes, 2, 1))
w = 2 * np.pi * np.array([0.9, 3.7])[:, None]
velocity = np.sum(np.array([1.2, 0.5])[:, None] * np.cos(w * t + phases), axis=1)
acceleration = np.sum(-np.array([1.2, 0.5])[:, None] * w * np.sin(w * t + phases), axis=1)
phi = np.stack([acceleration, velocity, np.sign(velocity)], axis=-1)
torque = np.einsum("ank,ak->an", phi, truth) + rng.normal(0, 0.02, (n_axes, t.size))

# %%
# All of them at once
# -------------------
theta, P = least_squares_of_many(phi, torque)
errors = np.sqrt(np.einsum("akk->ak", P) * 0.02**2)
print("median:", dict(zip(("inertia", "viscous", "coulomb"), np.median(theta, axis=0).round(4).tolist(), strict=True)))

# %%
# Who stands apart?
# -----------------
# Distance from the fleet's median in units of its robust spread, 1.48 times the median absolute deviation.
middle = np.median(theta, axis=0)
spread = 1.4826 * np.median(np.abs(theta - middle), axis=0)
distance = np.abs(theta - middle) / spread
apart = np.flatnonzero(distance.max(axis=1) > 4.5)
for i in apart:
    k = int(np.argmax(distance[i]))
    name = ("inertia", "viscous", "coulomb")[k]
    print(f"axis {i}: {name} {theta[i, k]:.4f} +- {errors[i, k]:.4f}, fleet {middle[k]:.4f}")
figure, panels = plt.subplots(1, 2, figsize=(9, 3.8), layout="constrained")
for ax, (i, j), (x, y) in zip(
    panels, ((1, 2), (0, 2)), (("viscous, Nm s/rad", "Coulomb, Nm"), ("inertia, kg m2", "Coulomb, Nm")), strict=True
):
    ax.plot(theta[:, i], theta[:, j], ".", color="0.6")
    ax.plot(theta[apart, i], theta[apart, j], "C3o", mfc="none")
    for k in apart:
        ax.annotate(str(k), (theta[k, i], theta[k, j]), xytext=(5, 3), textcoords="offset points", fontsize=8)
    ax.set(xlabel=x, ylabel=y)

# %%
# ``whsklearn fleet logs/`` does the same with a folder of logs, on Dask workers, and writes a table and an MLflow run.
plt.show()
