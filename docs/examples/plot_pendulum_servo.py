"""
A pendulum on a hobby servo
===========================

A small position servo carries a mass on an arm. Fitted as a rigid axis with friction it is wrong by far, and the gap
says why: what is missing follows the angle, as a cosine of one period a turn. The record is simulated, with the numbers
of a published bench (half a kilogram at 0.1 m, m g l = 0.48 Nm).
"""

# %%
# The record
# ----------
# Twelve seconds, 200 samples a second, the encoder of such a servo (4,096 steps a turn) behind a proportional
# controller.
import matplotlib.pyplot as plt
import numpy as np

from whsklearn import ServoAxis
from whsklearn.effects import Coulomb, FrictionLaw, GravityImbalance, Viscous
from whsklearn.gap import GapFinder
from whsklearn.systems import PIDController, Sensor, record_frame

pendulum = GravityImbalance(0.48, phase=-np.pi / 2)
axis = ServoAxis(
    inertia=7e-3,
    law=FrictionLaw([Viscous(0.05), Coulomb(0.06)]),
    effects=[pendulum],
    controller=PIDController(kp=12.0, ki=0.0, kd=0.4),
    sensor=Sensor(resolution=2 * np.pi / 4096),
    sample_rate=200.0,
    substeps=8,
)
t = np.arange(2400) / 200
reference = 0.9 * np.sin(2 * np.pi * 0.21 * t) + 0.5 * np.sin(2 * np.pi * 0.83 * t) + 0.2 * np.sin(2 * np.pi * 1.9 * t)
log = record_frame(axis.simulate(reference, random_state=0))

# %%
# The diagnosis
# -------------
finder = GapFinder("servo", law="viscous,coulomb", random_state=0)
finder.fit(log, time="time_s", drive="torque_nm", position="position_rad")
print(finder.diagnosis_.sentence)
for effect in finder.effects_:
    numbers = ", ".join(f"{k} {v:.3g} +- {effect.errors.get(k, np.nan):.1g}" for k, v in effect.parameters.items())
    print(f"{effect.name}: {numbers}")

# %%
# The gap against the angle
# -------------------------
# The torque of the rigid axis is subtracted from the logged torque. The rest is a cosine of the angle.
from whsklearn import InverseDynamicsLags

settings = {"sample_rate": 200, "cutoff": 10, "border": 40, "standstill": 0.0}
lags = InverseDynamicsLags(**settings)
phi, torque = lags.rows(log[["position_rad"]].to_numpy(), log["torque_nm"].to_numpy())
both = InverseDynamicsLags(**settings, effects=["input_offset", "gravity_imbalance"])
phi_both, _ = both.rows(log[["position_rad"]].to_numpy(), log["torque_nm"].to_numpy())
theta = np.linalg.lstsq(phi_both, torque, rcond=None)[0]
rest = torque - phi_both[:, :3] @ theta[:3]
gravity = GravityImbalance.from_coefficients(theta[4:6])
where = np.linspace(-1.6, 1.6, 200)
angle = log["position_rad"].to_numpy()[-rest.size :]  # the border is left out at the start
figure, ax = plt.subplots(figsize=(7, 4), layout="constrained")
ax.plot(angle, rest, ".", ms=2, label="torque that inertia and friction leave")
ax.plot(where, gravity.value(position=where), "C1", label=f"{gravity.amplitude:.3f} cos(q {gravity.phase:+.2f})")
ax.set(xlabel="angle, rad", ylabel="torque, Nm")
ax.legend()
plt.show()
