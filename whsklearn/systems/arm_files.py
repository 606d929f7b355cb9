"""The geometry, inertias and joints of an arm from URDF or MJCF (read by MuJoCo), or from Denavit-Hartenberg rows."""

from __future__ import annotations

import math
import os
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
from numpy.typing import ArrayLike

from whsklearn.effects import CableSpring, Coulomb, Effect, Viscous
from whsklearn.effects.base import Array

STANDARD_GRAVITY = (0.0, 0.0, -9.81)


def body_numbers(mass: float, centre: ArrayLike, inertia: ArrayLike) -> Array:
    """The ten inertial parameters of a body, shape (10,): m, m c, and the inertia about the origin.

    ``mass``: mass (kg). ``centre`` (3,): centre of mass (m). ``inertia`` (3, 3): inertia about the centre of mass (kg
    m2). Returns (10,): m, h_x, h_y, h_z, I_xx, I_xy, I_yy, I_xz, I_yz, I_zz.
    """
    c = np.asarray(centre, dtype=float)
    about = np.asarray(inertia, dtype=float) + mass * (c @ c * np.eye(3) - np.outer(c, c))
    return np.array([mass, *(mass * c), *(about[i, j] for i, j in ((0, 0), (0, 1), (1, 1), (0, 2), (1, 2), (2, 2)))])


def rotation_about(axis: ArrayLike, angle: float) -> Array:
    """Rotation matrix (3, 3) about a unit vector, by Rodrigues' formula.

    ``axis`` is (3,). ``angle``: in rad.
    """
    k = across(axis)
    return np.eye(3) + math.sin(angle) * k + (1.0 - math.cos(angle)) * (k @ k)


def across(axis: ArrayLike) -> Array:
    """The skew-symmetric matrix (3, 3) that maps b to a x b."""
    x, y, z = np.asarray(axis, dtype=float)
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def dh_fields(rows: Iterable[Sequence[Any]], *, modified: bool) -> dict[str, Any]:
    """Fields of an `Arm` from rows (a, alpha, d, theta, and "prismatic" where a joint slides).

    The link's frame is that of the joint, before the constant part of its own row in the standard convention.
    """
    slides, rotations, places = [], [], []
    rotation, place = np.eye(3), np.zeros(3)  # of the constant part after the last joint
    for row in rows:
        a, alpha, d, theta, *kind = row
        slides.append(bool(kind) and str(kind[0]).startswith("p"))
        turn, twist = rotation_about([0, 0, 1], theta), rotation_about([1, 0, 0], alpha)
        if modified:  # Craig: Rot x (alpha) Trans x (a) Rot z (theta) Trans z (d)
            rotations.append(twist @ turn)
            places.append(twist @ np.array([a, 0.0, d]))
        else:  # Rot z (theta) Trans z (d) Trans x (a) Rot x (alpha)
            rotations.append(rotation @ turn)
            places.append(place)
            rotation, place = twist, np.array([a, 0.0, d])
    n = len(slides)
    return {
        "joints": tuple(f"joint{i + 1}" for i in range(n)), "parents": np.arange(n) - 1, "slides": slides,
        "rotations": rotations, "places": places, "axes": np.tile([0.0, 0.0, 1.0], (n, 1)),
    }  # fmt: skip


def file_fields(source: str | os.PathLike[str], joints: Iterable[str] | None) -> dict[str, Any]:
    """Fields of an `Arm` from a URDF or an MJCF file, or its text; joints that are not named are locked at zero.

    Raises ImportError if MuJoCo is not installed. Raises ValueError if the file cannot be read, has no such joint, or
    is not a tree of hinges and slides.
    """
    try:
        import mujoco
    except ImportError:
        raise ImportError("MuJoCo is needed to read robot files; pip install 'whsklearn[mujoco]'.") from None
    try:
        model, given = _compiled(mujoco, source)
    except (ValueError, ElementTree.ParseError) as error:
        raise ValueError(f"The robot's file cannot be read: {' '.join(str(error).split())}") from None
    names = [model.joint(i).name or f"joint{i + 1}" for i in range(model.njnt)]
    wanted = names if joints is None else list(joints)
    if missing := [n for n in wanted if n not in names]:
        raise ValueError(f"The robot has no joint {missing[0]!r}; it has {', '.join(names)}.")
    if not wanted:
        raise ValueError("The robot's file has no joint, expected hinges or slides; give the file of the whole robot.")
    slide, hinge = int(mujoco.mjtJoint.mjJNT_SLIDE), int(mujoco.mjtJoint.mjJNT_HINGE)
    for i, name in enumerate(names):
        if name in wanted and model.jnt_type[i] not in (slide, hinge):
            raise ValueError(
                f"Joint {name!r} is a ball or a free joint, expected hinges and slides; fix the base, or name the "
                "joints that were logged."
            )
    link_of, fields = _tree(model, names, wanted, given)
    _refuse_loops(mujoco, model, names, wanted, link_of)
    return fields | _sums(mujoco, model, names, wanted)


