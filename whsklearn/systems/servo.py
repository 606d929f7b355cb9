"""A servo axis as physics: inertia, friction law, effects, drive, transmission, sensor, controller.

The torque balance is torque = J a + law + effects, so a positive effect is one that the
drive has to pay for.  Nothing in it knows about radians: a linear axis reads kg, m and N.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from whsklearn.effects import Coulomb, Effect, FrictionLaw, Viscous, as_law
from whsklearn.systems import servo_parameters, servo_simulation
from whsklearn.systems.servo_parts import Drive, PIDController, Sensor, Transmission

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray
    from sklearn.utils import Bunch


def _default_law() -> FrictionLaw:
    """Viscous and Coulomb friction of a small turntable."""
    return FrictionLaw([Viscous(0.12), Coulomb(0.3)])


@dataclass(frozen=True)
class ServoAxis:
    """A servo axis that can be simulated in closed loop or from a logged drive.

    Parameters
    ----------
    inertia : float
        Inertia of all that moves (kg m2).
    law : FrictionLaw, str or iterable of StaticEffect
        Friction law; terms given by names such as ``"viscous,coulomb"`` have weight one.
    effects : iterable of Effect
        Further effects, from the catalogue or your own.
    drive, transmission, sensor, controller
        The other parts; ``transmission=None`` means a rigid axis.
    friction : str
        ``"stick"``: dry friction is a set-valued law with true standstill.
        ``"tanh"``: sign(v) is tanh(v / smoothing), as in (3).
    smoothing : float
        Velocity over which ``tanh`` friction changes sign (rad/s).
    sample_rate : float
        Rate of controller and log (Hz).
    substeps : int
        Fine steps per sample.

    Notes
    -----
    Friction acts on the motor's side, and so do cogging and the drive's effects; springs,
    stops, imbalance and tones act on the load's side.  On a rigid axis there is no difference.

    References
    ----------
    Paper, sec. 5.2; Armstrong-Helouvry, Dupont and Canudas de Wit 1994, Automatica 30(7), 1083-1138, on standstill
    under dry friction.

    Examples
    --------
    >>> import numpy as np
    >>> from whsklearn.effects import Cogging
    >>> from whsklearn.systems import ServoAxis
    >>> axis = ServoAxis(inertia=0.05, effects=[Cogging(0.05, order=17)])
    >>> axis.parameters["cogging__order"]
    17.0
    >>> record = axis.simulate(0.5 * np.sin(2 * np.pi * np.arange(1000) / 1000))
    >>> record.position.shape
    (1000,)
    """

    inertia: float = 0.05
    law: FrictionLaw = field(default_factory=_default_law)
    effects: tuple[Effect, ...] = ()
    drive: Drive = field(default_factory=Drive)
    transmission: Transmission | None = None
    sensor: Sensor = field(default_factory=Sensor)
    controller: PIDController = field(default_factory=PIDController)
    friction: str = "stick"
    smoothing: float = 1e-3
    sample_rate: float = 1000.0
    substeps: int = 20

    def __post_init__(self) -> None:
        effects = (self.effects,) if isinstance(self.effects, Effect) else tuple(self.effects)
        object.__setattr__(self, "effects", effects)
        object.__setattr__(self, "law", as_law(self.law))
        for e in effects:
            if not isinstance(e, Effect):
                raise ValueError(f"{e!r} is no effect; expected instances such as Cogging(0.05, order=17).")
        for name in ("inertia", "smoothing", "sample_rate"):
            value = getattr(self, name)
            if not (isinstance(value, (int, float)) and 0.0 < value < math.inf):
                raise ValueError(f"ServoAxis: {name} is {value!r}, expected a finite number above zero.")
        if self.friction not in ("stick", "tanh"):
            raise ValueError(f"ServoAxis: friction is {self.friction!r}, expected 'stick' or 'tanh'.")
        if self.substeps != int(self.substeps) or self.substeps < 1:
            raise ValueError(f"ServoAxis: substeps is {self.substeps!r}, expected a whole number of at least 1.")

    @classmethod
    def paper_rig(cls, **changes: Any) -> Self:
        """The turntable of sec. 5.2: PID 40, 0.001, 0.2 at 100 Hz, encoder of 800 divisions.

        The controller, the rate and the encoder are the paper's; it gives no inertia and no
        friction, so these are set to values of a small turntable.  Its reference is
        ``0.8 sin(2/5 pi t)``, see `whsklearn.datasets.reference_signal`.

        Parameters
        ----------
        **changes
            Fields of `ServoAxis` to change.
        """
        rig: dict[str, Any] = {
            "inertia": 0.02,
            "law": FrictionLaw([Viscous(0.4), Coulomb(0.5)]),
            "drive": Drive(gain=0.2, limit=3.0),
            "sensor": Sensor(resolution=2 * math.pi / 800),
            "controller": PIDController(40.0, 0.001, 0.2, derivative_filter=0.0, limit=15.0),
            "sample_rate": 100.0,
            "substeps": 100,
        }
        return cls(**(rig | changes))

    # -- parameters -------------------------------------------------------------------

    @property
    def term_names(self) -> tuple[str, ...]:
        """``inertia``, the law's labels, the effects' labels."""
        return ("inertia", *self.law.labels, *servo_parameters.effect_labels(self))

    @property
    def parameters(self) -> dict[str, float]:
        """All parameters by name: sizes under their label, shapes as ``label__field``, parts as ``drive__gain``."""
        return servo_parameters.flatten(self)

    def with_parameters(self, values: Mapping[str, float] | None = None, /, **more: float) -> Self:
        """Return the same axis with other parameters.

        Parameters
        ----------
        values : mapping of str to float, optional
            Values by the names in `parameters`.
        **more : float
            The same, as keyword arguments.

        Examples
        --------
        >>> ServoAxis().with_parameters(inertia=0.04, coulomb=0.2).parameters["coulomb"]
        0.2
        """
        return servo_parameters.replace(self, {**(values or {}), **more})

    def vector(self, names: Sequence[str]) -> NDArray[np.float64]:
        """Return the chosen parameters as a vector.

        Parameters
        ----------
        names : sequence of str
            Of `parameters`.
        """
        known = self.parameters
        missing = [n for n in names if n not in known]
        if missing:
            raise ValueError(f"Unknown parameters {missing}; expected some of: {', '.join(known)}.")
        return np.array([known[n] for n in names])

    def with_vector(self, names: Sequence[str], values: ArrayLike) -> Self:
        """The same axis with the chosen parameters taken from a vector.

        Parameters
        ----------
        names : sequence of str
            Of `parameters`.
        values : array-like of shape (n_names,)
            In the units of those parameters.
        """
        return self.with_parameters(dict(zip(names, np.asarray(values, dtype=float).tolist(), strict=True)))

    def with_effect(self, effect: Effect) -> Self:
        """Return the same axis with one more effect.

        Parameters
        ----------
        effect : Effect
        """
        return dataclasses.replace(self, effects=(*self.effects, effect))

    def without_effect(self, label: str) -> Self:
        """Return the same axis without the effect with this label.

        Parameters
        ----------
        label : str
            Name of the effect, numbered if the name recurs.
        """
        labels = servo_parameters.effect_labels(self)
        if label not in labels:
            raise ValueError(f"No effect is called {label!r}; expected one of: {', '.join(labels) or 'none'}.")
        keep = tuple(e for name, e in zip(labels, self.effects, strict=True) if name != label)
        return dataclasses.replace(self, effects=keep)

    def with_law(self, law: FrictionLaw | str | Iterable[Any]) -> Self:
        """The same axis with another friction law.

        Parameters
        ----------
        law : FrictionLaw, str or iterable of StaticEffect
            As `as_law` takes it.
        """
        return dataclasses.replace(self, law=as_law(law))  # type: ignore[arg-type]

    def columns(self, signals: Any) -> tuple[NDArray[np.float64], tuple[str, ...]]:
        """Regressors of torque = J a + law + effects, with a label for each column.

        Effects of the sensor and those that can only be simulated have none; a phased
        effect has two, labelled ``name__cos`` and ``name__sin``.

        Parameters
        ----------
        signals : Bunch
            ``time`` (s), ``position`` (rad), ``velocity``, ``acceleration`` and ``drive`` (Nm), shape (n,) each.
        """
        blocks, names = [np.asarray(signals.acceleration, dtype=float).reshape(-1, 1)], ["inertia"]
        for label, e in zip(self.term_names[1:], (*self.law.terms, *self.effects), strict=True):
            if e.port == "output" or e.column_kind == "none":
                continue
            blocks.append(e.columns(signals))
            names += [f"{label}__cos", f"{label}__sin"] if e.phased else [label]
        return np.hstack(blocks), tuple(names)

    # -- simulation -------------------------------------------------------------------

    def simulate(self, reference: ArrayLike, **options: Any) -> Bunch:
        """Simulate the closed loop along a reference; see `whsklearn.systems.servo_simulation.simulate_many`.

        Parameters
        ----------
        reference : array-like of shape (n,)
            Commanded position, one value per sample (rad).
        **options
            ``noise``, ``random_state``, ``disturbance``, ``reference_velocity``,
            ``reference_acceleration``, ``initial_position``, ``initial_velocity``.

        Returns
        -------
        Bunch
            Arrays of shape (n,): ``time``, ``reference``, ``drive`` (as logged), ``position``
            (as measured), ``true_position``, ``velocity``, ``torque`` (at the axis), ``load_position``,
            ``load_velocity``.

        Raises
        ------
        FloatingPointError
            If the simulation does not stay finite.
        """
        return servo_simulation.simulate_one(self, reference=reference, **options)

    def simulate_drive(self, drive: ArrayLike, **options: Any) -> Bunch:
        """Replay a logged drive (Nm) in open loop, held between samples.

        Parameters
        ----------
        drive : array-like of shape (n,)
            The drive as logged.
        **options
            As for `simulate`, and ``position``, ``velocity`` (measured), ``resync`` (s:
            return to them that often), ``hold`` (``"zero"`` or ``"linear"``).

        Returns
        -------
        Bunch
            As for `simulate`, with NaN for the reference.

        Raises
        ------
        FloatingPointError
            If the simulation does not stay finite.
        """
        return servo_simulation.simulate_one(self, drive=drive, **options)
