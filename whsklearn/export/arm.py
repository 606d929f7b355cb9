"""An arm for MuJoCo and as URDF: links, motors' inertia, damping and dry friction; the rest is listed as losses."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any
from xml.etree import ElementTree

import numpy as np

from whsklearn.export.losses import Loss, losses_of
from whsklearn.systems.arm_files import inertia_matrix

if TYPE_CHECKING:
    from collections.abc import Iterable

    from numpy.typing import NDArray

    from whsklearn.effects import Effect
    from whsklearn.systems.arm import Arm

HELD = ("viscous", "coulomb")
LEAST = 1e-6  # kg and kg m2: MuJoCo accepts no moving body without mass


def arm_mjcf(arm: Arm) -> tuple[str, list[Loss]]:
    """The text of the file, and the parts of the model that it cannot represent; a motor of gear one drives each joint.

    Examples
    --------
    >>> from whsklearn.datasets import default_arm
    >>> from whsklearn.export.arm import arm_mjcf
    >>> text, losses = arm_mjcf(default_arm())
    >>> 'frictionloss="0.3"' in text, losses
    (True, [])
    """
    from scipy.spatial.transform import Rotation

    root = ElementTree.Element("mujoco", model="arm")
    ElementTree.SubElement(root, "compiler", angle="radian")
    options = {"gravity": _text(arm.gravity), "timestep": "0.0005", "integrator": "implicitfast"}
    ElementTree.SubElement(root, "option", options)
    bodies = [ElementTree.SubElement(root, "worldbody")]
    losses: list[Loss] = []
    for k, name in enumerate(arm.joints):
        x, y, z, w = Rotation.from_matrix(arm.rotations[k]).as_quat()
        body = ElementTree.SubElement(
            bodies[arm.parents[k] + 1], "body", name=f"{name}_link", pos=_text(arm.places[k]), quat=_text([w, x, y, z])
        )
        bodies.append(body)
        damping, friction, lost = _passive(name, arm.effects[k], "MuJoCo's joints hold damping and frictionloss only")
        losses += lost
        joint = {"name": name, "type": "slide" if arm.slides[k] else "hinge", "axis": _text(arm.axes[k])}
        passive = {"damping": damping, "frictionloss": friction, "armature": float(arm.armature[k])}
        ElementTree.SubElement(body, "joint", joint | {key: _text([v]) for key, v in passive.items() if v})
        mass, centre, about = _body(arm, k, losses)
        full = _text(about[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]])
        ElementTree.SubElement(body, "inertial", mass=_text([mass]), pos=_text(centre), fullinertia=full)
    actuators = ElementTree.SubElement(root, "actuator")
    for name in arm.joints:
        ElementTree.SubElement(actuators, "motor", name=f"{name}_motor", joint=name)
    tendons = ElementTree.SubElement(root, "tendon") if arm.sums else root
    for name, direction in arm._directions().items():
        damping, friction, lost = _passive(name, arm.sums[name], "MuJoCo's tendons hold damping and frictionloss only")
        losses += lost
        passive = {"damping": damping, "frictionloss": friction, "armature": arm.sum_armature.get(name, 0.0)}
        tendon = ElementTree.SubElement(
            tendons, "fixed", {"name": name} | {k: _text([v]) for k, v in passive.items() if v}
        )
        for of, coefficient in zip(arm.joints, direction, strict=True):
            if coefficient:
                ElementTree.SubElement(tendon, "joint", joint=of, coef=_text([coefficient]))
    return _written(root, losses), losses


def arm_urdf(arm: Arm) -> tuple[str, list[Loss]]:
    """The text of the file, and the parts of the model that it cannot represent.

    Examples
    --------
    >>> from whsklearn.datasets import default_arm
    >>> from whsklearn.export.arm import arm_urdf
    >>> [str(loss) for loss in arm_urdf(default_arm())[1]][0]
    "yaw's motor (armature 0.01 kg m2): URDF has no motor inertia"
    """
    from scipy.spatial.transform import Rotation

    root = ElementTree.Element("robot", name="arm")
    ElementTree.SubElement(root, "link", name="base")
    losses: list[Loss] = []
    for k, name in enumerate(arm.joints):
        mass, centre, about = _body(arm, k, losses)
        inertial = ElementTree.SubElement(ElementTree.SubElement(root, "link", name=f"{name}_link"), "inertial")
        ElementTree.SubElement(inertial, "origin", xyz=_text(centre), rpy="0 0 0")
        ElementTree.SubElement(inertial, "mass", value=_text([mass]))
        ways = {"ixx": (0, 0), "ixy": (0, 1), "ixz": (0, 2), "iyy": (1, 1), "iyz": (1, 2), "izz": (2, 2)}
        ElementTree.SubElement(inertial, "inertia", {key: _text([about[at]]) for key, at in ways.items()})
        kind = "prismatic" if arm.slides[k] else "continuous"
        joint = ElementTree.SubElement(root, "joint", name=name, type=kind)
        parent = int(arm.parents[k])
        ElementTree.SubElement(joint, "parent", link="base" if parent < 0 else f"{arm.joints[parent]}_link")
        ElementTree.SubElement(joint, "child", link=f"{name}_link")
        rpy = Rotation.from_matrix(arm.rotations[k]).as_euler("xyz")
        ElementTree.SubElement(joint, "origin", xyz=_text(arm.places[k]), rpy=_text(rpy))
        ElementTree.SubElement(joint, "axis", xyz=_text(arm.axes[k]))
        damping, friction, lost = _passive(name, arm.effects[k], "URDF has damping and friction only")
        ElementTree.SubElement(joint, "dynamics", damping=_text([damping]), friction=_text([friction]))
        if arm.slides[k]:
            ElementTree.SubElement(joint, "limit", effort="1e9", velocity="1e9", lower="-1e3", upper="1e3")
        if arm.armature[k]:
            losses.append(Loss(f"{name}'s motor", f"armature {arm.armature[k]:.6g} kg m2", "URDF has no motor inertia"))
        losses += lost
    for name, acting in arm.sums.items():
        reason = "URDF has no friction along two joints"
        losses += [Loss(f"{name}'s {x.name}", x.size, x.reason) for x in losses_of(acting, reason)]
        if arm.sum_armature.get(name):
            losses.append(Loss(f"{name}'s motor", f"{arm.sum_armature[name]:.6g} kg m2", "URDF has no motor inertia"))
    if not np.allclose(arm.gravity, (0.0, 0.0, -9.81), atol=0.02):
        losses.append(Loss("gravity", f"{_text(arm.gravity)} m/s2", "URDF has no gravity; set it in the simulator"))
    return _written(root, losses), losses


def _passive(name: str, acting: Iterable[Effect], reason: str) -> tuple[float, float, list[Loss]]:
    """Damping and dry friction, with a loss for each other effect and for negative values, which no format accepts."""
    sizes = dict.fromkeys(HELD, 0.0)
    lost = []
    for e in acting:
        if e.name in HELD and e.magnitude >= 0.0:
            sizes[e.name] += e.magnitude
        elif e.magnitude != e.neutral:
            lost.append(e)
    told = [Loss(f"{name}'s {x.name}", x.size, x.reason) for x in losses_of(lost, reason)]
    return sizes["viscous"], sizes["coulomb"], told


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


def _written(root: ElementTree.Element, losses: list[Loss]) -> str:
    """The file, with its losses as a comment."""
    told = "".join(f"\n     Not held: {loss}".replace("--", "- ") for loss in losses)
    ElementTree.indent(root)
    comment = f"<!-- Written by whsklearn. Units: kg, m, rad, s, Nm.{told} -->"
    return f"{comment}\n{ElementTree.tostring(root, encoding='unicode')}\n"
