"""Coupled joints as one rigid-body model: an arm, a gimbal or a turntable with several axes.

torque = Y(q, v, a) numbers + armature a + effects of each joint; q, v, a are rad and s (m for a joint that slides), the
ten numbers of a link are those of `whsklearn.systems.arm_files.body_numbers`, in the frame of its joint.
"""

from __future__ import annotations

import dataclasses
import math
import os
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike
from sklearn.utils import Bunch

from whsklearn.effects import (
    Backlash,
    Coulomb,
    Effect,
    FlexibleCoupling,
    LoadSideViscous,
    Viscous,
    effect_names,
    get_effect,
)
from whsklearn.effects.base import Array
from whsklearn.systems._arm_kernels import (
    DRIVE,
    LINK,
    LINK_VELOCITY,
    MEASURED,
    N_BODY,
    N_SIGNALS,
    POSITION,
    VELOCITY,
    Axes,
    Links,
    PassInput,
    fill_mass,
    fill_regressor,
    fill_torque,
    run,
)
from whsklearn.systems._servo_kernel import INERTIA, KAPPA, LIMIT, N_PARTS, RESOLUTION, plant_of
from whsklearn.systems.arm_files import STANDARD_GRAVITY, across, body_numbers, dh_fields, file_fields
from whsklearn.systems.base_parameters import BaseParameters, base_parameters, consistent_numbers
from whsklearn.systems.servo_parts import PIDController

NUMBERS = ("m", "mx", "my", "mz", "Ixx", "Ixy", "Iyy", "Ixz", "Iyz", "Izz")

BETWEEN = Backlash, FlexibleCoupling  # a motor, whose inertia is the armature, and its link
SMOOTHING = 1e-3  # rad/s (m/s) over which sign(v) changes: a joint held by friction creeps at less than this


