"""MJCF: the axis as a MuJoCo model of one joint, or of two if motor and load move separately."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from whsklearn.effects import Effect
from whsklearn.effects.hysteresis import LuGre, PreslidingHysteresis
from whsklearn.export.code import render
from whsklearn.export.losses import Loss, losses_of, lost_parts, parts_of, size_of
from whsklearn.export.model import Exported
from whsklearn.systems._servo_drive import chain_of
from whsklearn.systems._servo_step import body_of
from whsklearn.systems.servo import ServoAxis, pack

GRAVITY = 9.81
# MuJoCo's step (s): friction and contacts are constraints that relax over a few steps, which must be much faster than
# any motion that a drive logs at 1 kHz (benchmarks/export.py, --steps)
FINEST = 2.5e-4
CREEP = 2e-3  # time constant of friction at rest (s), eight steps; MuJoCo's default of 20 ms creeps visibly
BRISTLE = 1e-4  # rad: presliding distance of LuGre where it replaces a Stribeck curve, which has none

FAR = 1e3  # position of a stop that does not exist


@dataclass
class Mjcf:
    """Attributes of the elements of the file."""

    joint: dict[str, float] = field(default_factory=dict)
    spring: dict[int, float] = field(default_factory=dict)  # polynomial about ``springref``
    springref: float = 0.0
    damping: dict[int, float] = field(default_factory=dict)
    force: float = 0.0  # constant, on the joint
    limit: float = math.inf
    delay: float = 0.0
    lag: float = 0.0
    gravity: tuple[float, float] = (0.0, 0.0)  # amplitude, phase
    cogging: list[tuple[float, float, float]] = field(default_factory=list)
    lugre: list[tuple[float, ...]] = field(default_factory=list)
    stops: list[tuple[float, float, float]] = field(default_factory=list)  # stiffness, lower and upper end
    twist: dict[str, float] = field(default_factory=dict)
    losses: list[Loss] = field(default_factory=list)


def mjcf(model: Exported) -> tuple[str, list[Loss]]:
    """The text of the file, and the parts of the model that it cannot represent."""
    axis = model.need_axis("MJCF")
    m = mapped(axis, linear=model.linear)
    drive, motion = model.si
    dt = 1.0 / axis.sample_rate
    step = dt / math.ceil(dt / FINEST - 1e-9)
    load = axis.inertia * float(body_of(pack(axis)).share)
    amplitude, phase = m.gravity
    mass, arm = max(axis.inertia, 1e-6), 0.0
    if amplitude:  # half of the inertia is that of a mass on a lever
        arm = 0.5 * (load or axis.inertia) * GRAVITY / abs(amplitude)
        mass = abs(amplitude) / (GRAVITY * arm)
        phase += math.pi if amplitude < 0 else 0.0
    if m.delay and abs(round(m.delay / step) * step - m.delay) > 1e-3 * step:
        held = round(m.delay / step) * step
        m.losses.append(Loss("drive delay", f"{m.delay:.6g} s", f"rounded to {held:.6g} s, whole steps of MuJoCo"))
    m.losses = [*model.foreign(), *model.told(m.losses)]
    text = render(
        "model.mjcf.j2", m=m, kind="slide" if model.linear else "hinge", step=step, dt=dt,
        inertia=axis.inertia - load, load=load, mass=mass, place=(arm * math.cos(phase), arm * math.sin(phase)),
        own=(load or axis.inertia) - mass * arm**2 if arm else (load or axis.inertia), creep=CREEP,
        g=GRAVITY if arm else 0.0, samples=round(m.delay / step), inf=math.inf, drive=drive, motion=motion,
    )  # fmt: skip
    return text, m.losses


def mapped(axis: ServoAxis, linear: bool = False) -> Mjcf:
    """The parts of an axis that MuJoCo can represent with its own elements; the others are ``losses``."""
    packed = pack(axis)
    m = Mjcf(losses=lost_parts(axis, timing=True, transmission=True, limit=True))
    m.delay, first, second, _, m.limit = (float(x) for x in chain_of(packed))
    m.lag = first + second
    if first and second:
        m.losses.append(Loss("actuator_lag", f"{second:.6g} s", "added to the drive's lag: MuJoCo has one"))
    _, share, stiffness, damping, gap, _ = (float(x) for x in body_of(packed))
    if share > 0.0:
        m.twist = {"stiffness": stiffness, "damping": damping, "gap": gap, "ratio": 0.3, "frequency": 0.0}
        reduced = axis.inertia * share * (1.0 - share)
        m.twist["frequency"] = math.sqrt(stiffness / reduced)
        m.twist["ratio"] = damping / (2.0 * math.sqrt(stiffness * reduced))
    if axis.sensor.resolution:
        m.losses.append(Loss("encoder", f"step {axis.sensor.resolution:.6g} rad", "MuJoCo's sensors are not quantized"))
    effects = parts_of(axis)
    m.losses += losses_of([e for e in effects if e.name not in _HOLDERS], "MuJoCo has nothing like it")
    for effect in effects:
        if linear and effect.name == "gravity_imbalance":
            m.losses.append(Loss(effect.name, size_of(effect), "a slide has no angle"))
        else:
            hold_in(m, effect, effects)
    return m


def hold_in(m: Mjcf, effect: Effect, others: list[Effect]) -> None:
    """Add one effect to ``m`` if MuJoCo has an equivalent; ``others`` are the other effects."""
    if effect.name in _HOLDERS:
        _HOLDERS[effect.name](m, effect, others)


def _viscous(m: Mjcf, e: Effect, _: list[Effect]) -> None:
    m.damping[1] = m.damping.get(1, 0.0) + e.magnitude


def _drag(m: Mjcf, e: Effect, _: list[Effect]) -> None:
    m.damping[2] = m.damping.get(2, 0.0) + e.magnitude


def _coulomb(m: Mjcf, e: Effect, others: list[Effect]) -> None:
    if not any(_stribeck_by_lugre(o) for o in others):
        m.joint["frictionloss"] = m.joint.get("frictionloss", 0.0) + e.magnitude


def _stribeck_by_lugre(e: Effect) -> bool:
    return e.name == "stribeck" and e.magnitude > 0.0


def _stribeck(m: Mjcf, e: Effect, others: list[Effect]) -> None:
    dry = sum(o.magnitude for o in others if o.name == "coulomb")
    if e.magnitude <= 0.0 or dry <= 0.0:
        m.losses.append(Loss(e.name, size_of(e), "MuJoCo holds it only on top of Coulomb friction"))
        return
    velocity, exponent = tuple(e.shape.values())[:2] if len(e.shape) > 1 else (*e.shape.values(), 2.0)
    if exponent != 2.0:
        m.losses.append(Loss(e.name, size_of(e), "held with the exponent 2, which is MuJoCo's"))
    stiffness = dry / BRISTLE
    m.lugre.append((stiffness, stiffness * 2e-3, dry, dry + e.magnitude, velocity))


def _presliding(m: Mjcf, e: Effect, _: list[Effect]) -> None:
    if not isinstance(e, PreslidingHysteresis) or type(e) not in (PreslidingHysteresis, LuGre):
        m.losses.append(Loss(e.name, size_of(e), "MuJoCo has Dahl's and LuGre's model only"))
        return
    ratio, velocity, damping = (e.ratio, e.velocity, e.damping) if isinstance(e, LuGre) else (1.0, 1.0, 0.0)
    m.lugre.append((e.torque / e.distance, e.torque * damping / e.distance, e.torque, e.torque * ratio, velocity))


def _cogging(m: Mjcf, e: Effect, _: list[Effect]) -> None:
    order, phase = e.shape["order"], e.shape["phase"]
    if abs(order - round(order)) > 1e-3:
        m.losses.append(Loss(e.name, size_of(e), "MuJoCo takes whole orders only"))
        return
    m.cogging.append((e.magnitude, round(order), phase - 0.5 * math.pi))  # -cos a = sin(a - pi/2)


def _gravity(m: Mjcf, e: Effect, _: list[Effect]) -> None:
    a, p = m.gravity
    x = a * math.cos(p) + e.magnitude * math.cos(e.shape["phase"])
    y = a * math.sin(p) + e.magnitude * math.sin(e.shape["phase"])
    m.gravity = (math.hypot(x, y), math.atan2(y, x))


def _offset(m: Mjcf, e: Effect, _: list[Effect]) -> None:
    m.force -= e.magnitude
    if e.name == "asymmetric_coulomb":
        m.losses.append(Loss(e.name, size_of(e), "held as a constant force, which is the same in motion"))


def _spring(m: Mjcf, e: Effect, others: list[Effect]) -> None:
    cubic = [o for o in others if o.name == "hardening_spring"]
    m.springref = cubic[0].shape["centre"] if cubic else e.shape["centre"]
    m.spring[1] = m.spring.get(1, 0.0) + e.magnitude
    m.force -= e.magnitude * (m.springref - e.shape["centre"])


def _cubic(m: Mjcf, e: Effect, _: list[Effect]) -> None:
    if m.spring.get(3) and e.shape["centre"] != m.springref:
        m.losses.append(Loss(e.name, size_of(e), "a joint has one spring, whose centre is already used"))
        return
    m.springref = e.shape["centre"]
    m.spring[3] = m.spring.get(3, 0.0) + e.magnitude


def _stop(m: Mjcf, e: Any, _: list[Effect]) -> None:
    if e.shape.get("relaxation"):
        m.losses.append(Loss(e.name, size_of(e), "held without its damping: a tendon cannot be damped in contact only"))
    m.stops.append((e.magnitude, *np.clip(e.ends, -FAR, FAR)))


def _part(m: Mjcf, e: Effect, _: list[Effect]) -> None:
    """Effects represented by a part of the axis: limit, delay, lag, transmission."""


_HOLDERS = {
    "viscous": _viscous, "quadratic_drag": _drag, "coulomb": _coulomb, "stribeck": _stribeck,
    "presliding_hysteresis": _presliding, "cogging": _cogging, "gravity_imbalance": _gravity,
    "input_offset": _offset, "asymmetric_coulomb": _offset, "cable_spring": _spring, "hardening_spring": _cubic,
    "end_stop": _stop, "saturation": _part, "input_delay": _part, "actuator_lag": _part, "flexible_coupling": _part,
    "backlash": _part,
}  # fmt: skip
