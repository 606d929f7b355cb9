"""An identified arm: physical links, effects of the joints, and the base parameters as measured."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from whsklearn.models.base import IdentifiedModel
from whsklearn.systems.arm import Arm


@dataclass(frozen=True)
class ArmModel(IdentifiedModel):
    """A model of dynamically coupled joints, identified from a log of their drives and positions.

    Parameters
    ----------
    arm : Arm
        A physically consistent arm, as close to the measured base parameters as such an arm can be.
    numbers : mapping of str to float
        Base parameters as measured, by name, such as ``elbow.mx``; each includes the parameters merged into it.
    covariance : array-like of shape (b, b), optional
        Covariance of those numbers, in the same order.
    unexplained : mapping of str to float, optional
        For each joint, the rms error of its drive on blocks of the record that were not fitted (Nm or N).
    varied : mapping of str to float, optional
        For each joint, the standard deviation of its drive in that record (Nm or N).
    reversals : mapping of str to (float, float), optional
        How dry friction reverses, as `RigidBodyLags` takes it.
    gains : mapping of str to (float, float), optional
        Nm (N) per ampere of the drives that were logged as currents, and its standard error, by joint.

    References
    ----------
    Swevers, Verdonck and De Schutter 2007, Dynamic model identification for industrial robots, IEEE Control Systems
    Magazine 27(5), 58-71.

    Examples
    --------
    >>> from whsklearn import Arm
    >>> from whsklearn.models import ArmModel
    >>> table = Arm.from_dh([(0, 0, 0, 0)], inertial=[[0.0] * 9 + [0.05]])
    >>> model = ArmModel(table, {"joint1.Izz": 0.05}, dt=0.001, logged="position")
    >>> bool(abs(model.simulate([[0.1]] * 1000)[-1, 0] - 1.0) < 0.01)  # 2 rad/s2 for one second
    True
    """

    arm: Arm
    numbers: Mapping[str, float] = field(default_factory=dict)
    covariance: Any = None
    unexplained: Mapping[str, float] = field(default_factory=dict)
    varied: Mapping[str, float] = field(default_factory=dict)
    reversals: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    gains: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    kind: ClassVar[str] = "arm"

    @property
    def parameters(self) -> dict[str, float]:
        """Base parameters by name."""
        return {k: float(v) for k, v in self.numbers.items()}

    @property
    def parameter_units(self) -> dict[str, str]:
        """SI units of the `parameters`."""
        return {k: unit for k in self.numbers if (unit := self.arm.unit_of(k))}

    def simulate(self, u: ArrayLike, *, start: Any = 0.0) -> NDArray[np.float64]:
        """Positions (n, n_joints) from the drives (n, n_joints) alone, at rest before the first sample.

        ``u`` (n, n_joints): drives, in ``units``. ``start`` (n_joints,): positions before the first sample, in
        ``units``.
        """
        by, far = self.factors
        u = np.asarray(u, dtype=float) * by
        begin = np.broadcast_to(np.asarray(start, dtype=float) * far, (1, self.arm.n_joints))
        record = self.arm.simulate_drive(u, sample_rate=1.0 / self.dt, position=begin)
        return (record.position if self.logged == "position" else record.velocity) / far
