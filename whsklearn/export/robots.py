"""URDF and Isaac Lab: the parts of an axis that robot descriptions represent."""

from __future__ import annotations

import math
from pathlib import Path

from whsklearn.effects import Effect, EndStop
from whsklearn.export.code import render
from whsklearn.export.losses import Loss, left_out, lost_parts, parts_of
from whsklearn.export.mjcf import FAR
from whsklearn.export.model import Exported
from whsklearn.logs.files import atomic_write
from whsklearn.systems._servo_drive import chain_of
from whsklearn.systems.servo import pack


def urdf(model: Exported) -> tuple[str, list[Loss]]:
    """A robot of one joint with ``<dynamics>``: damping, Coulomb friction, limits, inertia."""
    axis = model.need_axis("URDF")
    held = ("viscous", "coulomb", "saturation", "end_stop")
    losses = left_out(axis, lambda e: e.name in held, "URDF has damping, friction and limits only")
    losses += lost_parts(axis, timing=False, transmission=False, limit=True)
    stops = [e for e in parts_of(axis) if isinstance(e, EndStop)]
    losses += [Loss("end_stop", f"stiffness {e.magnitude:.6g} Nm/rad", "held as a rigid limit") for e in stops]
    kind = ("prismatic" if model.linear else "revolute") if stops else ("prismatic" if model.linear else "continuous")
    losses = [*model.foreign(), *model.told(losses)]
    low, high = max((-FAR, *(e.ends[0] for e in stops))), min((FAR, *(e.ends[1] for e in stops)))
    text = render(
        "model.urdf.j2", kind=kind, inertia=axis.inertia, damping=total(axis.law.terms, "viscous"),
        friction=total(parts_of(axis), "coulomb"), limit=float(chain_of(pack(axis)).limit), low=low, high=high,
        inf=math.inf, linear=model.linear, losses=losses, units=", ".join((*model.si, "s")),
    )  # fmt: skip
    return text, losses


def isaac(model: Exported) -> tuple[str, list[Loss]]:
    """An Isaac Lab actuator configuration (Python source) for a joint driven by its effort."""
    axis = model.need_axis("An Isaac Lab actuator")
    held = ("viscous", "coulomb", "saturation", "input_delay", "stribeck")
    losses = left_out(axis, lambda e: e.name in held, "Isaac Lab's actuators have friction, armature, limit and delay")
    losses += [x for x in lost_parts(axis, timing=False, transmission=False, limit=True) if x.name != "drive delay"]
    chain = chain_of(pack(axis))
    limit, delay = float(chain.limit), float(chain.delay)
    effects = parts_of(axis)
    dry, peak = total(effects, "coulomb"), total(effects, "stribeck")
    if peak:
        losses.append(Loss("stribeck", f"torque {peak:.6g} Nm", "held as static friction, without its velocity"))
    samples = delay * axis.sample_rate
    if abs(samples - round(samples)) > 1e-3:
        losses.append(
            Loss("drive delay", f"{delay:.6g} s", f"rounded to {round(samples)} steps of {1 / axis.sample_rate:.6g} s")
        )
    losses = [*model.foreign(), *model.told(losses)]
    text = render(
        "model.isaac.j2", inertia=axis.inertia, friction=dry + peak, dynamic=dry, inf=math.inf,
        viscous=total(effects, "viscous"), limit=limit, delay=round(samples), dt=1.0 / axis.sample_rate, losses=losses,
        units=", ".join((*model.si, "s")),
    )  # fmt: skip
    return text, losses


def total(effects: list[Effect] | tuple[Effect, ...], name: str) -> float:
    """Sum of the sizes of the effects of one name."""
    return float(sum(e.magnitude for e in effects if e.name == name))


def write_text(text: str, out: Path, name: str) -> Path:
    """Write a file; ``out`` is its path, or a folder in which it is called ``name``."""
    path = out if out.suffix else out / name
    path.parent.mkdir(parents=True, exist_ok=True)
    atomic_write(path, text.encode())
    return path