@dataclass(frozen=True, eq=False)
class Arm:
    """A tree of n joints, each with a link; `from_file` reads it from a file, `from_dh` makes it from DH rows.

    Parameters
    ----------
    joints : sequence of str
        Names of the joints, each after the joint that carries it.
    parents : array-like of shape (n,)
        Index of the joint that carries each one; -1 for the base.
    slides : array-like of shape (n,)
        Whether each joint is prismatic.
    rotations, places : array-like of shape (n, 3, 3) and (n, 3)
        Frame of each joint at zero, in the frame of the joint that carries it (m).
    axes : array-like of shape (n, 3)
        Unit vectors in the joint's own frame.
    inertial : array-like of shape (n, 10), optional
        Mass, first moments and inertia about the joint's frame: m, mx, my, mz, Ixx, Ixy, Iyy, Ixz, Iyz, Izz (kg, m).
    gravity : array-like of shape (3,), default=(0, 0, -9.81)
        Gravity in the base's frame (m/s2).
    armature : array-like of shape (n,), optional
        Inertia of the motors, referred to the joint's side (kg m2).
    effects : mapping of str to effects, or a sequence of n of them, optional
        Friction and other effects of the joints, from the catalogue.  A mapping may also name a signed sum of joints
        that one gear turns, such as ``"wrist+hand"``.  `Backlash` and `FlexibleCoupling` lie between a motor, whose
        inertia is the ``armature``, and its link; the encoder and the friction of the joint are at the motor.
    sums : mapping of str to effects, optional
        The effects along sums of joints; those in ``effects`` are added.
    sum_armature : mapping of str to float, optional
        Inertia of the motors that turn sums of joints (kg m2).

    Attributes
    ----------
    n_joints : int
    number_names : tuple of str
        Names of the 10 n link parameters, such as ``elbow.mx``.

    Notes
    -----
    The parameters of one link cannot be identified alone; only combinations of them affect the drives (`base`).

    References
    ----------
    Atkeson, An and Hollerbach 1986, Estimation of inertial parameters of manipulator loads and links, Int. J. Robotics
    Research 5(3), 101-119; Siciliano, Sciavicco, Villani and Oriolo 2009, Robotics, Springer, ch. 7.

    Examples
    --------
    >>> import numpy as np
    >>> from whsklearn import Arm
    >>> rod = np.array([1.0, 0, 0, -0.5, 1 / 3, 0, 1 / 3, 0, 0, 0])  # 1 kg, 1 m, hanging from a horizontal axis
    >>> pendulum = Arm(["hinge"], [-1], [False], [np.eye(3)], [[0, 0, 0]], [[0, 1, 0]], inertial=[rod])
    >>> pendulum.inverse_dynamics([[np.pi / 2]], [[0.0]], [[0.0]]).round(3)  # held level: m g l
    array([[4.905]])
    >>> pendulum.base().names
    ('hinge.mx', 'hinge.mz', 'hinge.Iyy')
    """

    joints: Sequence[str]
    parents: Any
    slides: Any
    rotations: Any
    places: Any
    axes: Any
    inertial: Any = None
    gravity: Any = STANDARD_GRAVITY
    armature: Any = None
    effects: Any = ()
    sums: Any = ()
    sum_armature: Any = ()
    _links: Links = field(init=False, repr=False)

    def __post_init__(self) -> None:
        joints = tuple(str(j) for j in self.joints)
        n = len(joints)
        if not n or len(set(joints)) < n:
            raise ValueError(f"joints is {joints}, expected at least one name and no name twice.")
        shapes = {
            "slides": (n,), "rotations": (n, 3, 3), "places": (n, 3), "axes": (n, 3), "inertial": (n, N_BODY),
            "gravity": (3,), "armature": (n,),
        }  # fmt: skip
        object.__setattr__(self, "joints", joints)
        object.__setattr__(self, "parents", np.asarray(self.parents, dtype=np.int64))
        for name, shape in shapes.items():
            given = getattr(self, name)
            value = np.array(np.zeros(shape) if given is None else given, dtype=bool if name == "slides" else float)
            if value.shape != shape or not np.isfinite(value).all():
                raise ValueError(f"{name} has shape {value.shape}, expected {shape} finite numbers for {n} joints.")
            object.__setattr__(self, name, value)
        if self.parents.shape != (n,) or (self.parents >= np.arange(n)).any() or (self.parents < -1).any():
            raise ValueError("parents names a joint that comes later, expected an earlier one or -1; sort the joints.")
        rows, beside = self._by_axis(self.effects)
        motors = {str(name): float(x) for name, x in dict(self.sum_armature).items()}
        sums: dict[str, tuple[Effect, ...]] = dict.fromkeys(motors, ())
        sums |= {name: self._checked(e) for name, e in dict(self.sums).items()}
        sums |= {name: (*sums.get(name, ()), *acting) for name, acting in beside.items()}
        for name in sums:
            direction_of(joints, name)
        motor = dict(zip(joints, self.armature.tolist(), strict=True))
        for name, row in {**dict(zip(joints, rows, strict=True)), **sums}.items():
            between = [e.name for e in row if isinstance(e, BETWEEN)]
            if between and not motor.get(name, 0.0) > 0.0:
                raise ValueError(
                    f"{between[0]} lies between a motor and its link, and {name!r} has no motor of its own: expected a "
                    "joint with an armature above zero."
                )
        object.__setattr__(self, "effects", rows)
        object.__setattr__(self, "sums", sums)
        object.__setattr__(self, "sum_armature", motors)
        object.__setattr__(self, "_links", self._packed())

    @classmethod
    def from_file(
        cls, path: str | os.PathLike[str], joints: Iterable[str] | None = None, gravity: ArrayLike | None = None
    ) -> Self:
        """Read an arm from a URDF or MJCF file with MuJoCo; for a model file see `whsklearn.models.as_arm`.

        Parameters
        ----------
        path : str or path
            The file, or the text of a URDF or MJCF file.  The meshes of a URDF need not exist.
        joints : iterable of str, optional
            The joints that move; all by default.  The others are locked at zero, and what they carry is lumped with
            the link before them.
        gravity : array-like of shape (3,), optional
            Gravity (m/s2); by default that of the file.

        Raises
        ------
        ImportError
            If MuJoCo is not installed.
        ValueError
            If the file cannot be read, if a joint does not exist, follows another one or is neither a hinge nor a
            slide, or if the links form a closed loop.
        """
        arm = cls(**file_fields(path, joints))
        return arm if gravity is None else dataclasses.replace(arm, gravity=gravity)

    @classmethod
    def from_dh(cls, rows: Iterable[Sequence[Any]], *, modified: bool = False, **fields: Any) -> Self:
        """Make an arm from Denavit-Hartenberg rows.

        Parameters
        ----------
        rows : iterable of (a, alpha, d, theta) or (a, alpha, d, theta, "prismatic")
            In m and rad; theta (or d, if the joint slides) is the value at q = 0.
        modified : bool, default=False
            Whether to use Craig's convention instead of the standard one.
        **fields
            Other fields of `Arm`, such as ``joints``, ``inertial`` (n, 10) and ``gravity``.  The parameters of a link
            are given in the frame that turns with its joint about z.  In the standard convention this frame comes
            before the constant part of the row.

        Examples
        --------
        >>> from whsklearn import Arm
        >>> Arm.from_dh([(0.3, 0, 0, 0), (0.2, 0, 0, 0)], gravity=(0, -9.81, 0)).places.tolist()
        [[0.0, 0.0, 0.0], [0.3, 0.0, 0.0]]
        """
        return cls(**{**dh_fields(rows, modified=modified), **fields})

    def __repr__(self) -> str:
        return f"Arm({self.n_joints} joints: {', '.join(self.joints)})"

    # -- what it is ---------------------------------------------------------------------

    @property
    def n_joints(self) -> int:
        """How many joints move."""
        return len(self.joints)

    @property
    def number_names(self) -> tuple[str, ...]:
        """Names of the 10 n link parameters, in the order of the regressor's columns."""
        return tuple(f"{joint}.{number}" for joint in self.joints for number in NUMBERS)

    def unit_of(self, name: str) -> str:
        """SI unit of a number such as ``elbow.mx``, ``lift.armature`` or ``elbow.viscous``; empty for an unknown one.

        Parameters
        ----------
        name : str
            Joint and number, as in `parameters_` of a fitted arm.

        Examples
        --------
        >>> arm = Arm.from_dh([(0.3, 0, 0, 0)])
        >>> [arm.unit_of(f"joint1.{number}") for number in ("mx", "Izz", "armature", "viscous", "coulomb")]
        ['kg m', 'kg m²', 'kg m²', 'Nm s/rad', 'Nm']
        """
        axis, _, number = name.rpartition(".")
        axes = re.split(r"[+-]", axis)
        slides = any(s and joint in axes for joint, s in zip(self.joints, self.slides, strict=True))
        if number in (*NUMBERS, "armature"):
            heavy = number == "m" or (number == "armature" and slides)
            return "kg" if heavy else "kg m" if number in NUMBERS[1:4] else "kg m²"
        effect = re.sub(r"(_cos|_sin)?\d*$", "", number)
        if effect not in effect_names():
            return ""
        cls = get_effect(effect)
        unit = cls.quantities[cls.size].unit
        return unit.replace("Nm", "N").replace("rad", "m") if slides else unit

    def index(self, joint: str) -> int:
        """Index of a joint by its name.

        Parameters
        ----------
        joint : str

        Raises
        ------
        ValueError
            If the arm has no such joint.
        """
        if joint not in self.joints:
            raise ValueError(f"The arm has no joint {joint!r}; it has {', '.join(self.joints)}.")
        return self.joints.index(joint)

    def with_effects(self, effects: Mapping[str, Any]) -> Self:
        """Return the same arm with more effects at some joints, or along sums of them.

        Parameters
        ----------
        effects : mapping of str to effects
            The effects, by name of joint or of a sum such as ``"wrist+hand"``.
        """
        more, beside = self._by_axis(effects)
        sums = {k: (*self.sums.get(k, ()), *beside.get(k, ())) for k in {**self.sums, **beside}}
        rows = tuple(a + b for a, b in zip(self.effects, more, strict=True))
        return dataclasses.replace(self, effects=rows, sums=sums)

    def with_body(
        self, joint: str, mass: float, centre: ArrayLike = (0, 0, 0), inertia: ArrayLike | None = None
    ) -> Self:
        """Return the same arm with a body, such as a payload, fixed to a link.

        Parameters
        ----------
        joint : str
            The joint that carries it.
        mass : float
            Mass (kg).
        centre : array-like of shape (3,)
            Centre of mass, in the joint's frame (m).
        inertia : array-like of shape (3, 3), optional
            Inertia about that centre (kg m2).
        """
        numbers = self.inertial.copy()
        numbers[self.index(joint)] += body_numbers(mass, centre, np.zeros((3, 3)) if inertia is None else inertia)
        return dataclasses.replace(self, inertial=numbers)

    # -- dynamics -----------------------------------------------------------------------

    def regressor(self, q: ArrayLike, v: ArrayLike, a: ArrayLike) -> Array:
        """The regressor Y in torque = Y numbers, for every sample.

        Parameters
        ----------
        q, v, a : array-like of shape (n_samples, n_joints)
            Position, velocity, acceleration.

        Returns
        -------
        ndarray of shape (n_samples, n_joints, 10 n_joints)
        """
        q, v, a = self._motion(q, v, a)
        out = np.zeros((*q.shape, N_BODY * self.n_joints))
        fill_regressor(out, self._links, q, v, a)
        return out

    def inverse_dynamics(self, q: ArrayLike, v: ArrayLike, a: ArrayLike, *, effects: bool = True) -> Array:
        """Drives required for a motion, shape (n_samples, n_joints), in Nm (N if a joint slides).

        Parameters
        ----------
        q, v, a : array-like of shape (n_samples, n_joints)
        effects : bool, default=True
            Whether to include friction and the other effects of the joints.  Effects of the drive are never included,
            and a link moves with its motor.
        """
        q, v, a = self._motion(q, v, a)
        out = np.zeros(q.shape)
        fill_torque(out, self._links, self.inertial, q, v, a)
        out += self.armature * a
        for name, d in self._directions().items():
            out += self.sum_armature.get(name, 0.0) * (a @ d)[:, None] * d
        if effects:
            for d, acting in zip(self._every_direction(), (*self.effects, *self.sums.values()), strict=True):
                signals = Bunch(position=q @ d, velocity=v @ d, acceleration=a @ d)
                for e in (e for e in closed(acting) if e.port == "torque"):
                    out += np.outer(e.along(e.row, signals), d)
        return out

    def mass_matrix(self, q: ArrayLike) -> Array:
        """M(q) with the motors' inertia, shape (n_samples, n_joints, n_joints).

        Parameters
        ----------
        q : array-like of shape (n_samples, n_joints)
        """
        q = self._motion(q)[0]
        out = np.zeros((*q.shape, self.n_joints))
        fill_mass(out, self._links, self.inertial, q)
        motors = sum(self.sum_armature.get(name, 0.0) * np.outer(d, d) for name, d in self._directions().items())
        return np.asarray(out + np.diag(self.armature) + motors)

    def forward_dynamics(self, q: ArrayLike, v: ArrayLike, torque: ArrayLike) -> Array:
        """Accelerations under the drives, shape (n_samples, n_joints); the sign(v) of friction is not smoothed.

        Parameters
        ----------
        q, v, torque : array-like of shape (n_samples, n_joints)
        """
        q, v, torque = self._motion(q, v, torque)
        left = torque - self.inverse_dynamics(q, v, np.zeros(q.shape))
        return np.asarray(np.linalg.solve(self.mass_matrix(q), left[:, :, None])[:, :, 0], dtype=float)

    def simulate(
        self,
        reference: ArrayLike,
        *,
        controller: PIDController | Mapping[str, PIDController] | None = None,
        feed_forward: Arm | None = None,
        sample_rate: float = 1000.0,
        substeps: int = 10,
        noise: float = 0.0,
        resolution: float = 0.0,
        random_state: Any = 0,
    ) -> Bunch:
        """Simulate the closed loop along references.

        Parameters
        ----------
        reference : array-like of shape (n_samples, n_joints)
            Commanded positions.
        controller : PIDController or mapping of these, optional
            One for all joints, or one for each. By default, PID gains follow from each joint's inertia (12 Hz).
        feed_forward : Arm, optional
            A model whose inverse dynamics along the reference are added to the output of the controllers.
        sample_rate : float, default=1000.0
            Of controllers and log (Hz).
        substeps : int, default=10
            Fine steps per sample.
        noise, resolution : float
            Standard deviation of the noise, and step, of the encoders (rad).
        random_state : int, Generator or None
            Draws the noise.

        Returns
        -------
        Bunch
            ``time`` (n_samples,); ``reference``, ``drive``, ``position`` (as measured), ``true_position``,
            ``velocity``, (n_samples, n_joints) each; ``link_position`` and ``link_velocity``, which differ from them
            where a joint has a play or a spring.

        Raises
        ------
        FloatingPointError
            If the simulation does not stay finite.
        """
        asked = self._motion(reference)[0]
        rate = np.gradient(asked, 1.0 / sample_rate, axis=0)
        path = asked, rate, np.gradient(rate, 1.0 / sample_rate, axis=0)
        feed = np.zeros(asked.shape) if feed_forward is None else feed_forward.inverse_dynamics(*path)
        course = PassInput(
            1.0 / sample_rate, int(substeps), True, 0, _rows(asked, np.zeros(asked.shape)), _rows(*path),
            np.ascontiguousarray(feed.T), _noise(noise, asked.shape, random_state), _controllers(self, controller),
        )  # fmt: skip
        return _recorded(self, course, asked, resolution, sample_rate)

    def simulate_drive(
        self,
        drive: ArrayLike,
        *,
        position: ArrayLike | None = None,
        velocity: ArrayLike | None = None,
        link_position: ArrayLike | None = None,
        link_velocity: ArrayLike | None = None,
        resync: float = 0.0,
        sample_rate: float = 1000.0,
        substeps: int = 10,
        noise: float = 0.0,
        resolution: float = 0.0,
        random_state: Any = 0,
    ) -> Bunch:
        """Replay logged drives in open loop, held between samples.

        Parameters
        ----------
        drive : array-like of shape (n_samples, n_joints)
            In Nm.
        position, velocity : array-like of shape (n_samples, n_joints), optional
            Measured motion, where the replay starts; rest at zero by default.
        link_position, link_velocity : array-like of shape (n_samples, n_joints), optional
            Motion of the links, if known, where they have a play; by default they start with the measured motion and
            keep their place behind it.
        resync : float, default=0.0
            Time between returns to the measured motion (s); 0 for none.
        sample_rate, substeps, noise, resolution, random_state
            As for `simulate`, and so is what it returns and raises.
        """
        given = self._motion(drive)[0]
        zeros = np.zeros(given.shape)
        known = position, velocity, *(() if link_position is None else (link_position, link_velocity))
        start = (np.broadcast_to(zeros if s is None else self._motion(s)[0], given.shape) for s in known)
        course = PassInput(
            1.0 / sample_rate, int(substeps), False, round(resync * sample_rate), _rows(*start),
            _rows(zeros, zeros, zeros), np.ascontiguousarray(zeros.T), _noise(noise, given.shape, random_state),
            np.zeros((self.n_joints, 8)),
        )  # fmt: skip
        return _recorded(self, course, given, resolution, sample_rate)

    # -- numbers ------------------------------------------------------------------------

    def base(self) -> BaseParameters:
        """Base parameters of the links: which parameters remain, and what is merged into them."""
        q, v, a = self.drawn_motion(4 * N_BODY * self.n_joints)
        columns = self.regressor(q, v, a).reshape(-1, N_BODY * self.n_joints)
        return base_parameters(columns, self.number_names, [N_BODY] * self.n_joints)

    def drawn_motion(self, n_samples: int, random_state: Any = 0) -> tuple[Array, Array, Array]:
        """Random q, v, a, (n_samples, n_joints) each: a motion that excites all identifiable parameters.

        Parameters
        ----------
        n_samples : int
        random_state : int, Generator or None
        """
        rng = np.random.default_rng(random_state)
        shape = (n_samples, self.n_joints)
        return rng.uniform(-math.pi, math.pi, shape), rng.normal(size=shape), rng.normal(size=shape)

    def consistent(
        self,
        base: BaseParameters,
        values: ArrayLike,
        covariance: ArrayLike | None = None,
        motors: Mapping[str, float] | None = None,
    ) -> Self:
        """The arm with these base parameters and physically consistent links (positive masses, realisable inertias).

        Parameters
        ----------
        base : BaseParameters
            Its columns begin with the links' numbers; after them may come ``armature`` of joints.
        values : array-like of shape (b,)
            Values of the base parameters.
        covariance : array-like of shape (b, b), optional
            Covariance that weighs them.
        motors : mapping of str to float, optional
            Inertia of motors, by joint, that is known and kept (kg m2).

        Notes
        -----
        Among all parameter sets that agree with the values, the one nearest to the present set (that of the file) is
        used.  The inertia of a motor that the file does not give is sought near its measured value or, where only its
        sum with that of links is measured, near what exceeds the file's links.  If the record does not determine it, it
        is sought near the inertia of the joint that it turns, because gears are usually chosen that way (inertia
        matching).

        References
        ----------
        Rucker and Wensing 2022, Smooth parameterization of rigid-body inertia, IEEE Robotics and Automation Letters
        7(2), 2771-2778; Pasch and Seering 1984, On the drive systems for high-performance machines, J. Mechanisms,
        Transmissions, and Automation in Design 106(1), 102-108, on inertia matching.
        """
        value = np.asarray(values, dtype=float)
        variance = np.zeros(value.size) if covariance is None else np.diag(np.asarray(covariance))
        # different from zero at 95 %: in a record without suitable motion the inertia of a motor may take any value
        told = {n: v for n, v, s in zip(base.names, value, variance, strict=False) if v > 1.96 * max(s, 0.0) ** 0.5}
        joint = np.diagonal(dataclasses.replace(self, armature=None).mass_matrix(np.zeros((1, self.n_joints)))[0])
        motor = np.array([told.get(f"{j}.armature", 0.0) for j in self.joints])
        of_motors = base.mapping[:, self.inertial.size :][:, : self.n_joints]
        if of_motors.size and self.inertial[:, 0].any():
            beyond = of_motors.T @ (value - base.mapping[:, : self.inertial.size] @ self.inertial.ravel())
            joint = np.where([f"{j}.armature" in base.names for j in self.joints], joint, np.maximum(beyond, 0.0))
        given = dict(motors or {})
        turned = np.where(self.armature > 0.0, self.armature, np.where(motor > 0.0, motor, joint))
        known = np.isin(self.joints, list(given))
        turned = np.array([given.get(j, x) for j, x in zip(self.joints, turned.tolist(), strict=True)])
        inertial, armature = consistent_numbers(self.inertial, turned, base, values, covariance, known)
        return dataclasses.replace(self, inertial=inertial, armature=self.armature if armature is None else armature)

    # -- inside -------------------------------------------------------------------------

    def _directions(self) -> dict[str, Array]:
        """Every sum of joints as a vector over the joints."""
        return {name: direction_of(self.joints, name) for name in self.sums}

    def _every_direction(self) -> Array:
        """The joints and then the sums as vectors over the joints, (m, n)."""
        return np.vstack([np.eye(self.n_joints), *self._directions().values()])

    def _by_axis(self, effects: Any) -> tuple[tuple[tuple[Effect, ...], ...], dict[str, tuple[Effect, ...]]]:
        """Effects of every joint, and those of sums of joints by name."""
        beside: dict[str, Any] = {}
        if isinstance(effects, Mapping):
            beside = {name: e for name, e in effects.items() if name not in self.joints}
            for name in beside:
                direction_of(self.joints, name)
            effects = [effects.get(j, ()) for j in self.joints]
        rows = [self._checked(e) for e in effects] or [()] * len(self.joints)
        if len(rows) != len(self.joints):
            raise ValueError(f"effects has {len(rows)} entries, expected {len(self.joints)}, one per joint.")
        return tuple(rows), {name: self._checked(e) for name, e in beside.items()}

    @staticmethod
    def _checked(effects: Any) -> tuple[Effect, ...]:
        """Effects that a joint can have."""
        row = (effects,) if isinstance(effects, Effect) else tuple(effects)
        for e in row:
            if not isinstance(e, Effect):
                raise ValueError(f"{e!r} is not an effect; expected instances such as Coulomb(0.3).")
            if e.port == "block" and not isinstance(e, BETWEEN):
                raise ValueError(f"{e.name} acts in a chain of blocks and not at a joint of an arm; remove it.")
        return row

    def _packed(self) -> Links:
        """Geometry as the kernels take it: R0 (1 + sin(q) K + (1 - cos(q)) K K)."""
        turn = np.zeros((self.n_joints, 3, 3, 3))
        for k, (r, e) in enumerate(zip(self.rotations, self.axes, strict=True)):
            length = float(np.linalg.norm(e))
            if abs(length - 1.0) > 1e-6 or not np.allclose(r @ r.T, np.eye(3), atol=1e-6):
                raise ValueError(f"Axis or rotation of {self.joints[k]!r} is not of unit length; normalise it.")
            c = across(e)
            turn[k] = (r, np.zeros((3, 3)), np.zeros((3, 3))) if self.slides[k] else (r + r @ c @ c, r @ c, -r @ c @ c)
        travel = np.einsum("kij,kj->ki", self.rotations, self.axes) * self.slides[:, None]
        return Links(self.parents, self.slides, turn, self.places, travel, self.axes, self.gravity)

    def _motion(self, *signals: ArrayLike) -> list[Array]:
        """Signals as finite contiguous arrays of the same shape (n_samples, n_joints)."""
        arrays = [np.ascontiguousarray(np.asarray(s, dtype=float)) for s in signals]
        for x in arrays:
            if x.ndim != 2 or x.shape[1] != self.n_joints or len(x) != len(arrays[0]):
                raise ValueError(
                    f"A signal has shape {x.shape}, expected ({len(arrays[0]) if arrays[0].ndim else 'n'}, "
                    f"{self.n_joints}): one row per sample, one column per joint."
                )
            if not np.isfinite(x).all():
                raise ValueError("A signal holds NaN or infinity, expected finite numbers; clean the log.")
        return arrays


