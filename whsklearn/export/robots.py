"""URDF, Isaac Lab and MJCF: the parts of an axis or an arm that robot descriptions represent."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple
from xml.etree.ElementTree import Element, SubElement, indent, tostring

import numpy as np
from numpy.typing import NDArray

from whsklearn import __version__
from whsklearn.effects import Effect, EndStop
from whsklearn.effects.hysteresis import LuGre, PreslidingHysteresis
from whsklearn.export.code import render
from whsklearn.export.model import (
    ROUNDED,
    Exported,
    Loss,
    left_out,
    losses_of,
    lost_parts,
    of_a_whole_order,
    of_joint,
    parts_of,
    rigid,
    size_of,
    with_held_law,
)
from whsklearn.systems._servo_kernel import body_of, chain_of
from whsklearn.systems.arm import BETWEEN, Arm, closed
from whsklearn.systems.arm_files import inertia_matrix
from whsklearn.systems.servo import ServoAxis, pack


def urdf(model: Exported) -> tuple[str, list[Loss]]:
    """A robot of one joint with ``<dynamics>``: damping, Coulomb friction, limits, inertia."""
    axis, losses = with_held_law(model.need_axis("URDF"))
    held = {"viscous", "coulomb", "saturation", "end_stop", *(() if model.linear else ("gravity_imbalance",))}
    losses += left_out(axis, lambda e: e.name in held, "URDF has damping, friction, a mass and limits only")
    losses += lost_parts(axis, limit=True)
    stops = [e for e in parts_of(axis) if isinstance(e, EndStop)]
    losses += [Loss("end_stop", f"stiffness {e.magnitude:.6g} Nm/rad", "held as a rigid limit") for e in stops]
    kind = "prismatic" if model.linear else "revolute" if stops else "continuous"
    losses = [*model.foreign(), *model.told(losses)]
    gravity = Mjcf()
    for effect in parts_of(axis):
        if effect.name == "gravity_imbalance" and not model.linear:
            hold_in(gravity, effect, [])
    hanging = pendulum_of(gravity.gravity, axis.inertia)
    if hanging.g:
        losses.append(Loss("gravity", f"{GRAVITY} m/s2 along -z", "URDF has no gravity; set it in the simulator"))
    root = Element("robot", name="axis")
    SubElement(root, "link", name="base")
    mass = axis.inertia if model.linear else hanging.mass if hanging.g else 0.001
    x, z = hanging.place
    _link(root, "moving", mass, (x, 0.0, z), hanging.own * np.eye(3))
    friction = total(rigid(axis).law.terms, "viscous"), total(parts_of(rigid(axis)), "coulomb")
    joint = _joint(root, "axis", kind, ("base", "moving"), (0.0, -1.0, 0.0) if hanging.g else (0.0, 0.0, 1.0), friction)
    effort = float(chain_of(pack(axis)).limit)
    limit = {"effort": _text(effort if effort < math.inf else 1e9), "velocity": "1e9"}
    if kind != "continuous":
        low, high = max((-FAR, *(e.ends[0] for e in stops))), min((FAR, *(e.ends[1] for e in stops)))
        limit |= {"lower": _text(low), "upper": _text(high)}
    SubElement(joint, "limit", limit)
    return _written(root, f"Units: {', '.join((*model.si, 's'))}.", losses), losses


def isaac(model: Exported) -> tuple[str, list[Loss]]:
    """An Isaac Lab actuator configuration (Python source) for a joint driven by its effort."""
    axis, losses = with_held_law(model.need_axis("An Isaac Lab actuator"))
    held = ("viscous", "coulomb", "saturation", "input_delay", "stribeck")
    losses += left_out(axis, lambda e: e.name in held, "Isaac Lab's actuators have friction, armature, limit and delay")
    losses += [x for x in lost_parts(axis, limit=True) if x.name != "drive delay"]
    chain = chain_of(pack(axis))
    limit, delay = float(chain.limit), float(chain.delay)
    effects = parts_of(rigid(axis))
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


# --- MJCF: the axis as a MuJoCo model of one joint, or of two if motor and load move separately ----------------------
GRAVITY = 9.81
# MuJoCo's step (s): friction and contacts are constraints that relax over a few steps, which must be much faster than
# any motion that a drive logs at 1 kHz (benchmarks/export.py, --steps)
FINEST = 2.5e-4
CREEP = 2e-3  # time constant of friction at rest (s), eight steps; MuJoCo's default of 20 ms creeps visibly
STIFFEST = 0.9999  # impedance of a constraint: MuJoCo takes no more
# rad: presliding distance of LuGre where it replaces a Stribeck curve, which has none.  Any damping of the bristles is
# a peak of friction at each reversal: 2 ms of it at 1e-4 rad put sines of a sticking axis 4 to 8 % off and three waves
# 28 %, this without any 0.2 to 0.9 % and 1.4 % (`benchmarks.export --only sticking`, the first Stribeck curve).
BRISTLE = 1e-6

# Impedance of a stop with a damper, the least that MuJoCo takes: its limit is then a spring and a damper that only
# push, beside this share of the other torques (Computation, "Solver parameters": a1 + d (b v + k r) = (1 - d) a0).
SOFT = 1e-4
FAR = 1e3  # position of a stop that does not exist


@dataclass
class Mjcf:
    """Attributes of the elements of the file.

    >>> from whsklearn.effects import Viscous
    >>> mapped(ServoAxis(inertia=0.05, law=[Viscous(0.2)])).damping  # by the power of the speed
    {1: 0.2}
    """

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
    # stiffness, lower and upper end, and the time constant of the damping, which acts in contact only
    stops: list[tuple[float, float, float, float]] = field(default_factory=list)
    twist: dict[str, Any] = field(default_factory=dict)  # attributes of the joint between motor and load
    load: dict[str, float] = field(default_factory=dict)  # friction of a load that moves by itself
    creep: tuple[float, ...] = (CREEP,)  # time constant of friction at rest (s), and its impedance if not MuJoCo's
    losses: list[Loss] = field(default_factory=list)


def mjcf(model: Exported) -> tuple[str, list[Loss]]:
    """The text of the file, and the parts of the model that it cannot represent."""
    axis = model.need_axis("MJCF")
    m = mapped(axis, linear=model.linear)
    drive, motion = model.si
    dt = 1.0 / axis.sample_rate
    step = dt / math.ceil(dt / FINEST - 1e-9)
    load = axis.inertia * float(body_of(pack(axis)).share)
    hanging = pendulum_of(m.gravity, load or axis.inertia)
    samples = round(m.delay / step)
    if m.delay and abs(samples * step - m.delay) > 1e-3 * step:
        size = f"rounded to {samples * step:.6g} s, whole steps of MuJoCo"
        m.losses.append(Loss("drive delay", f"{m.delay:.6g} s", size))
    m.losses = [*model.foreign(), *model.told(m.losses)]
    root = Element("mujoco", model="axis")
    SubElement(root, "compiler", angle="radian", autolimits="true")
    gravity = _text([0.0, 0.0, -hanging.g])
    SubElement(root, "option", timestep=_text(step), integrator="implicitfast", gravity=gravity)
    body = SubElement(SubElement(root, "worldbody"), "body", name="axis")
    way = {"type": "slide", "axis": "0 0 1"} if model.linear else {"type": "hinge", "axis": "0 -1 0"}
    SubElement(body, "joint", {"name": "axis"} | way | _at_rest(m, spring=not load))
    if load:
        _inertial(body, *_moved(axis.inertia - load, model.linear))
        body = SubElement(body, "body", name="load")
        SubElement(body, "joint", {"name": "twist"} | way | {k: _text(v) for k, v in m.twist.items()})
    if hanging.g:
        _inertial(body, hanging.mass, hanging.own, hanging.place)
    else:
        _inertial(body, *_moved(load or axis.inertia, model.linear))
    tendons = _tendons(m, load, axis.inertia)
    if len(tendons):
        root.append(tendons)
    actuators = SubElement(root, "actuator")
    motor = {"name": "axis", "joint": "axis", "gainprm": "1"}
    motor |= {"ctrlrange": _text([-m.limit, m.limit])} if m.limit < math.inf else {}
    motor |= {"dyntype": "filterexact", "dynprm": _text(m.lag)} if m.lag else {}
    motor |= {"nsample": str(samples), "delay": _text(samples * step)} if samples else {}
    SubElement(actuators, "general", motor)
    if m.force:
        constant = {"gainprm": "0", "biastype": "affine", "biasprm": _text([m.force, 0.0, 0.0])}
        SubElement(actuators, "general", {"name": "constant", "joint": "axis"} | constant)
    _motors(actuators, "axis", "", m)
    SubElement(SubElement(root, "sensor"), "jointpos", name="position", joint="axis")
    units = f"Units: {drive}, {motion}, s{', kg' if drive in ('N', 'Nm') else ''}."
    held = f'The control of actuator "axis" is the drive in {drive}, held over {dt} s.'
    return _written(root, f"{units}\n     {held}", m.losses), m.losses


def _moved(inertia: float, linear: bool) -> tuple[float, float]:
    """Mass and inertia of a body that moves along or about its joint; MuJoCo wants neither to be zero."""
    return (inertia, 0.001) if linear else (0.001, inertia)


def _inertial(body: Element, mass: float, inertia: float, place: tuple[float, float] = (0.0, 0.0)) -> None:
    at = {"pos": _text([place[0], 0.0, place[1]]), "mass": _text(mass), "diaginertia": _text([inertia] * 3)}
    SubElement(body, "inertial", at)


def _tendons(m: Mjcf, load: float, inertia: float) -> Element:
    """What acts where the load is: on the joint, and on the twist if the ``load`` moves by itself."""
    tendons, joints = Element("tendon"), {"axis": 1.0} | ({"twist": 1.0} if load else {})
    for i, (stiffness, low, high, relaxation) in enumerate(m.stops, 1):
        numbers: dict[str, Any] = {"stiffness": stiffness, "springlength": [low, high]}
        if relaxation:
            rate = stiffness / (load or inertia)
            numbers = {"range": [low, high], "solreflimit": [-rate, -rate * relaxation]}
            numbers["solimplimit"] = [SOFT, SOFT, 0.001]
        _tendon(tendons, f"end_stop_{i}" if i > 1 else "end_stop", joints, numbers)
    dragged = {k: v for k, v in m.load.items() if v}
    if load and dragged:
        creep = {"solreffriction": [m.creep[0], 1.0]} if "frictionloss" in dragged else {}
        _tendon(tendons, "load", joints, dragged | creep)
    if load and m.spring:
        _tendon(tendons, "spring", joints, {"stiffness": _polynomial(m.spring), "springlength": m.springref})
    return tendons


def _tendon(tendons: Element, name: str, joints: Mapping[str, float], numbers: Mapping[str, Any]) -> None:
    """Add a fixed tendon over some joints, by their coefficients."""
    fixed = SubElement(tendons, "fixed", {"name": name} | {k: _text(v) for k, v in numbers.items()})
    for joint, coefficient in joints.items():
        SubElement(fixed, "joint", joint=joint, coef=_text(coefficient))


def _at_rest(m: Mjcf, spring: bool = True, armature: float = 0.0) -> dict[str, str]:
    """Attributes of a joint: its own friction and spring."""
    passive: dict[str, Any] = {"damping": _polynomial(m.damping), "frictionloss": m.joint.get("frictionloss")}
    passive["armature"] = armature
    if spring:
        passive |= {"stiffness": _polynomial(m.spring), "springref": m.springref}
    out = {k: _text(v) for k, v in passive.items() if v}
    if "frictionloss" in out:
        out["solreffriction"] = _text([m.creep[0], 1.0])
        out |= {"solimpfriction": _text([m.creep[1], m.creep[1], 0.001])} if m.creep[1:] else {}
    return out


def _motors(actuators: Element, joint: str, prefix: str, m: Mjcf) -> None:
    """Add the passive motors of a joint: cogging and friction with memory."""
    rows: list[tuple[str, tuple[float, ...]]] = [*(("cogging", n) for n in m.cogging), *(("lugre", n) for n in m.lugre)]
    for i, (kind, numbers) in enumerate(rows):
        motor = {"name": f"{prefix}{kind}{i + 1}", "joint": joint, "input": "none", "resistance": "1"}
        SubElement(actuators, "dcmotor", motor | {"motorconst": "0 0", kind: _text(numbers)})


class Pendulum(NamedTuple):
    """A mass (kg) at x and z (m) beside a joint along -y, the inertia about its centre (kg m^2), gravity (m/s^2).

    >>> pendulum_of((0.0, 0.0), 0.2)
    Pendulum(mass=0.2, place=(0.0, 0.0), own=0.2, g=0.0)
    """

    mass: float
    place: tuple[float, float]
    own: float
    g: float


def pendulum_of(gravity: tuple[float, float], inertia: float) -> Pendulum:
    """The pendulum of this ``inertia`` about the joint whose weight is ``gravity`` (amplitude, phase).

    Half of the inertia is that of the mass on its lever.
    """
    amplitude, phase = gravity
    if not amplitude:
        return Pendulum(max(inertia, 1e-6), (0.0, 0.0), inertia, 0.0)
    arm = 0.5 * inertia * GRAVITY / abs(amplitude)
    mass = abs(amplitude) / (GRAVITY * arm)
    phase += math.pi if amplitude < 0 else 0.0
    return Pendulum(mass, (arm * math.cos(phase), arm * math.sin(phase)), inertia - mass * arm**2, GRAVITY)


def mapped(axis: ServoAxis, linear: bool = False) -> Mjcf:
    """The parts of an axis that MuJoCo can represent with its own elements; the others are ``losses``."""
    axis, lost = with_held_law(axis)
    packed = pack(axis)
    m = Mjcf(losses=[*lost, *lost_parts(axis, moving=True, limit=True)])
    m.delay, first, second, _, m.limit = (float(x) for x in chain_of(packed))
    m.lag = first + second
    if first and second:
        m.losses.append(Loss("actuator_lag", f"{second:.6g} s", "added to the drive's lag: MuJoCo has one"))
    _, share, stiffness, damping, gap, _, dry, *_ = (float(x) for x in body_of(packed))
    if share > 0.0:
        m.load = {"frictionloss": dry, "damping": total(axis.effects, "load_viscous")}
        m.twist = {"stiffness": stiffness, "damping": damping}
        if gap:  # a limit with this time constant and damping ratio
            reduced = axis.inertia * share * (1.0 - share)
            damped = [2.0 * reduced / damping, damping / (2.0 * math.sqrt(stiffness * reduced))]
            m.twist = {"range": [-0.5 * gap, 0.5 * gap], "solreflimit": damped}
    if axis.sensor.resolution:
        m.losses.append(Loss("encoder", f"step {axis.sensor.resolution:.6g} rad", "MuJoCo's sensors are not quantized"))
    effects = parts_of(axis)
    m.losses += losses_of([e for e in effects if e.name not in ELEMENTS | PARTS], "MuJoCo has nothing like it")
    for effect in effects:
        if linear and effect.name == "gravity_imbalance":
            m.losses.append(Loss(effect.name, size_of(effect), "a slide has no angle"))
        else:
            hold_in(m, effect, effects)
    return m


# held by a part of the axis
PARTS = {"saturation", "input_delay", "actuator_lag", "flexible_coupling", "backlash", "early_reversal"}
ELEMENTS = {
    "viscous", "quadratic_drag", "coulomb", "stribeck", "presliding_hysteresis", "cogging", "gravity_imbalance",
    "input_offset", "asymmetric_coulomb", "cable_spring", "hardening_spring", "end_stop", "load_viscous",
}  # fmt: skip


def hold_in(m: Mjcf, e: Any, others: list[Effect]) -> None:
    """Add one effect to ``m`` if MuJoCo has an equivalent; ``others`` are all effects."""
    if lost := (_hold_force if e.place in ("drive", "position") else _hold_friction)(m, e, others):
        m.losses.append(Loss(e.name, size_of(e), lost))


def _hold_friction(m: Mjcf, e: Any, others: list[Effect]) -> str:
    """Add friction: damping by powers of the speed, dry friction, bristles; return what of it is lost."""
    match e.name:
        case "viscous" | "quadratic_drag":
            power = 1 if e.name == "viscous" else 2
            m.damping[power] = m.damping.get(power, 0.0) + e.magnitude
        case "load_viscous":
            if not m.load:  # the two are one
                m.damping[1] = m.damping.get(1, 0.0) + e.magnitude
        case "coulomb":
            if not any(o.name == "stribeck" and o.magnitude > 0.0 for o in others):  # whose LuGre element holds it
                m.joint["frictionloss"] = m.joint.get("frictionloss", 0.0) + e.magnitude
        case "early_reversal":
            grip = min(e.impedance, STIFFEST)
            m.creep = (2.0 * e.lead / grip, grip)
        case "asymmetric_coulomb":
            m.force -= e.magnitude
            return "held as a constant force, which is the same in motion"
        case "stribeck":
            dry = sum(o.magnitude for o in others if o.name == "coulomb")
            if e.magnitude <= 0.0 or dry <= 0.0:
                return "MuJoCo holds it only on top of Coulomb friction"
            velocity, exponent = (*e.shape.values(), 2.0)[:2]
            m.lugre.append((dry / BRISTLE, 0.0, dry, dry + e.magnitude, velocity))
            if exponent != 2.0:
                return "held with the exponent 2, which is MuJoCo's"
        case "presliding_hysteresis":
            if type(e) not in (PreslidingHysteresis, LuGre):
                return "MuJoCo has Dahl's and LuGre's model only"
            ratio, velocity, damping = (e.ratio, e.velocity, e.damping) if isinstance(e, LuGre) else (1.0, 1.0, 0.0)
            stiffness = e.torque / e.distance
            m.lugre.append((stiffness, e.torque * damping / e.distance, e.torque, e.torque * ratio, velocity))
    return ""


def _hold_force(m: Mjcf, e: Any, others: list[Effect]) -> str:
    """Add a force of the position or a constant one; return what of it is lost."""
    shape = e.shape
    match e.name:
        case "cogging":
            if (wave := of_a_whole_order(e)) is None:
                return "MuJoCo takes whole orders only"
            phase = shape["phase"] - 0.5 * math.pi  # -cos a = sin(a - pi/2)
            m.cogging.append((e.magnitude, round(shape["order"]), phase))
            return "" if wave is e else ROUNDED
        case "gravity_imbalance":
            a, p = m.gravity
            x = a * math.cos(p) + e.magnitude * math.cos(shape["phase"])
            y = a * math.sin(p) + e.magnitude * math.sin(shape["phase"])
            m.gravity = (math.hypot(x, y), math.atan2(y, x))
        case "input_offset":
            m.force -= e.magnitude
        case "cable_spring":
            m.springref = next((o.shape["centre"] for o in others if o.name == "hardening_spring"), shape["centre"])
            m.spring[1] = m.spring.get(1, 0.0) + e.magnitude
            m.force -= e.magnitude * (m.springref - shape["centre"])
        case "hardening_spring":
            if m.spring.get(3) and shape["centre"] != m.springref:
                return "a joint has one spring, whose centre is already used"
            m.springref = shape["centre"]
            m.spring[3] = m.spring.get(3, 0.0) + e.magnitude
        case "end_stop":
            m.stops.append((e.magnitude, *np.clip(e.ends, -FAR, FAR), shape.get("relaxation", 0.0)))
    return ""


# --- an arm for MuJoCo and as URDF -----------------------------------------------------------------------------------
HELD = ("viscous", "coulomb")
UNITS = "Units: kg, m, rad, s, Nm."
LEAST = 1e-6  # kg and kg m2: MuJoCo accepts no moving body without mass


def arm_mjcf(arm: Arm) -> tuple[str, list[Loss]]:
    """The text of the file, and the parts of the model that it cannot represent; a motor of gear one drives each joint.

    >>> from whsklearn.datasets import default_arm
    >>> from whsklearn.export.robots import arm_mjcf
    >>> text, losses = arm_mjcf(default_arm())
    >>> 'frictionloss="0.3"' in text, losses
    (True, [])
    """
    from scipy.spatial.transform import Rotation

    root = Element("mujoco", model="arm")
    SubElement(root, "compiler", angle="radian")
    options = {"gravity": _text(arm.gravity), "timestep": "0.0005", "integrator": "implicitfast"}
    SubElement(root, "option", options)
    bodies = [SubElement(root, "worldbody")]
    losses: list[Loss] = []
    held: list[Mjcf] = []
    turns = Rotation.from_matrix(arm.rotations).as_quat(scalar_first=True)
    for k, name in enumerate(arm.joints):
        way = {"pos": _text(arm.places[k]), "quat": _text(turns[k])}
        body = SubElement(bodies[arm.parents[k] + 1], "body", {"name": f"{name}_link"} | way)
        bodies.append(body)
        m = _at_joint(name, arm.effects[k], bool(arm.slides[k]))
        held.append(m)
        losses += m.losses
        joint = {"name": name, "type": "slide" if arm.slides[k] else "hinge", "axis": _text(arm.axes[k])}
        SubElement(body, "joint", joint | _at_rest(m, armature=float(arm.armature[k])))
        mass, centre, about = _body(arm, k, losses)
        full = _text(about[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]])
        SubElement(body, "inertial", mass=_text([mass]), pos=_text(centre), fullinertia=full)
    actuators = SubElement(root, "actuator")
    for name, m in zip(arm.joints, held, strict=True):
        bias = {"biastype": "affine", "biasprm": _text([m.force, 0.0, 0.0])} if m.force else {}
        SubElement(actuators, "general", {"name": f"{name}_motor", "joint": name} | bias)
    tendons = SubElement(root, "tendon") if arm.sums or any(m.stops for m in held) else root
    for name, m in zip(arm.joints, held, strict=True):
        _motors(actuators, name, f"{name}_", m)  # after the drives, whose controls stay the first
        for i, (stiffness, low, high, _) in enumerate(m.stops, 1):
            numbers = {"stiffness": stiffness, "springlength": [low, high]}
            _tendon(tendons, f"{name}_end_stop{i}", {name: 1.0}, numbers)
    for name, direction in arm._directions().items():
        damping, friction, lost = _passive(name, arm.sums[name], "MuJoCo's tendons hold damping and frictionloss only")
        losses += lost
        passive = {"damping": damping, "frictionloss": friction, "armature": arm.sum_armature.get(name, 0.0)}
        along = {j: d for j, d in zip(arm.joints, direction, strict=True) if d}
        _tendon(tendons, name, along, {k: v for k, v in passive.items() if v})
    return _written(root, UNITS, losses), losses


# an arm's weight is that of its links, and what is between motor and link has no state here
AT_JOINT = (ELEMENTS | {"early_reversal"}) - {"gravity_imbalance", "load_viscous"}


def _at_joint(name: str, acting: Iterable[Effect], slides: bool) -> Mjcf:
    """The effects of a joint as MuJoCo's elements, with a loss for each that it lacks or takes positive only."""
    m, lost, effects = Mjcf(), [], closed(acting)
    for e in effects:
        if e.magnitude == e.neutral:
            continue
        if e.name in AT_JOINT and (e.magnitude > 0.0 or e.name not in ("viscous", "coulomb", "quadratic_drag")):
            hold_in(m, e, effects)
            if e.shape.get("relaxation"):
                m.losses.append(Loss(e.name, size_of(e), "held without its damping, which the arm's inertia scales"))
        else:
            lost.append(e)
    lost += [e for e in acting if isinstance(e, BETWEEN)]
    m.losses = of_joint(name, [*m.losses, *losses_of(lost, "MuJoCo's joints hold nothing like it")], slides)
    return m


