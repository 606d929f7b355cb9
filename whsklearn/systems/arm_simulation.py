"""Simulate an arm: in closed loop along references, or from logged drives."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from sklearn.utils import Bunch

from whsklearn.systems._arm_pass import DRIVE, MEASURED, N_SIGNALS, POSITION, VELOCITY, Course, Joints, run
from whsklearn.systems._servo_pack import controller_of, plant_of
from whsklearn.systems._servo_torques import KAPPA, LIMIT, N_PARTS, RESOLUTION
from whsklearn.systems.servo import ServoAxis
from whsklearn.systems.servo_parts import PIDController

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from whsklearn.systems.arm import Arm

    Array = NDArray[np.float64]

SMOOTHING = 1e-3  # rad/s (m/s) over which sign(v) turns: a joint that friction holds creeps by less


def simulate(
    arm: Arm,
    *,
    reference: ArrayLike | None = None,
    drive: ArrayLike | None = None,
    controller: PIDController | Mapping[str, PIDController] | None = None,
    feed_forward: Arm | None = None,
    sample_rate: float = 1000.0,
    substeps: int = 10,
    noise: float = 0.0,
    resolution: float = 0.0,
    random_state: Any = 0,
    position: ArrayLike | None = None,
    velocity: ArrayLike | None = None,
    resync: float = 0.0,
) -> Bunch:
    """One record of an arm.

    Parameters
    ----------
    arm : Arm
    reference : array-like of shape (n_samples, n_joints), optional
        Commanded positions, for the closed loop.
    drive : array-like of shape (n_samples, n_joints), optional
        Drives to replay, held between samples; give this or ``reference``.
    controller : PIDController, or mapping of str to PIDController, optional
        One for all joints, or one for each joint. By default, PID gains follow from each joint's inertia (12 Hz).
    feed_forward : Arm, optional
        A model whose inverse dynamics along the reference are added to the output of the controllers.
    sample_rate : float, default=1000.0
        Rate of controllers and log (Hz).
    substeps : int, default=10
        Fine steps per sample.
    noise, resolution : float
        Standard deviation of the noise, and step, of the encoders (rad).
    random_state : int, Generator or None
        Draws the noise.
    position, velocity : array-like of shape (n_samples, n_joints), optional
        Measured motion, where an open loop starts and to which it returns every ``resync`` seconds (0: never).
    resync : float, default=0.0
        Time between returns to the measured motion (s).

    Returns
    -------
    Bunch
        ``time`` (n_samples,); ``reference``, ``drive``, ``position`` (as measured), ``true_position``, ``velocity``,
        (n_samples, n_joints) each.

    Raises
    ------
    FloatingPointError
        If the simulation does not stay finite.

    Examples
    --------
    >>> import numpy as np
    >>> from whsklearn import Arm
    >>> arm = Arm.from_dh([(0.3, 0, 0, 0)], inertial=[[1.0, 0.2, 0, 0, 0.01, 0, 0.1, 0, 0, 0.1]])
    >>> record = arm.simulate(0.1 * np.sin(np.arange(500) / 100)[:, None])
    >>> bool(np.abs(record.position - record.reference).max() < 0.02)
    True
    """
    if (reference is None) == (drive is None):
        raise ValueError("Give reference, for the closed loop, or drive, to replay one; not both.")
    closed = drive is None
    given = arm._motion(reference if drive is None else drive)[0]  # type: ignore[arg-type]
    n_samples, n = given.shape
    zeros = np.zeros((n_samples, n))
    asked = given if closed else zeros
    rate = np.gradient(asked, 1.0 / sample_rate, axis=0)
    path = [asked, rate, np.gradient(rate, 1.0 / sample_rate, axis=0)]
    q, v = (np.broadcast_to(zeros if s is None else arm._motion(s)[0], given.shape) for s in (position, velocity))
    if closed:
        q, v = asked, np.zeros((n_samples, n))
    feed = zeros if feed_forward is None or not closed else feed_forward.inverse_dynamics(*path)
    rng = np.random.default_rng(random_state)
    out = np.zeros((N_SIGNALS, n, n_samples))
    out[DRIVE] = zeros.T if closed else given.T
    course = Course(
        1.0 / sample_rate, int(substeps), closed, round(resync * sample_rate), _rows(q, v), _rows(*path),
        np.ascontiguousarray(feed.T), noise * rng.standard_normal((n, n_samples)) if noise else np.zeros((0, 0)),
        _controllers(arm, controller) if closed else np.zeros((n, 8)),
    )  # fmt: skip
    run(out, arm._links, arm.inertial, _packed(arm, resolution), course, np.stack([q[0], v[0]]))
    bad = ~np.isfinite(out).all(axis=(0, 1))
    if bad.any():
        raise FloatingPointError(
            f"The simulation is no longer finite after {np.argmax(bad) / sample_rate:.3g} s; use more substeps than "
            f"{substeps}, lower gains or other numbers."
        )
    return Bunch(
        time=np.arange(n_samples) / sample_rate, reference=given if closed else np.full(given.shape, np.nan),
        drive=out[DRIVE].T.copy(), position=out[MEASURED].T.copy(), true_position=out[POSITION].T.copy(),
        velocity=out[VELOCITY].T.copy(),
    )  # fmt: skip


def _rows(*signals: Array) -> Array:
    """Signals (n_samples, n) as the pass takes them, (n_signals, n, n_samples)."""
    return np.ascontiguousarray(np.stack([s.T for s in signals]))


def _packed(arm: Arm, resolution: float) -> Joints:
    """Effects of all joints as flat arrays; those of neutral size are left out."""
    acting = [[e for e in row if e.magnitude != e.neutral] for row in arm.effects]
    plant = plant_of([e for row in acting for e in row], np.zeros(0))
    parts = np.zeros((arm.n_joints, N_PARTS))
    parts[:, KAPPA], parts[:, LIMIT], parts[:, RESOLUTION] = 1.0 / SMOOTHING, np.inf, resolution
    first = np.cumsum([0, *map(len, acting)]).astype(np.int64)
    return Joints(plant.codes, plant.p, plant.own, first, parts, arm.armature)


def _controllers(arm: Arm, given: Any) -> Array:
    """Eight numbers of each joint's controller."""
    if given is None:
        # of an axis of its own with the joint's inertia: a double pole at 12 Hz, a slow integral
        w, inertia = 2.0 * np.pi * 12.0, np.diagonal(arm.mass_matrix(np.zeros((1, arm.n_joints)))[0])
        given = {
            j: PIDController(float(i * w**2), float(i * w**3 / 20.0), float(2.0 * i * w))
            for j, i in zip(arm.joints, inertia, strict=True)
        }
    if isinstance(given, Mapping):
        if missing := [j for j in arm.joints if j not in given]:
            raise ValueError(f"controller has none for {missing[0]!r}; give one for each of {', '.join(arm.joints)}.")
        return np.array([controller_of(ServoAxis(controller=given[j])) for j in arm.joints])
    return np.array([controller_of(ServoAxis(controller=given))] * arm.n_joints)