def _sums(mujoco: Any, model: Any, names: Sequence[str], wanted: Sequence[str]) -> dict[str, Any]:
    """Friction and motors along sums of joints: fixed tendons with factors of one and minus one."""
    sums: dict[str, tuple[Effect, ...]] = {}
    motors: dict[str, float] = {}
    for k in range(model.ntendon):
        parts = range(model.tendon_adr[k], model.tendon_adr[k] + model.tendon_num[k])
        factors = {names[model.wrap_objid[i]]: model.wrap_prm[i] for i in parts}
        joint = all(model.wrap_type[i] == mujoco.mjtWrap.mjWRAP_JOINT for i in parts)
        if joint and set(factors) <= set(wanted) and set(np.abs(list(factors.values()))) == {1.0}:
            name = "".join(f"{'-' if x < 0 else '+'}{joint}" for joint, x in factors.items()).removeprefix("+")
            sizes = (Viscous(float(model.tendon_damping[k])), Coulomb(float(model.tendon_frictionloss[k])))
            sums[name] = tuple(e for e in sizes if e.magnitude > 0.0)
            motors[name] = float(model.tendon_armature[k])
    return {"sums": sums, "sum_armature": motors}


def _compiled(mujoco: Any, source: str | os.PathLike[str]) -> tuple[Any, dict[str, Array]]:
    """MuJoCo's model, and the ten numbers of each body in its own frame where the file is a URDF.

    MuJoCo demands masses and inertias above zero; nominal files often lack them.  So a URDF is compiled with bodies of
    one kilogram, for its kinematics, and its inertias are stored separately.
    """
    text = str(source)
    if not text.lstrip().startswith("<"):
        text = Path(source).read_text(encoding="utf-8")
    if "${" in text or "<xacro:" in text:
        raise ValueError("it is a xacro, expected a URDF; expand it first: xacro robot.urdf.xacro > robot.urdf.")
    root = ElementTree.fromstring(text)
    if root.tag != "robot":
        spec = mujoco.MjSpec.from_string(text) if text == str(source) else mujoco.MjSpec.from_file(str(source))
        return spec.compile(), {}
    names = [joint.get("name") for joint in root.findall("joint")]
    if twice := [name for name in names if names.count(name) > 1]:  # MuJoCo drops the name of the second
        raise ValueError(f"it has {names.count(twice[0])} joints named {twice[0]!r}, expected a name for each.")
    for link in root.iter("link"):  # meshes are often missing and do not affect the dynamics
        for kind in ("visual", "collision"):
            for element in link.findall(kind):
                link.remove(element)
    spec = mujoco.MjSpec.from_string(ElementTree.tostring(root, encoding="unicode"))
    spec.compiler.fusestatic = False
    given = {}
    for body in spec.bodies[1:]:
        xx, yy, zz, xy, xz, yz = np.nan_to_num(np.array(body.fullinertia, dtype=float))
        turn = _matrix(mujoco, body.iquat)
        inertia = turn @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ turn.T
        given[body.name] = body_numbers(float(body.mass), np.nan_to_num(np.array(body.ipos)), inertia)
        body.explicitinertial, body.mass, body.ipos, body.inertia = True, 1.0, np.zeros(3), np.ones(3)
        body.fullinertia = np.full(6, np.nan)
    return spec.compile(), given


def _matrix(mujoco: Any, quaternion: Any) -> Array:
    """Rotation matrix of a quaternion (w, x, y, z)."""
    out = np.zeros(9)
    mujoco.mju_quat2Mat(out, np.asarray(quaternion, dtype=float))
    return out.reshape(3, 3)


def moved_numbers(numbers: Array, rotation: Array, place: Array) -> Array:
    """The ten numbers of a body, shape (10,), in a frame in which the body's own frame has this rotation and origin.

    ``numbers`` is (10,). ``rotation`` is (3, 3). ``place`` is (3,).
    """
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = rotation, place
    return numbers_of(pose @ pseudo_inertia(numbers) @ pose.T)


def pseudo_inertia(numbers: Array) -> Array:
    """The pseudo-inertia (4, 4) of ten numbers, shape (10,): [[tr(I) / 2 1 - I, m c], [m c', m]]."""
    inertia, out = inertia_matrix(numbers), np.empty((4, 4))
    out[:3, :3] = 0.5 * np.trace(inertia) * np.eye(3) - inertia
    out[:3, 3] = out[3, :3] = numbers[1:4]
    out[3, 3] = numbers[0]
    return out


def numbers_of(pseudo: Array) -> Array:
    """The inverse: ten numbers, shape (..., 10), of pseudo-inertias (..., 4, 4)."""
    inner = pseudo[..., :3, :3]
    inertia = np.trace(inner, axis1=-2, axis2=-1)[..., None, None] * np.eye(3) - inner
    lower = inertia[..., [0, 0, 1, 0, 1, 2], [0, 1, 1, 2, 2, 2]]
    return np.concatenate([pseudo[..., 3, 3:], pseudo[..., :3, 3], lower], axis=-1)


