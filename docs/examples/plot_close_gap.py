"""
Closing the gap of a servo axis
===============================

A model of an axis has been identified, and it does not quite reproduce the log. Which
physical effect is missing, how large is it, and is the repaired model any better? This
page goes from the first overlay to the repaired model, on a log with a hidden effect.
"""

# %%
# The log
# -------
# Forty seconds would be usual; twelve are enough here. The effect is hidden in the log:
# nothing below looks at it but the last line.

import matplotlib.pyplot as plt
import numpy as np

from whsklearn.datasets import make_servo_log
from whsklearn.effects import Cogging
from whsklearn.gap import GapFinder

hidden = Cogging(0.15, 14.0)
log = make_servo_log([hidden], duration=12.0, noise=5e-5, random_state=3)
log.head()

# %%
# The diagnosis
# -------------
# The base model is a rigid axis with viscous and dry friction. It is refitted first, since
# a wrong number is no missing effect; then every effect of the catalogue is tried by
# simulation, and the result is judged on samples that were not used for the fit.

finder = GapFinder("servo", law="viscous,coulomb", random_state=0)
finder.fit(log, time="time_s", drive="torque_nm", position="position_rad")
print(finder.verdict_)
print(finder.diagnosis_.sentence)

# %%
# Simulation and measurement
# --------------------------
# Both models run on the logged drive and start afresh every half second.

pictures = finder.diagnosis_.pictures
time, measured = pictures["time"], pictures["measured"]
part = (time > 4) & (time < 6)
figure, (upper, lower) = plt.subplots(2, 1, sharex=True, figsize=(8, 5))
upper.plot(time[part], measured[part], "k", label="measured")
upper.plot(time[part], pictures["runs"]["before"][part], "C1", label="base model")
upper.plot(time[part], pictures["runs"]["after"][part], "C2--", label="repaired model")
upper.set_ylabel("position, rad")
upper.legend()
for name, colour in (("before", "C1"), ("after", "C2")):
    lower.plot(time[part], 1e3 * (measured - pictures["runs"][name])[part], colour)
lower.set(xlabel="time, s", ylabel="error, mrad")
figure.tight_layout()

# %%
# Where the gap lies
# -------------------
# The torque that the base model lacks, by periods a turn: a line at one order is tied to
# the angle, whatever the speed.

figure, axes = plt.subplots(figsize=(8, 3))
axes.plot(pictures["orders"], pictures["order_spectrum"][0], "C1", label="before")
axes.plot(pictures["orders"], pictures["order_spectrum"][1], "C2", label="after")
axes.set(xlabel="order, periods a turn", ylabel="missing torque, Nm")
axes.legend()
figure.tight_layout()

# %%
# The effect and the repaired model
# ---------------------------------
# Parameters come with standard errors, and the repaired model is a `ServoAxis` that can be
# simulated, changed and refitted as any other.

for effect in finder.effects_:
    for name, value in effect.effect.labelled().items():
        print(f"{effect.name}: {name} = {value:.4g} +- {effect.standard_errors[name]:.2g}")
for row in finder.diagnosis_.horizons:
    print(f"restarted every {row['horizon']} s: {row['before']:.2e} -> {row['after']:.2e} (floor {row['floor']:.2e})")
print(finder.model_.effects)

# %%
# What was hidden:

print(hidden)
assert [e.name for e in finder.effects_] == ["cogging"]
assert np.isclose(finder.effects_[0].effect.amplitude, hidden.amplitude, rtol=0.05)
