"""
Encoder steps, filters and inertia
==================================

Inverse dynamics differentiates a staircase twice. Where the filter's cut-off is too high the acceleration is noise, and
noise in a regressor makes inertia too small; where it is too low the motion itself is lost. The default chooses the
cut-off from the record.
"""

# %%
# Velocity and acceleration from steps
# ------------------------------------
import matplotlib.pyplot as plt
import numpy as np

from whsklearn import InverseDynamicsLags, RLSRegressor
from whsklearn.datasets import make_servo_log
from whsklearn.filtering import motion

step = 2 * np.pi / 8192
log, truth = make_servo_log([], duration=12.0, noise=0.0, resolution=step, random_state=2, return_truth=True)
q, u = log["position_rad"].to_numpy(), log["torque_nm"].to_numpy()
part = slice(3000, 3400)
figure, panels = plt.subplots(2, 1, figsize=(9, 4.8), sharex=True, layout="constrained")
true_acceleration = np.gradient(truth.record.velocity, log["time_s"])
for cutoff, colour in ((300, "C1"), (60, "C0"), (5, "C2")):
    m = motion(q, sample_rate=1000, cutoff=cutoff)
    panels[0].plot(log["time_s"][part], m.velocity[part], colour, lw=1, label=f"{cutoff} Hz")
    panels[1].plot(log["time_s"][part], m.acceleration[part], colour, lw=1)
panels[0].plot(log["time_s"][part], truth.record.velocity[part], "k--", lw=1, label="true")
panels[1].plot(log["time_s"][part], true_acceleration[part], "k--", lw=1)
panels[0].set(ylabel="velocity, rad/s")
panels[1].set(xlabel="time, s", ylabel="acceleration, rad/s2")
panels[0].legend(ncols=4, fontsize=8)

# %%
# Inertia against the cut-off
# ---------------------------
# The true inertia is 0.05 kg m2. Position and torque pass the same filter only where the cut-off is chosen by the
# default; a given one filters the position alone, as the published method does.
cutoffs = np.geomspace(3, 400, 16)
estimates = []
for cutoff in cutoffs:
    lags = InverseDynamicsLags(sample_rate=1000, cutoff=float(cutoff), decimate=5, border=100)
    estimates.append(RLSRegressor(lags).fit(q[:, None], u).theta_[:3])
estimates = np.array(estimates)
default = InverseDynamicsLags(sample_rate=1000)
chosen = RLSRegressor(default).fit(q[:, None], u)
cutoff = default.fit(q[:, None]).cutoff_
print(f"chosen: {cutoff:.1f} Hz, " + ", ".join(f"{k} {v:.4f}" for k, v in chosen.parameters_.items()))
figure, panels = plt.subplots(1, 3, figsize=(10, 3.2), layout="constrained")
for ax, k, name, value in zip(panels, range(3), ("inertia", "viscous", "coulomb"), (0.05, 0.12, 0.3), strict=True):
    ax.semilogx(cutoffs, estimates[:, k], "o-", ms=3)
    ax.axhline(value, color="k", ls="--", lw=1)
    ax.plot(cutoff, chosen.theta_[k], "C3s", label="default")
    ax.set(title=name, xlabel="cut-off, Hz", ylim=(0.5 * value, 1.5 * value))
panels[0].legend(fontsize=8)
plt.show()
