"""
Two masses: compliance or backlash?
===================================

A motor drives its load through a gear. Seen from the motor's encoder, a soft coupling and play have much in common:
both let the motor move before the load does. They part in how the twist depends on the torque, and in what happens
after a reversal.
"""

# %%
# Three axes, one drive
# ---------------------
import matplotlib.pyplot as plt
import numpy as np

from whsklearn import ServoAxis
from whsklearn.effects import Backlash, Coulomb, FlexibleCoupling, FrictionLaw, Viscous

law = FrictionLaw([Viscous(0.12), Coulomb(0.1)])
t = np.arange(6000) / 1000
drive = (
    0.6 * np.sin(2 * np.pi * 0.8 * t) + 0.35 * np.sin(2 * np.pi * 3.1 * t) + 0.1 * np.sign(np.sin(2 * np.pi * 7 * t))
)
axes_of = {
    "rigid": ServoAxis(0.05, law),
    "flexible coupling": ServoAxis(0.05, law, [FlexibleCoupling(4e-3, load_share=0.6, damping_ratio=0.03)]),
    "backlash": ServoAxis(0.05, law, [Backlash(4e-3, load_share=0.6)]),
}
runs = {name: axis.simulate_drive(drive, noise=False) for name, axis in axes_of.items()}

# %%
# Twist against torque
# --------------------
# The spring gives way in proportion to the torque that it carries; the gap is open or closed.
figure, panels = plt.subplots(1, 2, figsize=(9, 3.4), layout="constrained")
for ax, name in zip(panels, ("flexible coupling", "backlash"), strict=True):
    run = runs[name]
    share = 0.6 * 0.05
    load_velocity = np.gradient(run.load_position, t)
    carried = share * np.gradient(load_velocity, t)
    ax.plot(carried[500:3500], 1e3 * (run.true_position - run.load_position)[500:3500], ".", ms=1.5)
    ax.set(title=name, xlabel="torque carried to the load, Nm", ylabel="twist, mrad", xlim=(-1.2, 1.2))

# %%
# What the motor's encoder sees
# -----------------------------
# Difference to the rigid axis in velocity. The coupling rings at one frequency; the gap shows after reversals.
figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.4), layout="constrained")
for name, colour in (("flexible coupling", "C0"), ("backlash", "C1")):
    difference = runs[name].velocity - runs["rigid"].velocity
    left.plot(t[2000:3000], difference[2000:3000], colour, lw=0.9, label=name)
    window = np.hanning(difference.size)
    spectrum = np.abs(np.fft.rfft(window * difference)) / window.sum() * 2
    right.semilogy(np.fft.rfftfreq(t.size, 1e-3), spectrum, colour, lw=0.9)
reduced = 0.05 * 0.6 * 0.4
resonance = np.sqrt(1 / (4e-3 * reduced)) / (2 * np.pi)
right.axvline(resonance, color="0.5", ls="--", lw=0.8)
left.set(xlabel="time, s", ylabel="velocity - rigid, rad/s")
right.set(xlabel="frequency, Hz", ylabel="amplitude, rad/s", xlim=(0, 60), ylim=(1e-5, None))
left.legend(fontsize=8)
print(f"the coupling rings at {resonance:.1f} Hz")

# %%
# Which experiment tells them apart?
# ----------------------------------
# A bias keeps the play closed on one side, where it has no effect; a spring rings as before.
figure, ax = plt.subplots(figsize=(9, 2.8), layout="constrained")
for name, colour in (("flexible coupling", "C0"), ("backlash", "C1")):
    biased = {n: axes_of[n].simulate_drive(drive + 1.2, noise=False) for n in ("rigid", name)}
    difference = biased[name].velocity - biased["rigid"].velocity
    ax.plot(t[2000:3000], difference[2000:3000], colour, lw=0.9, label=f"{name}, biased")
ax.set(xlabel="time, s", ylabel="velocity - rigid, rad/s")
ax.legend(fontsize=8)
plt.show()
