"""A servo axis as physics: inertia, friction law and effects."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from whsklearn.effects import Effect, EndStop, FlexibleCoupling, FrictionLaw, LearnedTorque, as_law
from whsklearn.filtering.records import HOLDS, fine_drive
from whsklearn.logs.units import assumed, inertia_unit, respelled
from whsklearn.models.base import IdentifiedModel, as_input
from whsklearn.systems import ServoAxis
from whsklearn.systems.servo import fine_steps
from whsklearn.systems.servo_parts import Sensor

SMALL = 1e-4  # deflection over which a stiffness is computed
# Radians of an oscillation per fine step: the frequency of leapfrog is high by STEP^2 / 24, and the error of the
# output, with a damping of 5 %, is twenty times that, 0.13 %
STEP = 0.04


@dataclass(frozen=True)
class AxisModel(IdentifiedModel):
    """Inertia dv/dt = u - law(v) - effects, in SI units whatever the units of the columns; see `IdentifiedModel`.

    A drive in A, V or % is not converted; for a drive in A, inertia is in A s²/rad and friction in A.

    Parameters
    ----------
    inertia : float
        Drive per acceleration (kg m²; kg for a linear axis).
    law : FrictionLaw
        Friction as a function of velocity; may be a spline over it.
    effects : tuple of Effect
        Further effects, such as `InputOffset` and `Cogging`.
    hold : {"zero", "cubic"}, default="zero"
        The drive between its samples: held constant, or a smooth curve through them
        (`whsklearn.filtering.records.fine_drive`).
    side : {"motor", "load"}, default="motor"
        The end of a flexible coupling at which the output is measured.

    References
    ----------
    Armstrong-Helouvry, Dupont and Canudas de Wit 1994, Automatica 30(7), 1083-1138.

    Examples
    --------
    >>> from whsklearn.effects import as_law
    >>> from whsklearn.models import AxisModel
    >>> model = AxisModel(0.5, as_law("coulomb"), dt=0.001, logged="velocity")
    >>> model.simulate([0.5] * 5).tolist()  # below its friction of 1 it stands
    [0.0, 0.0, 0.0, 0.0, 0.0]
    >>> AxisModel(0.5, as_law("coulomb"), units={"input": "mNm", "output": "deg"}, logged="position").parameter_units
    {'inertia': 'kg m²', 'coulomb': 'Nm'}
    """

    inertia: float
    law: FrictionLaw
    effects: tuple[Effect, ...] = ()
    hold: str = "zero"
    side: str = "motor"
    kind: ClassVar[str] = "axis"

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "law", as_law(self.law))
        object.__setattr__(self, "effects", tuple(self.effects))
        if self.hold not in HOLDS:
            raise ValueError(f"hold is {self.hold!r}, expected one of: {', '.join(HOLDS)}.")
        if self.logged == "output":
            raise ValueError(
                "logged is 'output', but the output of an axis is its velocity or its position; say which of the two."
            )
        self.system()  # raises if the axis cannot be simulated

    def system(self, **changes: Any) -> ServoAxis:
        """The axis as `ServoAxis`, to simulate it in closed loop or with other parts.

        ``**changes``: fields of `ServoAxis` to replace.
        """
        parts = {"sample_rate": 1.0 / self.dt, "substeps": self.steps, "sensor": Sensor(side=self.side), **changes}
        return ServoAxis(self.inertia, self.law, self.effects, **parts)

    @property
    def steps(self) -> int:
        """Fine steps per sample: as many as the effects require, and enough to resolve the oscillation on a spring."""
        at_rest = sum(
            float(e.value(position=SMALL) - e.value(position=-SMALL)) for e in self.effects if e.place == "position"
        )
        squares = [at_rest / (2.0 * SMALL * self.inertia)]
        for e in self.effects:
            if isinstance(e, EndStop):
                squares.append(e.stiffness / self.inertia)
            if isinstance(e, FlexibleCoupling):
                squares.append(1.0 / (self.inertia * e.load_share * (1.0 - e.load_share) * e.compliance))
        return max(fine_steps(self.effects, self.dt), spring_steps(max(squares), self.dt))

    @property
    def parameters(self) -> dict[str, float]:
        """``inertia``, the law's weights, the effects' sizes and shapes."""
        axis = self.system()
        # these belong to the simulator, not to the axis
        left_out = ("drive__", "transmission__", "sensor__", "controller__", "smoothing")
        return {k: float(v) for k, v in axis.parameters.items() if not k.startswith(left_out)}

    @property
    def si(self) -> tuple[str, str]:
        """SI symbols of drive and motion; Nm and rad, or N and m, if the units are unknown."""
        drive, output = super().si
        return assumed(drive, output.removesuffix("/s"))

    @property
    def parameter_units(self) -> dict[str, str]:
        """SI units of all `parameters`, ``1`` for a bare number."""
        own, units = dict(zip(("Nm", "rad"), self.si, strict=True)), {"inertia": inertia_unit(*self.si)}
        effects = zip(self.system().effect_labels, self.effects, strict=True)
        for label, effect in (*zip(self.law.labels, self.law.terms, strict=True), *effects):
            for field in (effect.size, *effect.shape):
                unit = unit_of_field(effect, field)  # of a rotary axis driven by a torque
                name = label if field == effect.size else f"{label}__{field}"
                units[name] = unit if field == "phase" else respelled(unit, own)[1]
        return {k: units[k] for k in self.parameters}

    def simulate(self, u: ArrayLike, *, start: float = 0.0, speed: float = 0.0) -> NDArray[np.float64]:
        """Output (n,) in its unit, from the input (n,) alone.

        ``u`` (n,): input in ``units``. ``start``: initial position, in ``units``, if the output is a position.
        ``speed``: initial velocity, in ``units``, those of a position per second.

        Examples
        --------
        >>> from whsklearn.effects import as_law
        >>> from whsklearn.models import AxisModel
        >>> axis = AxisModel(0.1, as_law("viscous"), dt=0.01, logged="velocity")
        >>> axis.simulate([0.0, 0.0], speed=2.0)[:1].tolist()
        [2.0]
        """
        by, far = self.factors
        drive, steps = as_input(u) * by, 1
        if self.hold != "zero":
            steps = self.steps
            drive = fine_drive(drive, steps, self.hold).ravel()
        axis = self.system(sample_rate=steps / self.dt, substeps=max(self.steps // steps, 1))
        record = axis.simulate_drive(drive, initial_position=start * far, initial_velocity=speed * far)
        velocity = record.load_velocity if self.side == "load" else record.velocity
        return (record.position if self.logged == "position" else velocity)[::steps] / far


def spring_steps(square: float, dt: float) -> int:
    """Fine steps per sample of ``dt`` s for an oscillation with this squared angular frequency: a power of two."""
    return 2 ** math.ceil(math.log2(max(dt * math.sqrt(max(square, 0.0)) / STEP, 1.0)))


_OVER = {"speed": "rad/s", "velocity": "rad/s", "drive": "Nm"}  # otherwise a learned torque is a function of position


def unit_of_field(effect: Effect, field: str) -> str:
    """Unit of an effect's parameter on a rotary axis, also if the effect is a term of a static law in the velocity.

    >>> from whsklearn.effects import SpeedHinge, Viscous
    >>> unit_of_field(Viscous(0.1), "coefficient"), unit_of_field(SpeedHinge(0.1, 2.0), "knot")
    ('Nm s/rad', 'rad/s')
    """
    if isinstance(effect, LearnedTorque) and field != effect.size:
        return _OVER.get(effect.over, "rad")
    unit = effect.quantities[field].unit if field in effect.quantities else "1"
    if unit == "y per x":
        return "Nm"
    return "rad/s" if unit == "x" else unit
