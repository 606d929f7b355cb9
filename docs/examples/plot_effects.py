"""
The effects of a servo axis
===========================

Everything the library can put into a simulated axis, and can name in a log, is one of
thirty effects. Each has a place in the chain from drive to sensor, an equation and a
signature. This page draws them all, place by place.

On the left of each row is the effect itself: the torque that it demands from the drive (or adds to the
measured position) along a simulated run, against the quantity that it depends on. On the
right is what an engineer sees: the drive of the same controlled axis without the effect
(grey) and with it (colour), in the three seconds where the two differ most. Each effect is as large as 15 % of the
rms of the drive; offset and drift of the sensor, which no drive answers, of the position.
"""

import textwrap

import matplotlib.pyplot as plt
import numpy as np
from sklearn.utils import Bunch

from whsklearn.datasets import default_axis, draw_effect, reference_signal
from whsklearn.effects import effect_names, get_effect
from whsklearn.plot import EffectDisplay
from whsklearn.systems import simulate_many

axis = default_axis()
reference = reference_signal("rich", 20.0, axis.sample_rate)


def most_different(without, with_it, n=3000, first=2000):
    """The n samples in which two drives differ most, after the start."""
    power = np.convolve((with_it - without)[first:] ** 2, np.ones(n), mode="valid")
    begin = first + int(np.argmax(power))
    return slice(begin, begin + n)


def draw_rows(names):
    """A picture of these effects, a row each, and their description in words."""
    effects = [draw_effect(name, axis, reference, 0.15, random_state=3) for name in names]
    records = simulate_many([axis, *(axis.with_effect(e) for e in effects)], reference=reference, noise=False)
    _figure, panels = plt.subplots(len(names), 2, figsize=(9, 2.1 * len(names)), squeeze=False, layout="constrained")
    for (left, right), effect, record in zip(panels, effects, records[1:], strict=True):
        EffectDisplay.from_run(effect, record, axes=left)
        label = effect.name if type(effect) is get_effect(effect.name) else type(effect).__name__
        left.set_title(label, loc="left", fontweight="bold", fontsize=10)
        window = most_different(records[0].drive, record.drive)
        right.plot(records[0].time[window], records[0].drive[window], color="0.75", lw=3.5)
        right.plot(record.time[window], record.drive[window], lw=0.9)
        right.set(xlabel="time, s", ylabel="drive, Nm")
        right.set_title(textwrap.shorten(effect.equation, 62, placeholder=" ..."), loc="left", fontsize=10)
    plt.show()
    for effect in effects:
        describe(type(effect))


def describe(cls):
    """The entry of the catalogue in words."""
    label = cls.name if cls is get_effect(cls.name) else f"{cls.name}, {cls.__name__}"
    print(f"{label}: {' '.join(cls.__doc__.split()).removeprefix(f'{cls.__name__}: ')}")
    rows = {"equation": cls.equation}
    for field, q in cls.quantities.items():
        unit, size = "" if q.unit == "1" else f" {q.unit}", " (size)" if field == cls.size else ""
        rows[field] = f"{q.low:g} to {q.high:g}{unit}{size}"
    rows |= {"signature": cls.signature, "needs": cls.needs}
    if cls.aliases:
        rows["alias"] = f"{', '.join(cls.aliases)}: drive and position alone cannot tell them apart"
    rows["reference"] = cls.reference
    print(*(f"    {name:14s} {value}" for name, value in rows.items()), "", sep="\n")


# %%
# Friction
# --------
# What resists motion. Positive sizes brake. ``presliding_hysteresis`` is drawn in its
# simplest shape, Dahl's; ``LuGre``, ``GeneralizedMaxwellSlip`` and ``BoucWen``, its others,
# have a section of their own further down.

draw_rows(effect_names("friction"))

# %%
# Drive
# -----
# What happens between the command that is logged and the torque at the shaft.

draw_rows(effect_names("drive"))

# %%
# Transmission
# ------------
# What splits the one inertia in two: the load no longer is where the motor is.