def _recorded(arm: Arm, course: PassInput, given: Array, resolution: float, sample_rate: float) -> Bunch:
    """One pass along references or drives, (n_samples, n_joints), with its rows by name."""
    n_samples, n = given.shape
    out = np.zeros((N_SIGNALS, n, n_samples))
    if not course.closed:
        out[DRIVE] = given.T
    start = np.vstack([course.measured[-2:, :, 0], course.measured[:2, :, 0]])  # links, then motors
    run(out, arm._links, arm.inertial, _axes(arm, resolution), course, start)
    time = np.arange(n_samples) / sample_rate
    bad = ~np.isfinite(out).all(axis=(0, 1))
    if bad.any():
        raise FloatingPointError(
            f"The simulation is no longer finite after {time[np.argmax(bad)]:.3g} s; use more substeps than "
            f"{course.substeps}, lower gains or other numbers."
        )
    return Bunch(
        time=time, reference=given if course.closed else np.full(given.shape, np.nan), drive=out[DRIVE].T.copy(),
        position=out[MEASURED].T.copy(), true_position=out[POSITION].T.copy(), velocity=out[VELOCITY].T.copy(),
        link_position=out[LINK].T.copy(), link_velocity=out[LINK_VELOCITY].T.copy(),
    )  # fmt: skip


