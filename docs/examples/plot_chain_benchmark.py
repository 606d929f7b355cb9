"""
The Wiener-Hammerstein benchmark
================================

Two third-order filters with a diode between them, a circuit that many methods were tried on (Schoukens, Suykens,
Ljung 2009). The free-run error is minimised, orders and law are found by the estimator. The record belongs to its
makers and is not shipped: where ``WHSKLEARN_DATA`` does not name its folder, this page simulates a likeness, and says
so.
"""

# %%
# The record
# ----------
import os
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from scipy.signal import cheby1, cheby2, lfilter

from whsklearn import PEMRegressor

folder = os.environ.get("WHSKLEARN_DATA")
path = Path(folder) / "wh2009" / "estimation.npz" if folder else None
if path is not None and path.exists():
    with np.load(path) as file:
        u, y = file["u"].ravel()[:10000].astype(float), file["y"].ravel()[:10000].astype(float)
    print("The measured record.")
else:
    rng = np.random.default_rng(0)
    u = lfilter(*cheby1(4, 0.5, 0.4), rng.normal(size=10000))
    x = lfilter(*cheby1(3, 0.5, 4.4e3 / 25.6e3), u)
    v = np.where(x > 0.25, 0.25 + 0.15 * (x - 0.25), x)
    y = lfilter(*cheby2(3, 40, 5e3 / 25.6e3), v) + 1e-4 * rng.normal(size=10000)
    print("The measured record is not here; what follows is a simulated likeness of it.")

# %%
# A fit to the first half
# -----------------------
model = PEMRegressor(criterion="simulation", random_state=0).fit(u[:5000, None], y[:5000])
free_run = model.predict(u[5000:, None])
error = (y[5000:] - free_run)[300:]
print(f"free-run rmse on the second half: {1e3 * np.sqrt(np.mean(error**2)):.3f} mV of {1e3 * np.std(y):.0f} mV")

# %%
# Output and error
# ----------------
figure, (upper, lower) = plt.subplots(2, 1, figsize=(9, 4.4), sharex=True, layout="constrained")
part = slice(1000, 1400)
upper.plot(y[5000:][part], "k", lw=1.6, label="measured")
upper.plot(free_run[part], "C1--", lw=1.2, label="free run")
upper.set(ylabel="output, V")
upper.legend()
lower.plot(1e3 * (y[5000:] - free_run)[part], "C1")
lower.set(xlabel="sample", ylabel="error, mV")

# %%
# The characteristic between the filters
# --------------------------------------
# A straight line that bends where the diode begins to conduct, on one side only. Its scale is shared with the filters.
from whsklearn.effects import as_law

law = as_law(model.structure_.law)
law = law.reweighted([model.parameters_[label] for label in law.labels])
knots = [term.knot for term in law.terms if hasattr(term, "knot")]
x = np.linspace(min(knots), max(knots), 300)
v = law(x, 0.0)
figure, ax = plt.subplots(figsize=(5.4, 3.4), layout="constrained")
ax.plot(x, v)
ax.plot(knots, law(np.array(knots), 0.0), "C0.", label="knots")
ax.set(xlabel="x, behind the first filter", ylabel="v, before the second")
ax.legend()
print("orders of the blocks:", {k: len(np.atleast_1d(model.parameters_[k])) for k in "abcd"})
plt.show()