# sphinx_gallery_thumbnail_number = 3
draw_rows(effect_names("transmission"))

# %%
# Position
# --------
# Torques that belong to a place.

draw_rows(effect_names("position"))

# %%
# Sensor
# ------
# What stands between the axis and its log. These add to the measured position; the drive
# answers because the controller believes the sensor.

draw_rows(effect_names("sensor"))

# %%
# Time
# ----
# What belongs to neither speed nor place.

draw_rows(effect_names("time"))

# %%
# The shapes of presliding hysteresis
# -----------------------------------
# Four models go by the name of ``presliding_hysteresis``. Dahl's is above; these are the others, in the same axis.

from whsklearn.effects import BoucWen, GeneralizedMaxwellSlip, LuGre, PreslidingHysteresis

draw_rows([LuGre, GeneralizedMaxwellSlip, BoucWen])

# %%
# What tells them apart is nested reversals, friction against position: Dahl forgets its inner loops, Maxwell elements
# close them; LuGre falls to the level of sliding (here with a Stribeck ratio of 1.6); Bouc-Wen with beta below one has
# slimmer loops.

from itertools import pairwise

corners = np.array([0.0, 5.0, -3.0, 3.0, -1.0, 3.0, -3.0, 5.0]) * 1e-3
path = np.concatenate([np.linspace(a, b, 800, endpoint=False) for a, b in pairwise(corners)])
time = np.arange(path.size) / 1000.0
still = Bunch(
    time=time,
    position=path,
    velocity=np.gradient(path, time),
    acceleration=np.zeros_like(path),
    drive=np.zeros_like(path),
)
shapes = [
    PreslidingHysteresis(1.0, 1e-3),
    LuGre(1.0, 1e-3, ratio=1.6, velocity=0.01, damping=0.0),
    GeneralizedMaxwellSlip(1.0, 1e-3, elements=8.0),
    BoucWen(1.0, 1e-3, beta=0.6),
]
figure, panels = plt.subplots(1, 4, figsize=(10, 2.8), sharey=True, layout="constrained")
for ax, shape in zip(panels, shapes, strict=True):
    ax.plot(1e3 * path, shape.contribution(still), lw=0.9)
    ax.set(xlabel="position, mrad")
    ax.set_title(type(shape).__name__, fontsize=10)
panels[0].set_ylabel("friction / torque")
plt.show()

# %%
# Standstill
# ----------
# Dry friction is no function at rest: it takes whatever value keeps the axis where it is.
# The simulator resolves that (``friction="stick"``); the smooth sign of (3),
# ``friction="tanh"``, creeps instead.

from whsklearn.effects import Coulomb, Viscous
from whsklearn.systems import ServoAxis

drive = 0.45 * np.sin(2 * np.pi * 0.5 * np.arange(4000) / 1000)
figure, (top, bottom) = plt.subplots(2, 1, figsize=(8, 4), sharex=True, layout="constrained")
for friction, style in (("stick", "-"), ("tanh", "--")):
    run = ServoAxis(0.05, [Viscous(0.12), Coulomb(0.3)], friction=friction, smoothing=0.05).simulate_drive(drive)
    top.plot(run.time, run.velocity, style, label=friction)
    bottom.plot(run.time, run.true_position, style)
top.set(ylabel="velocity, rad/s")
top.legend()
bottom.set(xlabel="time, s", ylabel="position, rad")
plt.show()

# %%
# Where the equations come from
# -----------------------------
# Authors, title, year and, for articles, volume and pages were held against the bibliographies of others. The
# equations themselves were held against texts that write them out for LuGre, the Stribeck curve, Bouc-Wen, the
# eccentric and the oval disc, and the sensor that loses the sign; for the other articles only the abstract or the
# citation could be read. Not looked up, because every textbook of their field has them: quadratic drag
# (Batchelor), offset and trend of a record (Ljung). Friction that settles exponentially is the first-order
# warming of the cited model at a constant load.
