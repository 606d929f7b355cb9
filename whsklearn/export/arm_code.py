"""The law of an arm as C: drives from position, velocity and acceleration of all joints, specialised to its numbers.

The rigid-body equations exist once, in `whsklearn.systems._arm_kernels`.  Here they are evaluated on expressions
instead of numbers, with known geometry and links, so that zeros and constants are never computed (Khalil and Dombre
2002, ch. 9, customised symbolic method).
"""

from __future__ import annotations

import math
from functools import partialmethod
from types import FunctionType, SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sklearn.utils import Bunch

from whsklearn.effects import codes
from whsklearn.export.axis_code import Fragment, arranged_law, compensated, static_torque
from whsklearn.export.code import render
from whsklearn.export.languages import C, Symbol
from whsklearn.export.model import Loss, losses_of, of_joint
from whsklearn.export.specialise import Specialiser
from whsklearn.systems import _arm_kernels as kernels
from whsklearn.systems._servo_kernel import plant_of
from whsklearn.systems.arm import Arm, closed

_UNKNOWN = "it needs more than position, velocity and acceleration"


class Traced:
    """A number that is known only at run time; arithmetic with it generates code.

    >>> from whsklearn.export.specialise import Specialiser, Symbol
    >>> work = Specialiser(C())
    >>> work.store("torque[0]", (2.0 * Traced(work, Symbol("velocity[0]")) + 1.0).value)
    >>> print(*work.finish()[0], sep=chr(10))
    x_0 = 2.0 * velocity[0];
    x_1 = x_0 + 1.0;
    torque[0] = x_1;
    """

    def __init__(self, work: Specialiser, value: Any):
        self.work, self.value = work, value

    def _with(self, op: str, other: Any, *, first: bool = True) -> Any:
        number = other.value if isinstance(other, Traced) else float(other)
        pair = (self.value, number) if first else (number, self.value)
        value = self.work.bind("x", self.work.binary(op, *pair))
        return Traced(self.work, value) if isinstance(value, Symbol) else value

    __add__ = partialmethod(_with, "Add")
    __radd__ = partialmethod(_with, "Add", first=False)
    __sub__ = partialmethod(_with, "Sub")
    __rsub__ = partialmethod(_with, "Sub", first=False)
    __mul__ = partialmethod(_with, "Mult")
    __rmul__ = partialmethod(_with, "Mult", first=False)

    def wave(self, name: str) -> Traced:
        """Its sine or cosine."""
        text = self.work.language.function(name, [self.work.text(self.value)])
        return Traced(self.work, self.work.bind(name, Symbol(text)))


def on_expressions(module: Any) -> dict[str, Any]:
    """The functions of a module of kernels as plain Python, in which sine and cosine accept expressions."""
    names: dict[str, Any] = dict(vars(module))
    names["math"] = SimpleNamespace(sin=lambda x: x.wave("sin"), cos=lambda x: x.wave("cos"))
    for name, value in vars(module).items():
        if hasattr(value, "py_func"):
            names[name] = FunctionType(value.py_func.__code__, names, name)
    return names


def torques_code(arm: Arm, language: C) -> Fragment:
    """Statements that fill ``torque`` from ``position``, ``velocity`` and ``acceleration``, joint by joint."""
    n, work = arm.n_joints, Specialiser(language)
    q, v, a = (
        [Traced(work, Symbol(f"{name}[{k}]")) for k in range(n)] for name in ("position", "velocity", "acceleration")
    )
    room = kernels.Scratch(*(_zeros(*shape) for shape in ((3, 3), (n, kernels.N_MOTION), (n, n, 6), (kernels.N_BODY,))))
    known = on_expressions(kernels)
    known["move"](arm._links, q, v, a, room)
    total = _zeros(n)
    known["pay"](arm._links, arm.inertial, room, total)
    for k, acting in enumerate(arm.effects):
        total[k] = _with_effects(work, acting, q[k], v[k], total[k] + float(arm.armature[k]) * a[k])
    for name, direction in arm._directions().items():
        x, speed, acceleration = (_along(direction, signal) for signal in (q, v, a))
        motor = float(arm.sum_armature.get(name, 0.0)) * acceleration
        along = _with_effects(work, arm.sums[name], x, speed, motor)
        total[:] = [before + float(d) * along if d else before for before, d in zip(total, direction, strict=True)]
    for k, asked in enumerate(total):
        work.store(f"torque[{k}]", asked.value if isinstance(asked, Traced) else asked)
    return Fragment(*work.finish())


def _along(direction: Any, signal: Any) -> Any:
    """The component of a signal of all joints along an axis."""
    out = 0.0
    for d, x in zip(direction, signal, strict=True):
        out = out + float(d) * x if d else out
    return out


def _with_effects(work: Specialiser, acting: Any, position: Any, velocity: Any, asked: Any) -> Any:
    """The torque required by the effects of an axis."""
    there = [e for e in closed(acting) if e.magnitude != e.neutral]
    rest = Bunch(position=np.zeros(1), velocity=np.zeros(1))
    asked = asked + sum(float(e.contribution(rest)[0]) for e in there if e.code == codes.INPUT_OFFSET)
    driven = [e for e in there if e.code == codes.LOAD_FRICTION]
    for effects in ([e for e in there if _static(e)], driven):
        if effects:
            drive = asked.value if isinstance(asked, Traced) else asked
            plant = plant_of(effects, np.zeros(0))
            here = (arranged_law(plant.codes, plant.p, effects), position.value, velocity.value, math.inf, drive)
            asked = asked + Traced(work, work.bind("friction", work.call(static_torque, *here)))
    return asked


def c_of_arm(arm: Arm, name: str, real: str = "double") -> tuple[dict[str, str], list[Loss]]:
    """Header and source by file name, and their losses.

    >>> from whsklearn.datasets import default_arm
    >>> from whsklearn.export.arm_code import c_of_arm
    >>> files, losses = c_of_arm(default_arm(), "turntable")
    >>> sorted(files), losses, "0.3" in files["turntable.c"]
    (['turntable.c', 'turntable.h'], [], True)
    """
    losses = arm_losses(arm)
    joints = [(j, "m" if s else "rad", "N" if s else "Nm") for j, s in zip(arm.joints, arm.slides, strict=True)]
    names = {"name": name, "real": real, "joints": joints, "losses": losses, "guard": f"{name.upper()}_H"}
    part = torques_code(arm, C(real))
    return {f"{name}.{end}": render(f"arm.{end}.j2", code=part, **names) for end in ("h", "c")}, losses


def arm_losses(arm: Arm) -> list[Loss]:
    """Effects that its code cannot represent."""
    losses: list[Loss] = []
    slides = dict(zip(arm.joints, arm.slides, strict=True))
    for joint, acting in {**dict(zip(arm.joints, arm.effects, strict=True)), **arm.sums}.items():
        held = (codes.LOAD_FRICTION, codes.INPUT_OFFSET)
        out = [e for e in acting if e.magnitude != e.neutral and not _static(e) and e.code not in held]
        losses += of_joint(joint, losses_of(out, _UNKNOWN), bool(slides.get(joint)))
    return losses


def _static(effect: Any) -> bool:
    return effect.port == "torque" and (effect.evaluate is not None or compensated(effect.code))


def _zeros(*shape: int) -> NDArray[np.object_]:
    return np.full(shape, 0.0, dtype=object)