def _polynomial(by_power: dict[int, float]) -> list[float]:
    """Coefficients as MuJoCo takes them, of the first power up to the last there is."""
    return [by_power.get(k, 0.0) for k in range(1, max(by_power, default=0) + 1)]


def arm_urdf(arm: Arm) -> tuple[str, list[Loss]]:
    """The text of the file, and the parts of the model that it cannot represent.

    >>> from whsklearn.datasets import default_arm
    >>> from whsklearn.export.robots import arm_urdf
    >>> [str(loss) for loss in arm_urdf(default_arm())[1]][0]
    "yaw's motor (armature 0.01 kg m2): URDF has no motor inertia"
    """
    from scipy.spatial.transform import Rotation

    root = Element("robot", name="arm")
    SubElement(root, "link", name="base")
    losses: list[Loss] = []
    for k, name in enumerate(arm.joints):
        mass, centre, about = _body(arm, k, losses)
        _link(root, f"{name}_link", mass, centre, about)
        kind = "prismatic" if arm.slides[k] else "continuous"
        damping, friction, lost = _passive(
            name, arm.effects[k], "URDF has damping and friction only", bool(arm.slides[k])
        )
        parent = int(arm.parents[k])
        links = "base" if parent < 0 else f"{arm.joints[parent]}_link", f"{name}_link"
        joint = _joint(root, name, kind, links, arm.axes[k], (damping, friction))
        rpy = Rotation.from_matrix(arm.rotations[k]).as_euler("xyz")
        SubElement(joint, "origin", xyz=_text(arm.places[k]), rpy=_text(rpy))
        if arm.slides[k]:
            SubElement(joint, "limit", effort="1e9", velocity="1e9", lower="-1e3", upper="1e3")
        if arm.armature[k]:
            size = f"armature {arm.armature[k]:.6g} {'kg' if arm.slides[k] else 'kg m2'}"
            losses.append(Loss(f"{name}'s motor", size, "URDF has no motor inertia"))
        losses += lost
    for name, acting in arm.sums.items():
        losses += of_joint(name, losses_of(acting, "URDF has no friction along two joints"), slides=False)
        if arm.sum_armature.get(name):
            losses.append(Loss(f"{name}'s motor", f"{arm.sum_armature[name]:.6g} kg m2", "URDF has no motor inertia"))
    if not np.allclose(arm.gravity, (0.0, 0.0, -9.81), atol=0.02):
        losses.append(Loss("gravity", f"{_text(arm.gravity)} m/s2", "URDF has no gravity; set it in the simulator"))
    return _written(root, UNITS, losses), losses