def _noise(deviation: float, shape: tuple[int, ...], random_state: Any) -> Array:
    """White noise of the encoders, (n_joints, n_samples); empty without any."""
    if not deviation:
        return np.zeros((0, 0))
    return deviation * np.random.default_rng(random_state).standard_normal(shape[::-1])


def _rows(*signals: Array) -> Array:
    """Signals (n_samples, n) as the pass takes them, (n_signals, n, n_samples)."""
    return np.ascontiguousarray(np.stack([s.T for s in signals]))


def _axes(arm: Arm, resolution: float) -> Axes:
    """Effects of all joints and sums of joints as flat arrays; those of neutral size are omitted."""
    acting = [[e for e in row if e.magnitude != e.neutral] for row in (*arm.effects, *arm.sums.values())]
    plant = plant_of([e for row in acting for e in row], np.zeros(0))
    parts = np.zeros((len(acting), N_PARTS))
    parts[:, KAPPA], parts[:, LIMIT], parts[:, RESOLUTION] = 1.0 / SMOOTHING, np.inf, resolution
    first = np.cumsum([0, *map(len, acting)]).astype(np.int64)
    armature = np.concatenate([arm.armature, [arm.sum_armature.get(name, 0.0) for name in arm.sums]])
    for k, row in enumerate(acting):
        for e in (e for e in row if isinstance(e, BETWEEN)):
            parts[k, INERTIA] = armature[k] / (1.0 - e.shape["load_share"])
    return Axes(plant.codes, plant.p, plant.own, first, parts, armature, arm._every_direction())


