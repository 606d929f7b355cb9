"""
Into MuJoCo and back
====================

An identified axis is exported as an MJCF model and replayed in MuJoCo on the same drive. The replay follows the
library's own simulation; without the effects that were found it would not. What MJCF cannot hold is listed, with its
size.
"""

# %%
# An axis with cogging and an off-centre mass
# -------------------------------------------
import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from whsklearn import ServoAxis
from whsklearn.effects import CableSpring, Cogging, Coulomb, FrictionLaw, GravityImbalance, TorqueRipple, Viscous
from whsklearn.export import export_model

law = FrictionLaw([Viscous(0.12), Coulomb(0.3)])
effects = [CableSpring(0.5), GravityImbalance(0.3, 0.2), Cogging(0.1, 12.0, 0.3)]
axis = ServoAxis(0.05, law, [*effects, TorqueRipple(0.01, 6.0)], substeps=4)
folder = Path(tempfile.mkdtemp())
done = export_model(axis, to="mjcf", out=folder)
print(done.paths[0].read_text())
print(*done.losses, sep="\n")

# %%
# The replay
# ----------
t = np.arange(6000) / 1000
drive = 1.0 * np.sin(2 * np.pi * 0.5 * t) + 0.4 * np.sin(2 * np.pi * 1.7 * t)
own = axis.simulate_drive(drive, noise=False).true_position
poor = ServoAxis(0.05, law, [CableSpring(0.5)], substeps=4).simulate_drive(drive, noise=False).true_position
try:
    import mujoco

    model = mujoco.MjModel.from_xml_path(str(done.paths[0]))
    data = mujoco.MjData(model)
    replay = np.empty_like(drive)
    for k, u in enumerate(drive):
        replay[k] = data.qpos[0]
        data.ctrl[0] = u
        mujoco.mj_step(model, data, round(1e-3 / model.opt.timestep))
except ImportError:
    print("MuJoCo is not installed; the library's own run stands in its place.")
    replay = own

# %%
figure, (upper, lower) = plt.subplots(2, 1, figsize=(9, 4.8), sharex=True, layout="constrained")
upper.plot(t, own, "0.7", lw=3, label="library")
upper.plot(t, replay, "C0", lw=1, label="MuJoCo")
upper.plot(t, poor, "C1", lw=1, label="without gravity and cogging")
upper.set(ylabel="position, rad")
upper.legend(loc="upper right")
lower.plot(t, 1e3 * (replay - own), "C0")
lower.set(xlabel="time, s", ylabel="MuJoCo - library, mrad")
print(f"rms of the difference: {1e3 * np.sqrt(np.mean((replay - own) ** 2)):.2f} mrad of {1e3 * np.std(own):.0f} mrad")
plt.show()