def _link(root: Element, name: str, mass: float, centre: Any, about: NDArray[Any]) -> None:
    """Add a link by its mass, centre and inertia about it (3, 3)."""
    inertial = SubElement(SubElement(root, "link", name=name), "inertial")
    SubElement(inertial, "origin", xyz=_text(centre), rpy="0 0 0")
    SubElement(inertial, "mass", value=_text(mass))
    ways = {"ixx": (0, 0), "ixy": (0, 1), "ixz": (0, 2), "iyy": (1, 1), "iyz": (1, 2), "izz": (2, 2)}
    SubElement(inertial, "inertia", {key: _text(about[at]) for key, at in ways.items()})


def _joint(
    root: Element, name: str, kind: str, links: tuple[str, str], axis: Any, friction: tuple[float, float]
) -> Element:
    """Add a joint between two links, with its damping and dry friction."""
    joint = SubElement(root, "joint", name=name, type=kind)
    for end, link in zip(("parent", "child"), links, strict=True):
        SubElement(joint, end, link=link)
    SubElement(joint, "axis", xyz=_text(axis))
    SubElement(joint, "dynamics", damping=_text(friction[0]), friction=_text(friction[1]))
    return joint


def _passive(name: str, acting: Iterable[Effect], reason: str, slides: bool = False) -> tuple[float, float, list[Loss]]:
    """Damping and dry friction, with a loss for each other effect and for negative values, which no format accepts."""
    sizes = dict.fromkeys(HELD, 0.0)
    lost = []
    for e in closed(acting):
        if e.name in HELD and e.magnitude >= 0.0:
            sizes[e.name] += e.magnitude
        elif e.magnitude != e.neutral:
            lost.append(e)
    lost += [e for e in acting if isinstance(e, BETWEEN) and e.magnitude != e.neutral]
    return sizes["viscous"], sizes["coulomb"], of_joint(name, losses_of(lost, reason), slides)


