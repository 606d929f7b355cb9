"""Logs of a simulated arm with any effects hidden at any joints."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from whsklearn.effects import Coulomb, Viscous
from whsklearn.systems.arm import Arm

if TYPE_CHECKING:
    import pandas as pd

SINES = 5  # of the default reference: enough for every base parameter of six joints


def default_arm() -> Arm:
    """A two-axis turntable: a vertical yaw axis, and on it a pitch axis with an eccentric load.

    Examples
    --------
    >>> from whsklearn.datasets import default_arm
    >>> default_arm().joints
    ('yaw', 'pitch')
    """
    arm = Arm.from_dh(
        [(0.0, np.pi / 2, 0.2, 0.0), (0.1, 0.0, 0.0, 0.0)], joints=("yaw", "pitch"), armature=(0.01, 0.01),
        effects={"yaw": (Viscous(0.2), Coulomb(0.3)), "pitch": (Viscous(0.1), Coulomb(0.2))},
    )  # fmt: skip
    arm = arm.with_body("yaw", 3.0, (0.02, 0.01, 0.1), np.diag([0.03, 0.03, 0.04]))
    return arm.with_body("pitch", 1.5, (0.12, 0.03, 0.02), np.diag([0.004, 0.02, 0.02]))


def make_arm_log(
    robot: Arm | None = None,
    effects: Mapping[str, Any] | None = None,
    *,
    controller: Any = None,
    reference: ArrayLike | None = None,
    amplitude: float = 0.6,
    duration: float = 20.0,
    sample_rate: float = 500.0,
    noise: float = 2e-5,
    resolution: float = 0.0,
    random_state: Any = 0,
    return_arrays: bool = False,
) -> pd.DataFrame | tuple[Any, Any]:
    """Simulate a log of an arm in closed loop.

    Parameters
    ----------
    robot : Arm, optional
        The arm without the hidden effects; `default_arm` by default.
    effects : mapping of str to effects, optional
        Hidden effects by joint.
    controller : PIDController or mapping of these, optional
        See `whsklearn.Arm.simulate`.
    reference : array-like of shape (n, n_joints), optional
        Commanded positions; by default a sum of five random sines per joint.
    amplitude, duration : float
        Of that sum: half the travel about zero (rad), and length (s).
    sample_rate : float, default=500.0
        In Hz.
    noise, resolution : float
        Of the encoders (rad).
    random_state : int, Generator or None
        Of reference and noise.
    return_arrays : bool, default=False
        Whether to return positions and drives, (n, n_joints) each, instead of a table.

    Returns
    -------
    DataFrame
        Columns ``time_s``, and ``NAME_reference_rad``, ``NAME_position_rad``, ``NAME_torque_nm`` of each joint (m and N
        where it slides).

    Examples
    --------
    >>> from whsklearn.datasets import make_arm_log
    >>> from whsklearn.effects import Cogging
    >>> log = make_arm_log(effects={"pitch": [Cogging(0.2, order=7)]}, duration=2.0)
    >>> list(log.columns[:4]), len(log)
    (['time_s', 'yaw_reference_rad', 'yaw_position_rad', 'yaw_torque_nm'], 1000)
    """
    rng = np.random.default_rng(random_state)
    arm = default_arm() if robot is None else robot
    n = arm.n_joints
    if reference is None:
        time = np.arange(round(duration * sample_rate))[:, None, None] / sample_rate
        w, phase = rng.uniform(0.8, 6.0, (n, SINES)), rng.uniform(0.0, 2.0 * np.pi, (n, SINES))
        path = (np.sin(w * time + phase) / np.sqrt(w)).sum(axis=2)
        reference = amplitude * path / np.abs(path).max(axis=0)
    hidden = arm if effects is None else arm.with_effects(effects)
    record = hidden.simulate(
        reference, controller=controller, feed_forward=arm, sample_rate=sample_rate, noise=noise,
        resolution=resolution, random_state=rng,
    )  # fmt: skip
    if return_arrays:
        return record.position, record.drive
    import pandas as pd

    columns: dict[str, Any] = {"time_s": record.time}
    for j, (name, slides) in enumerate(zip(arm.joints, arm.slides, strict=True)):
        place, force = ("m", "n") if slides else ("rad", "nm")
        columns[f"{name}_reference_{place}"] = record.reference[:, j]
        columns[f"{name}_position_{place}"] = record.position[:, j]
        columns[f"{name}_torque_{force}"] = record.drive[:, j]
    return pd.DataFrame(columns)
