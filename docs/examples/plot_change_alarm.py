"""
When the axis changes
=====================

Friction of a running axis rises by a quarter. The estimator goes on learning, an alarm with a stated rate of false ones
notices, the past is let go, and the estimates before and after say what changed.
"""

# %%
# A stream
# --------
# Forty seconds; Coulomb friction rises at 20 s. The alarm's rate holds for innovations that are independent once they
# are whitened; here the torque is measured with white noise that outweighs what the filter of the position leaves.
import matplotlib.pyplot as plt
import numpy as np

from whsklearn import InverseDynamicsLags, RLSRegressor
from whsklearn.change import ChangeAlarm, compare_parameters, forgetting_after, set_forgetting
from whsklearn.datasets import make_servo_log
from whsklearn.effects import ParameterChange

change = ParameterChange(0.075, time=20.0, parameter="coulomb")
log = make_servo_log([change], duration=40.0, random_state=1)
lags = InverseDynamicsLags(sample_rate=1000, cutoff=60, decimate=5, border=50)
measured = log["torque_nm"].to_numpy() + np.random.default_rng(0).normal(0.0, 0.3, len(log))
phi, torque = lags.rows(log[["position_rad"]].to_numpy(), measured)
time = np.linspace(0, 40, len(torque), endpoint=False)  # roughly: rows at rest are left out
print(f"{len(torque)} rows")

# %%
# Alarm, forget, settle
# ---------------------
# The alarm watches the prediction error of each row before it is learnt. False alarms are a million rows apart or more.
model, alarm = RLSRegressor(), ChangeAlarm(interval=1e6, n_reference=1200, n_settle=400)
before, since, path, evidence, alarms = None, None, [], [], []
for k in range(0, len(torque), 10):
    X, y = phi[k : k + 10], torque[k : k + 10]
    if k:
        raised = alarm.update(y - model.predict(X))
        if len(raised) and before is None:
            before, since = (model.theta_.copy(), model.covariance_.copy()), k
            alarms.append(k)
            model.forget_past(50)
    if since is not None:
        set_forgetting(model, forgetting_after(k - since))
    model.partial_fit(X, y)
    path.append(model.theta_[2])
    evidence.append(alarm.evidence_)

# %%
figure, (upper, lower) = plt.subplots(2, 1, figsize=(9, 4.8), sharex=True, layout="constrained")
seconds = time[::10]
upper.plot(seconds, path, label="Coulomb friction, estimated")
upper.step([0, 20, 40], [0.3, 0.375, 0.375], "k--", where="post", label="true")
upper.set(ylabel="Nm", ylim=(0.2, 0.45))
lower.semilogy(seconds, np.maximum(evidence, 1e-3))
lower.axhline(1e6, color="0.5", ls="--", lw=0.8)
lower.set(xlabel="time, s", ylabel="evidence of a change")
for k in alarms:
    upper.axvline(time[k], color="C3", lw=1, label=f"alarm at {time[k]:.2f} s")
upper.legend(loc="lower right")

# %%
# What changed?
# -------------
names = list(lags.get_feature_names_out())
for change in compare_parameters(names, *before, model.theta_, model.covariance_):
    print(change, "" if change.significant else "(not significant)")
plt.show()