def inertia_matrix(numbers: Array) -> Array:
    """Inertia (3, 3) about the frame's origin from the ten numbers."""
    xx, xy, yy, xz, yz, zz = numbers[4:]
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def _tree(model: Any, names: list[str], wanted: list[str], given: dict[str, Array]) -> tuple[list[int], dict[str, Any]]:
    """The link that each body belongs to (-1: the base), and the fields of the arm."""
    import mujoco

    link_of, poses = [-1], [(np.eye(3), np.zeros(3))]  # of bodies, within their link
    out: dict[str, list[Any]] = {
        k: [] for k in ("joints", "parents", "slides", "rotations", "places", "axes", "inertial", "armature", "effects")
    }
    for b in range(1, model.nbody):
        parent = int(model.body_parentid[b])
        link, (turn, at) = link_of[parent], poses[parent]
        at = at + turn @ model.body_pos[b]
        turn = turn @ _matrix(mujoco, model.body_quat[b])
        for i in range(model.body_jntadr[b], model.body_jntadr[b] + model.body_jntnum[b]):
            if names[i] not in wanted:
                continue
            anchor, axis = model.jnt_pos[i], model.jnt_axis[i]
            slides, zero = (
                model.jnt_type[i] == int(mujoco.mjtJoint.mjJNT_SLIDE),
                float(model.qpos0[model.jnt_qposadr[i]]),
            )
            place = at + turn @ anchor
            out["joints"].append(names[i])
            out["parents"].append(link)
            out["slides"].append(slides)
            out["axes"].append(np.array(axis))
            out["rotations"].append(turn if slides else turn @ rotation_about(axis, -zero))
            out["places"].append(place - turn @ axis * zero if slides else place)
            out["inertial"].append(np.zeros(10))
            out["armature"].append(float(model.dof_armature[model.jnt_dofadr[i]]))
            out["effects"].append(_passive(model, i))
            link, turn, at = len(out["joints"]) - 1, np.eye(3), -np.array(anchor)
        link_of.append(link)
        poses.append((turn, at))
        if link >= 0:
            name, inner = model.body(b).name, _matrix(mujoco, model.body_iquat[b])
            numbers = given.get(name)
            if numbers is None:
                inertia = inner @ np.diag(model.body_inertia[b]) @ inner.T
                numbers = body_numbers(float(model.body_mass[b]), model.body_ipos[b], inertia)
            out["inertial"][link] = out["inertial"][link] + moved_numbers(numbers, turn, at)
    return link_of, {**out, "joints": tuple(out["joints"]), "gravity": np.array(model.opt.gravity)}


def _passive(model: Any, i: int) -> tuple[Effect, ...]:
    """Damping, dry friction and spring of a joint as effects; those that are zero are left out."""
    dof = model.jnt_dofadr[i]
    found: list[Effect] = []
    if model.dof_damping[dof] > 0:
        found.append(Viscous(float(model.dof_damping[dof])))
    if model.dof_frictionloss[dof] > 0:
        found.append(Coulomb(float(model.dof_frictionloss[dof])))
    if model.jnt_stiffness[i] > 0:
        found.append(CableSpring(float(model.jnt_stiffness[i]), float(model.qpos_spring[model.jnt_qposadr[i]])))
    return tuple(found)


def _refuse_loops(mujoco: Any, model: Any, names: list[str], wanted: list[str], link_of: list[int]) -> None:
    """Raise if joints that were asked for are coupled to each other."""
    kinds = mujoco.mjtEq
    follows = {
        i: [names[k] for k in (int(model.eq_obj1id[i]), int(model.eq_obj2id[i])) if k >= 0]
        for i in np.flatnonzero(model.eq_type == int(kinds.mjEQ_JOINT)).tolist()
    }
    for i in range(model.neq):
        kind, one, other = int(model.eq_type[i]), int(model.eq_obj1id[i]), int(model.eq_obj2id[i])
        if bound := follows.get(i):
            if set(bound) & set(wanted):
                leader = f"joint {bound[1]!r}" if bound[1:] else "an equation"
                free = [n for n in wanted if not any(n in pair for pair in follows.values())]
                rest = f'name the others alone, --joints "{";".join(free)}"' if free else "the robot has no others"
                raise ValueError(
                    f"Joint {bound[0]!r} follows {leader} (mimic), expected joints that move alone, as neither a "
                    f"joint that follows nor one that leads does; {rest}."
                )
        elif kind in (int(kinds.mjEQ_CONNECT), int(kinds.mjEQ_WELD)):
            if int(model.eq_objtype[i]) == int(mujoco.mjtObj.mjOBJ_SITE):
                one, other = (int(model.site_bodyid[k]) if k >= 0 else 0 for k in (one, other))
            if link_of[one] != link_of[max(other, 0)]:
                raise ValueError(
                    "The robot has a closed loop (connect or weld), expected a tree of joints; give a file without "
                    "the loop, or name the joints outside of it."
                )
