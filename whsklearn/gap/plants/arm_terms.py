"""Effects that an arm may lack: a catalogue effect at a joint or along a sum of two, an inertia, a mass, or gravity.

A name is (effect, joint): ``coulomb at elbow``; along two joints turned by one gear, ``viscous at wrist+hand``.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from whsklearn.effects import ContactStop, Coulomb, Effect, FlexibleCoupling, LoadSideViscous, Quantity, Viscous
from whsklearn.effects.base import ArgumentError
from whsklearn.gap.plant import FittedTerm
from whsklearn.gap.plants.servo_candidates import Candidate, catalogue
from whsklearn.systems.arm import Arm, closed
from whsklearn.systems.arm_files import STANDARD_GRAVITY

NOTHING = np.finfo(float).eps  # Nm or kg m2: no friction, no inertia
# Effects of the catalogue that are not candidates at a joint: an error of an encoder changes the columns of all joints,
# the weight of a joint is that of the links, and a coupling is not told from the links' own flexibility.
ELSEWHERE = ("encoder_eccentricity", "gravity_imbalance", "flexible_coupling")
ALONG_TWO = ("viscous", "coulomb")  # friction that depends on a neighbour's motion


@dataclass(frozen=True)
class Load(Effect):
    """A point mass at a link: its mass, and the position of its centre in the joint's frame.

    Examples
    --------
    >>> Load(2.0, x=0.1).labelled()
    {'mass_kg': 2.0, 'x_m': 0.1, 'y_m': 0.0, 'z_m': 0.0}
    """

    mass: float = 0.0
    x: float = 0.0
    y: float = 0.0
    z: float = 0.0
    name: ClassVar[str] = "payload"
    place: ClassVar[str] = "link"
    equation: ClassVar[str] = "m Y(q, v, a) (1, c, -[c]²)"
    size: ClassVar[str] = "mass"
    quantities: ClassVar[dict[str, Quantity]] = {
        "mass": Quantity("kg", 0.0, 1e3), **{x: Quantity("m", -2.0, 2.0) for x in "xyz"}
    }  # fmt: skip


@dataclass(frozen=True)
class JointInertia(Effect):
    """Inertia of a motor, seen from the joint.

    Examples
    --------
    >>> JointInertia(0.02).labelled()
    {'inertia_kg_m2': 0.02}
    """

    inertia: float = 0.0
    name: ClassVar[str] = "joint_inertia"
    place: ClassVar[str] = "link"
    equation: ClassVar[str] = "J a"
    size: ClassVar[str] = "inertia"
    quantities: ClassVar[dict[str, Quantity]] = {"inertia": Quantity("kg m2", 0.0, 1e3)}


@dataclass(frozen=True)
class Weight(Effect):
    """Gravity of all links, for a model that has none.

    Examples
    --------
    >>> Weight().magnitude, Weight().labelled()
    (9.81, {})
    """

    acceleration: float = -STANDARD_GRAVITY[2]
    name: ClassVar[str] = "gravity"
    place: ClassVar[str] = "link"
    equation: ClassVar[str] = "g(q)"
    size: ClassVar[str] = "acceleration"
    quantities: ClassVar[dict[str, Quantity]] = {"acceleration": Quantity("m/s2", 0.0, 20.0)}

    def labelled(self) -> dict[str, float | str]:
        """Nothing, because the moments of the links are fitted instead."""
        return {}


@dataclass(frozen=True)
class AtJoint:
    """An effect at a joint, along a sum of joints, or of the whole arm.

    >>> from whsklearn.effects import Coulomb
    >>> kind = AtJoint(Coulomb, "elbow", (0.0, 1.0))
    >>> kind.name, kind.index, kind.effect((0.3,))
    ('coulomb at elbow', 1, Coulomb(torque=0.3))
    """

    cls: type[Effect]  # the effect
    joint: str  # name of the joint or of the sum; empty for the whole arm
    direction: tuple[float, ...]  # (n_joints,): coefficients of the sum over the joints
    # the effect as in the search on a single axis, a `Candidate`, whose columns have shapes; None if it is none there
    catalogued: Any = None
    width: int = 1  # number of columns of an effect without a shape
    place: frozenset[str] = frozenset()  # the joints at which it acts; empty if it acts on all
    # whether the model already has it, with a value from another record; the value may have decreased since
    again: bool = False

    @property
    def name(self) -> str:
        """Effect and joint."""
        return f"{self.cls.name} at {self.joint}" if self.joint else self.cls.name

    @property
    def index(self) -> int | None:
        """Index of the joint; None if more than one joint has to supply the torque."""
        at = np.flatnonzero(self.direction)
        return int(at[0]) if at.size == 1 and self.cls is not Load else None

    @property
    def rows(self) -> slice:
        """The rows on which its columns are not zero; rows are ordered by joint, then by instant."""
        return slice(None) if self.index is None or self.splits else slice(self.index, None, len(self.direction))

    @cached_property
    def linear(self) -> int:
        """Number of leading parameters in which it is linear."""
        return self.width if self.catalogued is None else self.catalogued.linear

    @property
    def positive(self) -> bool:
        """Whether its one size must be positive."""
        return self.catalogued.positive if self.catalogued is not None else self.cls in (JointInertia, Load)

    @property
    def grows(self) -> bool:
        """Whether what it adds must be positive: the model does not have it yet."""
        return self.positive and not self.again

    @property
    def transforms(self) -> bool:
        """Whether it transforms the whole drive."""
        return self.catalogued is not None and self.catalogued.transforms

    @property
    def splits(self) -> bool:
        """Whether it frees the link from its motor: a play, whose link the other joints feel too."""
        return self.catalogued is not None and self.catalogued.cls.port == "block"

    @property
    def sizeless(self) -> bool:
        """Whether it has no size but its shape."""
        return self.transforms or self.splits

    @property
    def delays(self) -> bool:
        """Whether it only delays the drive."""
        return self.catalogued is not None and self.catalogued.delays

    @property
    def n_numbers(self) -> int:
        """Free numbers."""
        if self.catalogued is None:
            return 4 if self.cls is Load else self.width
        return len(self.catalogued.fields) - len(self.catalogued.held)

    def effect(self, q: Any) -> Effect:
        """The effect with these numbers."""
        if self.catalogued is not None:
            return self.catalogued.effect(q)
        return Weight() if self.cls is Weight else self.cls(*map(float, q))


@dataclass(frozen=True)
class JointTerm(FittedTerm):
    """An `AtJoint` with its numbers.

    >>> from whsklearn.effects import Coulomb
    >>> term = JointTerm(AtJoint(Coulomb, "elbow", (0.0, 1.0)), (0.3,))
    >>> term.joint, term.effect, term.shape
    ('elbow', Coulomb(torque=0.3), ())
    """

    @property
    def joint(self) -> str:
        """Where it acts."""
        return str(self.kind.joint)

    @property
    def shape(self) -> tuple[float, ...]:
        """The numbers after the linear ones."""
        return self.q[self.kind.linear :]


def present(base: dict[str, tuple[str, ...]], terms: Any) -> dict[str, set[str]]:
    """Names of effects by joint: those of the base model and those of the added terms."""
    out = {joint: set(names) for joint, names in base.items()}
    for t in terms:
        out.setdefault(t.joint, set()).add(t.effect.name)
    return out


def at_a_joint() -> list[Candidate]:
    """What a candidate at a single joint must satisfy.

    Examples
    --------
    >>> names = {c.name for c in at_a_joint()}
    >>> "cogging" in names, "backlash" in names, "encoder_eccentricity" in names
    (True, True, False)
    """
    stops = [Candidate(ContactStop, (("side", side),)) for side in ("upper", "lower")]
    every = (c for c in catalogue() if not (c.on_load or c.name in ELSEWHERE or c.cls.sought))
    return [*every, *stops]


def parts_of(arm: Arm) -> tuple[Arm, tuple[JointTerm, ...]]:
    """The arm with effects that have columns alone, links that move with their motors, and the other effects as terms.

    Delays, limits, dead zones and plays change a drive or the motion by more than the size of a column; of them a model
    keeps the numbers that it has.  A coupling stays, for the columns to refuse.

    Examples
    --------
    >>> from whsklearn.datasets import default_arm
    >>> from whsklearn.effects import InputDelay
    >>> bare, (delay,) = parts_of(default_arm().with_effects({"yaw": [InputDelay(0.004)]}))
    >>> [e.name for e in bare.effects[0]], delay.kind.name, delay.q
    (['viscous', 'coulomb'], 'input_delay at yaw', (0.004,))
    """
    inertia = np.diagonal(arm.mass_matrix(np.zeros((1, arm.n_joints)))[0])
    kinds = [c for c in at_a_joint() if c.linear == 0]
    rows, terms = [], []
    for j, (joint, row) in enumerate(zip(arm.joints, arm.effects, strict=True)):
        rest = []
        for e in row:
            if isinstance(e, FlexibleCoupling):
                raise ArgumentError(
                    f"The model has {e.name} at {joint}, beside which nothing can be looked for yet; remove it."
                )
            kind = next((c for c in kinds if c.cls is type(e) and c.options == e.options), None)
            if kind is None:
                rest.append(e)
                continue
            along = tuple(map(float, np.arange(arm.n_joints) == j))
            term = JointTerm(AtJoint(kind.cls, joint, along, kind, place=frozenset([joint])), e.row)
            if term.kind.splits:  # the load is all that is not the motor
                share = 1.0 - float(arm.armature[j]) / max(float(inertia[j]), NOTHING)
                term = replace(term, q=(e.row[0], share, *e.row[2:]))
                rest += closed([e])
            terms.append(term)
        rows.append(closed(rest))
    return replace(arm, effects=tuple(rows)), tuple(terms)


def candidates(arm: Arm, there: dict[str, set[str]], *, frozen: bool, weight: int) -> Iterator[AtJoint]:
    """All effects that an arm may lack.

    ``there``: effects at each joint.
    ``frozen``: whether the model's numbers are those of another record. They may then have changed, and a mass or an
        inertia may have been added.
    ``weight``: number of columns of gravity if the arm has none, otherwise 0.
    """
    eye = np.eye(arm.n_joints)
    each = [(joint, tuple(map(float, row))) for joint, row in zip(arm.joints, eye, strict=True)]
    for (joint, row), slides in zip(each, arm.slides, strict=True):
        names = there.get(joint, set())
        said = {n for e in catalogue() if e.name in names for n in e.cls.covers}
        for c in at_a_joint():
            more = frozen and c.cls.elementary
            if c.name in said or (slides and c.cls.rotary):
                continue
            if (c.name not in names or c.cls.repeats or more) and (not c.parent or c.parent in names):
                yield AtJoint(c.cls, joint, row, c, place=frozenset([joint]), again=more and c.name in names)
        if frozen and "joint_inertia" not in names:
            yield AtJoint(JointInertia, joint, row, place=frozenset([joint]))
    frictions = [next(c for c in catalogue() if c.name == name) for name in ALONG_TWO]
    for k, parent in enumerate(arm.parents):
        if parent < 0 or arm.slides[k] != arm.slides[parent]:
            continue
        both = frozenset([arm.joints[parent], arm.joints[k]])
        for sign, word in ((1.0, "+"), (-1.0, "-")):
            axis, along = f"{arm.joints[parent]}{word}{arm.joints[k]}", tuple(map(float, eye[parent] + sign * eye[k]))
            for c in frictions:  # beside each joint's own friction, because a joint that moves alone looks like a sum
                own = all(c.name in there.get(j, set()) for j in both)
                if own and c.name not in there.get(axis, set()):
                    yield AtJoint(c.cls, axis, along, c, place=both)
            if "joint_inertia" not in there.get(axis, set()):
                yield AtJoint(JointInertia, axis, along, place=both)
    if frozen and not any("payload" in names for names in there.values()):  # a hand carries one
        for joint, row in each:
            yield AtJoint(Load, joint, row)
    elif weight and "gravity" not in there.get("", set()):
        yield AtJoint(Weight, "", tuple(np.ones(arm.n_joints)), width=weight)


def parted(arm: Arm, play: JointTerm, motor: float) -> Arm:
    """The arm with a play between a motor of this inertia and its link; the joint has the same inertia and friction."""
    j, effect = arm.index(play.joint), play.effect
    dry = sum(e.magnitude for e in arm.effects[j] if type(e) is Coulomb)
    share = min(effect.shape["load_coulomb"] / max(dry, NOTHING), 1.0)  # of the friction that is behind the play
    row = [e.resized((1.0 - share) * e.magnitude) if type(e) in (Coulomb, Viscous) else e for e in arm.effects[j]]
    behind = share * sum(e.magnitude for e in arm.effects[j] if type(e) is Viscous)
    row += [effect, LoadSideViscous(behind)] if behind else [effect]
    rest, armature = float(arm.armature[j]) - motor, arm.armature.copy()
    armature[j] = motor
    about = np.outer(arm.axes[j], arm.axes[j])
    arm = arm.with_body(play.joint, rest) if arm.slides[j] else arm.with_body(play.joint, 0.0, inertia=rest * about)
    return replace(arm, armature=armature, effects=(*arm.effects[:j], row, *arm.effects[j + 1 :]))


def completed(arm: Arm, terms: Iterable[JointTerm], motors: Mapping[str, float] | None = None) -> Arm:
    """The arm with all terms but gravity, which are other numbers of its links.

    ``motors``: inertia of the motor before each play, by joint.
    """
    for t in sorted(terms, key=lambda t: t.kind.splits):  # plays last, which divide a joint's friction
        if t.kind.splits:
            assert motors is not None
            arm = parted(arm, t, motors[t.joint])
        elif t.kind.cls is Load:
            arm = arm.with_body(t.joint, t.q[0], t.shape)
        elif t.kind.cls is JointInertia and t.kind.index is None:
            turned = arm.sum_armature
            arm = replace(arm, sum_armature=turned | {t.joint: turned.get(t.joint, 0.0) + t.q[0]})
        elif t.kind.cls is JointInertia:
            arm = replace(arm, armature=arm.armature + t.q[0] * np.array(t.kind.direction))
        elif t.kind.cls is not Weight:
            arm = arm.with_effects({t.joint: t.effect})
    return arm