def _body(arm: Arm, k: int, losses: list[Loss]) -> tuple[float, NDArray[Any], NDArray[Any]]:
    """Mass, centre, and inertia about the centre of a link; numbers that no body can have are reported and replaced."""
    numbers = arm.inertial[k]
    mass = float(numbers[0])
    if mass <= LEAST:
        if numbers.any():
            losses.append(Loss(f"{arm.joints[k]}'s link", f"mass {mass:.6g} kg", "a link needs one above zero"))
        return LEAST, np.zeros(3), LEAST * np.eye(3) + inertia_matrix(numbers)
    c = numbers[1:4] / mass
    return mass, c, inertia_matrix(numbers) - mass * (c @ c * np.eye(3) - np.outer(c, c))


def _text(values: Any) -> str:
    return " ".join(f"{v:.12g}" for v in np.ravel(values))


def _written(root: Element, text: str, losses: list[Loss]) -> str:
    """The file, with a ``text`` on it and its losses as a comment."""
    told = "".join(f"\n     Not held exactly: {loss}".replace("--", "- ") for loss in losses)
    indent(root)
    comment = f"<!-- Written by whsklearn {__version__}. {text}{told} -->"
    return f'<?xml version="1.0"?>\n{comment}\n{tostring(root, encoding="unicode")}\n'
