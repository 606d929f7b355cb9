"""What the catalogue itself knows about an effect, put on its page: curve, equation, ranges, signature, source."""

from __future__ import annotations

import inspect
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

import whsklearn.effects
from whsklearn.datasets import default_axis, draw_effect, reference_signal
from whsklearn.effects import PLACES, Effect, LoadSideViscous, base
from whsklearn.effects.chain import CHAIN_FORMS
from whsklearn.gap.plants.arm_terms import ALONG_TWO, at_a_joint
from whsklearn.plot import EffectDisplay
from whsklearn.systems.arm import BETWEEN


def catalogued() -> list[type[Effect]]:
    """Every effect of the catalogue, the shapes of presliding hysteresis and the static terms of laws included."""
    classes = [c for c in vars(whsklearn.effects).values() if inspect.isclass(c) and issubclass(c, Effect)]
    return [c for c in classes if c.name and c.place in (*PLACES, "static")]


def drawn() -> list[type[Effect]]:
    """Those with a curve on an axis, which has no port of a chain, and no load to rub without a coupling."""
    without = (*CHAIN_FORMS.values(), LoadSideViscous)
    return [c for c in catalogued() if c not in without]


def static_curve(cls: type[Effect]) -> EffectDisplay:
    """A memoryless term by itself, over x or over its change dx, whichever it depends on."""
    effect, x = (cls(degree=3.0) if cls.name == "power" else cls()), np.linspace(-2.0, 2.0, 401)
    over_x = np.ptp(effect.value(position=x)) > 0
    values = effect.value(position=x) if over_x else effect.value(velocity=x)
    return EffectDisplay(x, values, "x" if over_x else "dx, x(t) - x(t-1)", "y", line=True).plot()


def presliding_curve(cls: type[Effect]) -> EffectDisplay:
    """Friction that builds up over a distance, over an oscillation of a few of those about standstill."""
    effect, t = cls(), np.linspace(0.0, 2.0 * np.pi, 4001)
    path = effect.distance * (2.0 * np.sin(2.0 * t) + 1.5 * np.sin(5.0 * t))
    values = effect.value(position=path, velocity=np.gradient(path, t / 100.0))
    return EffectDisplay(1e3 * path, values, "position, mrad", "torque, Nm", line=True).plot()


def draw(folder: Path) -> None:
    """A curve of each effect, once; delete the folder to draw them again."""
    folder.mkdir(parents=True, exist_ok=True)
    missing = [c for c in drawn() if not (folder / f"{c.__name__}.png").exists()]
    if not missing:
        return
    axis = default_axis()
    reference = reference_signal("rich", 20.0, axis.sample_rate)
    for cls in missing:
        if cls.place == "static":
            display = static_curve(cls)
        elif cls.name == "presliding_hysteresis":
            display = presliding_curve(cls)
        else:
            effect = draw_effect(cls, axis, reference, 0.15, random_state=3)
            run = axis.with_effect(effect).simulate(reference, noise=False)
            display = EffectDisplay.from_run(effect, run)
        display.figure_.savefig(folder / f"{cls.__name__}.png", dpi=110)
        plt.close(display.figure_)


def forget_own(gallery_conf, fname):
    """Take effects that a page of the gallery defined out of the catalogue again, before and after each page."""
    for name, cls in list(base._REGISTRY.items()):
        if not cls.__module__.startswith("whsklearn."):
            del base._REGISTRY[name]


def at_a_joint_of_an_arm(cls: type[Effect]) -> str:
    """Whether `Arm` simulates the effect there, and whether `gap` names it."""
    if cls.port == "block" and not issubclass(cls, BETWEEN):
        return "no"
    if cls.name not in {c.name for c in at_a_joint()}:
        return "simulated, not named by ``gap``"
    both = ", also along two joints that one gear turns" if cls.name in ALONG_TWO else ""
    return f"simulated, and named by ``gap``{both}"


def describe(app, what, name, obj, options, lines):
    """Put the catalogue's entry behind the summary of an effect's page."""
    if what != "class" or not (inspect.isclass(obj) and issubclass(obj, Effect) and obj.equation):
        return
    rows = [f":Name: ``{obj.name}``", f":Place: {obj.place}", f":Equation: ``{obj.equation}``"]
    for field, q in obj.quantities.items():
        unit, size = "" if q.unit == "1" else f" {q.unit}", ", the size" if field == obj.size else ""
        rows.append(f":{field.replace('_', ' ')}: {q.low:g} to {q.high:g}{unit}{size}")
    rows += [f":Signature: {obj.signature}"] if obj.signature else []
    rows += [f":The record must hold: {obj.needs}"] if obj.needs else []
    if obj.aliases:
        rows.append(f":No log can tell it from: {', '.join(f'``{a}``' for a in obj.aliases)}")
    if obj.place in PLACES and obj not in CHAIN_FORMS.values():
        rows.append(f":At a joint of an arm: {at_a_joint_of_an_arm(obj)}")
    rows += [f":Source: {obj.reference}"] if obj.reference else []
    curve = []
    if obj in drawn():
        curve = [
            "",
            f".. image:: /api/curves/{obj.__name__}.png",
            f"   :alt: {obj.name} against what it depends on",
            "   :width: 480px",
        ]
    end = next((i for i, line in enumerate(lines) if not line.strip()), len(lines))
    lines[end:end] = ["", *rows, *curve, ""]