def closed(acting: Iterable[Effect]) -> list[Effect]:
    """Effects of a joint as they act if its link moves with its motor: friction behind a play is friction at both.

    Of effects that differ in size alone, there is one with the sum.

    Examples
    --------
    >>> from whsklearn.effects import Backlash, LoadSideViscous, Viscous
    >>> closed([Viscous(0.1), Backlash(0.01, load_coulomb=0.2), LoadSideViscous(0.3)])
    [Viscous(coefficient=0.4), Coulomb(torque=0.2)]
    """
    sums: dict[Effect, float] = {}  # by the effect at size one
    for e in acting:
        if isinstance(e, BETWEEN):
            if not e.shape["load_coulomb"]:
                continue
            e = Coulomb(e.shape["load_coulomb"])
        elif isinstance(e, LoadSideViscous):
            e = Viscous(e.magnitude)
        kind = e.resized(1.0) if e.linear() else e
        sums[kind] = sums.get(kind, 0.0) + e.magnitude
    return [kind.resized(size) if kind.linear() else kind for kind, size in sums.items()]


def direction_of(joints: Sequence[str], name: str) -> Array:
    """A joint, or a signed sum of joints such as ``wrist+hand`` or ``left-right``, as a vector over the joints.

    Examples
    --------
    >>> from whsklearn.systems.arm import direction_of
    >>> direction_of(["arm", "wrist", "hand"], "wrist-hand").tolist()
    [0.0, 1.0, -1.0]
    """
    known = "|".join(re.escape(j) for j in sorted(joints, key=len, reverse=True))
    if not re.fullmatch(rf"({known})([+-]({known}))*", name):
        raise ValueError(f"{name!r} is neither a joint nor a sum of joints such as a+b; expected {', '.join(joints)}.")
    out = np.zeros(len(joints))
    for sign, joint in re.findall(rf"([+-]?)({known})", name):
        out[list(joints).index(joint)] += -1.0 if sign == "-" else 1.0
    return out


def _controllers(arm: Arm, given: Any) -> Array:
    """The eight numbers of each joint's controller."""
    if given is None:
        # A double pole at 12 Hz and a slow integral for the inertia of a joint while the others are free.  While they
        # are held, that of an axis parallel to others is several times larger: the loops would drive each other.
        mass = arm.mass_matrix(np.zeros((1, arm.n_joints)))[0]
        w, inertia = 2.0 * np.pi * 12.0, np.diagonal(mass)
        if np.linalg.matrix_rank(mass) == len(mass):  # a file may name no inertia of a link
            inertia = 1.0 / np.diagonal(np.linalg.inv(mass))
        given = {
            j: PIDController(float(i * w**2), float(i * w**3 / 20.0), float(2.0 * i * w))
            for j, i in zip(arm.joints, inertia, strict=True)
        }
    if isinstance(given, Mapping):
        if missing := [j for j in arm.joints if j not in given]:
            raise ValueError(f"controller has none for {missing[0]!r}; give one for each of {', '.join(arm.joints)}.")
        return np.array([given[j].row for j in arm.joints])
    return np.array([given.row] * arm.n_joints)
