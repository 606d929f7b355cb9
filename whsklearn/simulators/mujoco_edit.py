"""Effects as MuJoCo expresses them: attributes of a joint and its actuator, and passive elements.

=====================  ==============================================================
effect                 in the MJCF
=====================  ==============================================================
viscous                ``damping`` a
quadratic_drag         ``damping`` b, v |v|
coulomb                ``frictionloss``
cable_spring           ``stiffness`` and ``springref``, or a fixed tendon beside them
hardening_spring       a fixed tendon with a cubic ``stiffness``
end_stop               the joint's ``range`` and ``solreflimit`` (`ContactStop`), or a fixed tendon that pulls
                       outside ``springlength`` (`EndStop`, or where the joint has a range already)
cogging, gravity       ``dcmotor`` without input: ``cogging`` of k or 1 waves a turn
presliding, Stribeck   ``dcmotor`` without input: ``lugre`` (Dahl's and LuGre's bristles)
input_offset           an actuator with a constant bias
input_delay            ``delay`` and ``nsample`` of the actuator
actuator_lag           ``dyntype="filterexact"`` of the actuator
saturation             ``ctrlrange`` of the actuator
=====================  ==============================================================
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from whsklearn.effects import ContactStop, Coulomb, Effect, EndStop
from whsklearn.export.robots import FAR, Mjcf, hold_in

PASSIVE = 16  # mjINPUT_NONE: an actuator without a control


class Axis(NamedTuple):
    """Names of a joint and of its actuator."""

    joint: str
    actuator: str


SOFT = [0.02, 1.0]  # MuJoCo's own solreffriction
HELD = (
    "viscous quadratic_drag coulomb cable_spring hardening_spring end_stop cogging gravity_imbalance "
    "presliding_hysteresis stribeck input_offset asymmetric_coulomb input_delay actuator_lag saturation"
).split()


def hold(spec: Any, axis: Axis, effects: tuple[Effect, ...], inertia: float = 1.0) -> Any:
    """A copy of the spec with the effects in it; ``inertia`` about the joint is what a limit's solver divides by.

    Raises NotImplementedError if MuJoCo has nothing like one of them. Raises ValueError if a number of an effect cannot
    be held.
    """
    out = spec.copy()
    j = out.joint(axis.joint)
    dry = [Coulomb(float(j.frictionloss))] if float(j.frictionloss) > 0 else []
    m = Mjcf()
    for e in effects:
        if e.name not in HELD:
            raise NotImplementedError(f"MuJoCo has nothing like {e.name}")
        if e.name == "presliding_hysteresis" and e.magnitude <= 0.0:
            raise ValueError(f"a bristle cannot hold {e.magnitude:.3g}")
        hold_in(m, e, [*dry, *effects])
    if any(e.name == "stribeck" for e in effects) and m.lugre:
        j.frictionloss = 0.0  # LuGre's own Coulomb level stands in for it
    if any(x.name in ("stribeck", "cogging") for x in m.losses):
        raise ValueError("; ".join(map(str, m.losses)))
    _joint(j, m)
    _actuator(out, axis, effects)
    limit = next((e for e in effects if isinstance(e, ContactStop)), None)
    if limit is not None and not _limited(j):
        _limit(j, limit, inertia)
        effects = tuple(e for e in effects if e is not limit)
    _beside(out, axis, m, effects)
    return out


def _limited(j: Any) -> bool:
    """Whether the joint has a range of its own."""
    return float(j.range[1]) > float(j.range[0])


def _limit(j: Any, e: ContactStop, inertia: float) -> None:
    """A stop as the joint's limit: within it MuJoCo's push is J (B v + K d) with solref = (-K, -B), but for ``solimp``.

    Raises ValueError if the contact would pull, or give energy.
    """
    if e.stiffness <= 0.0 or e.relaxation < 0.0:
        raise ValueError(f"a contact of {e.stiffness:.3g} with a relaxation of {e.relaxation:.3g} s cannot be held")
    stiffness = e.stiffness * float(j.solimp_limit[1]) / inertia
    j.range, j.limited = np.clip(e.ends, -FAR, FAR), 1
    j.solref_limit = [-stiffness, -stiffness * e.relaxation] + [0.0] * (len(j.solref_limit) - 2)


def _joint(j: Any, m: Mjcf) -> None:
    """Damping and dry friction, which turns as abruptly as the solver can unless the joint says how softly it does."""
    if m.damping:
        damping = np.array(j.damping, dtype=float)
        damping[0] += m.damping.get(1, 0.0)
        damping[1] += m.damping.get(2, 0.0)
        j.damping = damping
    if "frictionloss" in m.joint:
        j.frictionloss = float(j.frictionloss) + m.joint["frictionloss"]
        if list(j.solref_friction)[:2] == SOFT:
            j.solref_friction = [2e-3, 1.0] + [0.0] * (len(j.solref_friction) - 2)


def _actuator(spec: Any, axis: Axis, effects: tuple[Effect, ...]) -> None:
    """Delay, lag and limit of the control."""
    import mujoco

    a = spec.actuator(axis.actuator)
    for e in effects:
        if e.name == "input_delay":
            if e.magnitude < 0.0:
                raise ValueError(f"a delay of {e.magnitude:.3g} s cannot be held")
            a.delay = float(a.delay) + e.magnitude
            a.nsample = math.ceil(float(a.delay) / spec.option.timestep) + 1
            a.interp = 1  # linear: held, a delay would have no derivative within a step
        elif e.name == "actuator_lag":
            if a.dyntype != mujoco.mjtDyn.mjDYN_NONE or e.magnitude <= 0.0:
                raise ValueError("the actuator has dynamics of its own, or the lag is not above zero")
            a.dyntype = mujoco.mjtDyn.mjDYN_FILTEREXACT
            a.dynprm = [e.magnitude, *list(a.dynprm)[1:]]
        elif e.name == "saturation":
            a.ctrlrange, a.ctrllimited = [-e.magnitude, e.magnitude], True


def _beside(spec: Any, axis: Axis, m: Mjcf, effects: tuple[Effect, ...]) -> None:
    """Tendons and passive actuators."""
    for k, e in enumerate(x for x in effects if x.name in ("cable_spring", "hardening_spring", "end_stop")):
        t = spec.add_tendon(name=f"{e.name}_{axis.joint}_{k}")
        t.wrap_joint(axis.joint, 1.0)
        if isinstance(e, EndStop):
            t.stiffness = [e.magnitude, 0.0, 0.0]
            t.springlength = np.clip(e.ends, -FAR, FAR).tolist()
        else:
            t.stiffness = [e.magnitude, 0.0, 0.0] if e.name == "cable_spring" else [0.0, 0.0, e.magnitude]
            t.springlength = [e.shape["centre"], e.shape["centre"]]
    offset = -sum(e.magnitude for e in effects if e.name in ("input_offset", "asymmetric_coulomb"))
    if offset:
        a = _added(spec, axis, "constant")
        a.gainprm = [0.0, *list(a.gainprm)[1:]]
        _affine(a, offset)
    waves = list(m.cogging)
    if m.gravity[0]:
        waves.append((m.gravity[0], 1.0, m.gravity[1] - 0.5 * math.pi))
    for k, wave in enumerate(waves):
        _added(spec, axis, f"wave_{k}").set_to_dcmotor([0.0, 0.0], 1.0, cogging=list(wave), ctrlspec=PASSIVE)
    for k, numbers in enumerate(m.lugre):
        _added(spec, axis, f"lugre_{k}").set_to_dcmotor([0.0, 0.0], 1.0, lugre=list(numbers), ctrlspec=PASSIVE)


def _added(spec: Any, axis: Axis, name: str) -> Any:
    """A further actuator on the joint."""
    import mujoco

    return spec.add_actuator(name=f"{name}_{axis.joint}", target=axis.joint, trntype=mujoco.mjtTrn.mjTRN_JOINT)


def _affine(a: Any, bias: float) -> None:
    import mujoco

    a.biastype = mujoco.mjtBias.mjBIAS_AFFINE
    a.biasprm = [bias, *list(a.biasprm)[1:]]
