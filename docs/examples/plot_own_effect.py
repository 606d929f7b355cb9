"""
An effect of your own
=====================

A magnet sits beside the path of an axis and pulls in one place. The catalogue has no such effect: one class makes it
known, and then it is simulated, searched, named and drawn as any other.
"""

# %%
# One class
# ---------
# Fields with the size first, what they mean, and one method in plain ``math``.
import math

import matplotlib.pyplot as plt
import numpy as np

from whsklearn import ServoAxis
from whsklearn.checks import check_effect
from whsklearn.datasets import make_servo_log
from whsklearn.effects import Effect, number
from whsklearn.gap import GapFinder


class Magnet(Effect):
    """A magnet beside the path pulls at one place, c exp(-(q/w)^2) (Nm)."""

    torque: float = number(0.1, "Nm", -1, 1)
    width: float = number(0.2, "rad", 0.01, 1, log=True)

    name = "magnet"
    place = "position"
    equation = "c exp(-(q/w)^2)"
    signature = "a bump over the position"

    @staticmethod
    def evaluate(p, time, position, velocity, drive):
        return p[0] * math.exp(-((position / p[1]) ** 2))


print("passed:", ", ".join(check_effect(Magnet)))

# %%
# Simulated
# ---------
# It is compiled into every fine step of the axis.
drive = 0.5 * np.sin(2 * np.pi * 0.4 * np.arange(5000) / 1000)
figure, ax = plt.subplots(figsize=(9, 2.8), layout="constrained")
for size in (0.0, 0.1, 0.2):
    run = ServoAxis().with_effect(Magnet(size, 0.2)).simulate_drive(drive, noise=False)
    ax.plot(run.time, run.true_position, label=f"{size} Nm")
ax.set(xlabel="time, s", ylabel="position, rad")
ax.legend(title="magnet")

# %%
# Searched and named
# ------------------
log = make_servo_log([Magnet(0.15, 0.25)], duration=8.0, random_state=3)
finder = GapFinder("servo", random_state=0).fit(log)
print(finder.diagnosis_.sentence)
for effect in finder.effects_:
    print(effect.name, {k: round(v, 3) for k, v in effect.parameters.items()})

# %%
# Drawn
# -----
q = np.linspace(-1.5, 1.5, 400)
figure, ax = plt.subplots(figsize=(7, 3), layout="constrained")
ax.plot(q, Magnet(0.15, 0.25).value(position=q), "0.7", lw=3, label="hidden")
for effect in finder.effects_:
    ax.plot(q, effect.effect.value(position=q), "C1", lw=1.2, label=f"found: {effect.name}")
ax.set(xlabel="position, rad", ylabel="torque, Nm")
ax.legend()
plt.show()
