"""
A map of cogging over the turn
==============================

A direct-drive motor without anti-cogging table, turning slowly both ways: its current holds many waves over the angle
at once. This page finds their orders, fits them together with inertia and friction, and draws the map that a drive
could add to its command. The record is simulated, with the orders of a rig that was published with its measured table
(LAAS, github.com/heitor-andrade/laas_anti_cogging); ``python -m benchmarks.real_axes --only laas`` runs the measured
one.
"""

# %%
# The record
# ----------
# Forty seconds at 500 Hz, about a turn either way, five waves of cogging.
import matplotlib.pyplot as plt
import numpy as np

from whsklearn import InverseDynamicsLags, RLSRegressor, ServoAxis
from whsklearn.effects import Cogging, Coulomb, FrictionLaw, Viscous
from whsklearn.systems import PIDController, Sensor

waves = ((0.029, 72, 0.3), (0.024, 18, -1.1), (0.018, 12, 2.0), (0.012, 24, 0.0), (0.010, 90, 1.0))
hidden = [Cogging(*numbers) for numbers in waves]
axis = ServoAxis(
    inertia=2e-3,
    law=FrictionLaw([Viscous(0.002), Coulomb(0.03)]),
    effects=hidden,
    controller=PIDController(kp=40.0, ki=40.0, kd=0.6),
    sensor=Sensor(resolution=2 * np.pi / 65536),
    sample_rate=500.0,
    substeps=4,
)
t = np.arange(20000) / 500
reference = 6.0 * np.sin(2 * np.pi * t / 40) + 0.3 * np.sin(2 * np.pi * 0.3 * t)
log = axis.simulate(reference, random_state=0)

# %%
# Which orders?
# -------------
# Inverse dynamics with inertia and friction alone leaves a torque. Projected on a cosine and a sine of each order it
# shows lines; a line at an order is tied to the angle, whatever the speed.
lags = InverseDynamicsLags(sample_rate=500, cutoff=60, border=100, standstill=0.0, effects="input_offset")
phi, torque = lags.rows(log.position[:, None], log.drive)
left = torque - phi @ np.linalg.lstsq(phi, torque, rcond=None)[0]
angle = log.position[-left.size :]
orders = np.arange(1, 121)
spectrum = np.empty(orders.size)
for i, k in enumerate(orders):
    wave = np.c_[np.cos(k * angle), np.sin(k * angle)]
    spectrum[i] = np.hypot(*np.linalg.lstsq(wave, left, rcond=None)[0])
found = np.sort(orders[np.argsort(spectrum)[-5:]])
figure, ax = plt.subplots(figsize=(9, 3), layout="constrained")
ax.vlines(orders, 0, 1e3 * spectrum, color="C0")
ax.plot([e.order for e in hidden], [1e3 * e.amplitude for e in hidden], "kx", label="hidden")
ax.set(xlabel="order, periods a turn", ylabel="amplitude, mNm", title="What inertia and friction leave")
ax.legend()
print("orders found:", found.tolist())

# %%
# All of them at once
# -------------------
# Cogging of a known order is linear in two weights, so recursive least squares takes it as two more columns.
lags.set_params(effects=["input_offset", *(Cogging(1.0, order=float(k)) for k in found)])
model = RLSRegressor(lags).fit(log.position[:, None], log.drive)
weights = dict(zip(lags.fit(log.position[:, None]).get_feature_names_out(), model.theta_, strict=True))
for name, weight in list(weights.items())[:3]:
    print(f"{name:10s} {weight:8.4f}")

# %%
# The map
# -------
# The sum of the waves over one turn, beside what was hidden.
turn = np.linspace(0, 2 * np.pi, 2000)
pairs = model.theta_[4:].reshape(-1, 2)
fitted = [Cogging.from_coefficients(pair, order=float(k)) for pair, k in zip(pairs, found, strict=True)]
identified, truth = (sum(e.value(position=turn) for e in effects) for effects in (fitted, hidden))
figure, (upper, lower) = plt.subplots(2, 1, figsize=(9, 4.6), sharex=True, layout="constrained")
upper.plot(turn, 1e3 * truth, "0.7", lw=3, label="hidden")
upper.plot(turn, 1e3 * identified, "C0", lw=1, label="identified")
upper.set(ylabel="cogging, mNm")
upper.legend(loc="upper right")
lower.plot(turn, 1e3 * (identified - truth), "C1")
lower.set(xlabel="angle, rad", ylabel="error, mNm")
share = np.sqrt(np.mean((identified - truth) ** 2) / np.mean(truth**2))
print(f"the map misses {100 * share:.1f} % of the hidden torque (rms)")
plt.show()
