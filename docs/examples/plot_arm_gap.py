"""
What a robot's model lacks, joint by joint
==========================================

A turntable of two axes has cogging at its pitch, and a load that it did not have when it was identified. The gap of the
coupled joints names both where they are.
"""

# %%
# A name is an effect with its joint
# ----------------------------------
import matplotlib.pyplot as plt
import numpy as np

from whsklearn.datasets import default_arm, make_arm_log
from whsklearn.effects import Cogging
from whsklearn.gap import GapFinder
from whsklearn.identification import identify_arm

robot = default_arm()
position, torque = make_arm_log(robot, effects={"pitch": [Cogging(0.1, order=7)]}, return_arrays=True)
time = np.arange(len(position)) / 500.0
finder = GapFinder(robot).fit((time, position, torque))
print(finder.diagnosis_.sentence)

# %%
# What is missing at each joint, before and after
# -----------------------------------------------
figure, axes = plt.subplots(2, 1, figsize=(9, 4.8), sharex=True, layout="constrained")
joints = finder.diagnosis_.pictures["joints"]
for ax, (joint, (t, drive, before, after, unit)) in zip(axes, joints.items(), strict=True):
    ax.plot(t, drive, "0.7", label="drive")
    ax.plot(t, before, "C1", lw=1, label="missing before")
    ax.plot(t, after, "C0", lw=1, label="missing after")
    ax.set(ylabel=f"{joint}, {unit}")
axes[0].legend(loc="upper right")
axes[1].set(xlabel="time, s")
for row in finder.diagnosis_.joints:
    print(row)

# %%
# A load, against the numbers without it
# --------------------------------------
# An identified model stays as it is; what is named has come since.
empty = identify_arm(*make_arm_log(robot, return_arrays=True), dt=0.002, robot=robot)
loaded = make_arm_log(robot.with_body("pitch", 0.3, (0.15, 0.0, 0.02)), random_state=3, return_arrays=True)
since = GapFinder(empty.model).fit((time, *loaded))
for effect in since.effects_:
    print(effect.label, effect.parameters, effect.errors)
plt.show()
