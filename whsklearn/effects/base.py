"""What an effect is: a name, a place in the chain, an equation, a size and a shape.

One catalogue serves the friction law of the Wiener-Hammerstein system, the
simulators and the gap workflow.  An effect is a small frozen dataclass: its fields
are the numbers, its class attributes say what they mean.  A subclass with a
``name`` enters the registry by being defined.

An effect of your own
---------------------
Write one frozen dataclass whose first field is its size, and one static method
``evaluate(p, time, position, velocity, drive)`` in plain ``math``: ``p`` holds the
fields in their order, and the result is the torque the effect asks of the drive
(``port = "torque"``) or what it adds to the measured position (``port = "output"``).
It must be proportional to the size; then the regressor columns, the simulation in
`whsklearn.systems.ServoAxis` (where it is compiled and called in every fine step)
and the gap workflow follow from that one method, and
`whsklearn.effects.check_effect` tells whether it is sound::

    @dataclass(frozen=True)
    class Magnet(Effect):
        torque: float = 0.1
        width: float = 0.2
        name: ClassVar[str] = "magnet"
        place: ClassVar[str] = "position"
        equation: ClassVar[str] = "c exp(-(q/w)^2)"
        size: ClassVar[str] = "torque"
        quantities: ClassVar[dict[str, Quantity]] = {
            "torque": Quantity("Nm", -1, 1),
            "width": Quantity("rad", 0.01, 1, log=True),
        }

        @staticmethod
        def evaluate(p, time, position, velocity, drive):
            return p[0] * math.exp(-((position / p[1]) ** 2))
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np

from whsklearn.effects.quantity import Quantity

if TYPE_CHECKING:
    from numpy.typing import NDArray

PLACES = ("friction", "drive", "transmission", "position", "sensor", "time")

_REGISTRY: dict[str, type[Effect]] = {}


@dataclass(frozen=True)
class Effect:
    """Base of every effect; subclass it, give it a ``name``, and it is registered.

    Class attributes
    ----------------
    name : str
        Canonical name, the one that reports and files use.
    place : str
        One of ``friction drive transmission position sensor time``; laws of their
        own, such as a polynomial in x, use ``static`` and stay out of the catalogue.
    equation : str
        The effect in symbols, one line.
    size : str
        The field that scales the effect: zero there means that nothing happens.
    quantities : dict of str to Quantity
        Unit and range of every field.
    signature : str
        What tells the effect from its neighbours in data.
    needs : str
        What a record must contain for the effect to be seen.
    aliases : tuple of str
        Effects that no record of drive and position alone can tell from it.
    reference : str
        Where the equation comes from.
    port : str
        Where it enters: ``torque`` (the drive has to pay for it), ``input`` (it changes
        the drive; its columns are on the torque side all the same), ``output`` (it adds
        to the measured position) or ``block`` (it changes the structure).
    column_kind : str
        ``exact`` if the effect is columns times coefficients at its shape, ``at_size`` if it
        is so but the columns change with the size, ``first_order`` if it is so for small
        sizes only, ``none`` if it can only be simulated.
    neutral : float
        The size at which nothing happens.
    phased : bool
        Whether the effect is amplitude cos(argument + phase), hence linear in two columns.
    choices : dict of str to tuple of str
        What a field that is text may be.
    evaluate : callable or None
        ``evaluate(p, time, position, velocity, drive)``, for effects of one's own.
    """

    name: ClassVar[str] = ""
    place: ClassVar[str] = ""
    equation: ClassVar[str] = ""
    size: ClassVar[str] = ""
    quantities: ClassVar[dict[str, Quantity]] = {}
    signature: ClassVar[str] = ""
    needs: ClassVar[str] = ""
    aliases: ClassVar[tuple[str, ...]] = ()
    reference: ClassVar[str] = ""
    port: ClassVar[str] = "torque"
    column_kind: ClassVar[str] = "exact"
    neutral: ClassVar[float] = 0.0
    phased: ClassVar[bool] = False
    choices: ClassVar[dict[str, tuple[str, ...]]] = {}
    evaluate: ClassVar[Callable[..., float] | None] = None
    code: ClassVar[int] = -1

    def __init_subclass__(cls, **kwargs: Any) -> None:
        super().__init_subclass__(**kwargs)
        if cls.__dict__.get("name") and cls.place in PLACES:
            _REGISTRY[cls.name] = cls

    def __post_init__(self) -> None:
        for field in dataclasses.fields(self):
            value = getattr(self, field.name)
            if field.name in self.choices:
                if value not in self.choices[field.name]:
                    raise ValueError(
                        f"{type(self).__name__}: {field.name} is {value!r}, expected one of "
                        f"{', '.join(self.choices[field.name])}."
                    )
            elif isinstance(value, bool) or not isinstance(value, (int, float, np.integer, np.floating)):
                raise ValueError(self._complaint(field.name, value, "a finite number"))
            elif field.name == self.size and value == self.neutral:
                continue
            elif not math.isfinite(value):
                raise ValueError(self._complaint(field.name, value, "a finite number"))
            elif field.name in self.positive_fields() and value <= 0:
                raise ValueError(self._complaint(field.name, value, "a number above zero"))

    def _complaint(self, name: str, value: Any, expected: str) -> str:
        """The sentence about a field that cannot be."""
        unit = self.quantities[name].unit if name in self.quantities else "its unit"
        return f"{type(self).__name__}: {name} is {value!r}, expected {expected}; give it in {unit}."

    @classmethod
    def positive_fields(cls) -> frozenset[str]:
        """Shape fields that must be above zero: those whose range is spanned in ratios."""
        return frozenset(n for n, q in cls.quantities.items() if q.log and q.low > 0 and n != cls.size)

    @property
    def magnitude(self) -> float:
        """The value of the field that scales the effect."""
        return float(getattr(self, self.size))

    def resized(self, magnitude: float) -> Self:
        """The same effect at another size.

        Examples
        --------
        >>> from whsklearn.effects import Coulomb
        >>> Coulomb(0.7).resized(0.5)
        Coulomb(torque=0.5)
        """
        return dataclasses.replace(self, **{self.size: float(magnitude)})

    @property
    def shape(self) -> dict[str, float]:
        """All numeric fields but the size, by name."""
        return {
            f.name: float(getattr(self, f.name))
            for f in dataclasses.fields(self)
            if f.name != self.size and f.name not in self.choices
        }

    @property
    def options(self) -> dict[str, str]:
        """The fields that are text, by name."""
        return {name: getattr(self, name) for name in self.choices}

    @classmethod
    def shape_fields(cls) -> tuple[str, ...]:
        """Names of the shape fields a search has to vary: not the size, not the phase of a phased effect."""
        skip = {cls.size, *cls.choices, *(("phase",) if cls.phased else ())}
        return tuple(f.name for f in dataclasses.fields(cls) if f.name not in skip)

    @property
    def numbers(self) -> tuple[float, ...]:
        """The size and then the shape, as the compiled kernels take them."""
        return (self.magnitude, *self.shape.values())

    @property
    def coefficients(self) -> NDArray[np.float64]:
        """Weights of the columns: the size, or amplitude (cos phase, -sin phase)."""
        if self.phased:
            phase = self.shape["phase"]
            return self.magnitude * np.array([math.cos(phase), -math.sin(phase)])
        return np.array([self.magnitude] if self.column_kind != "none" else [])

    @classmethod
    def from_coefficients(cls, coefficients: Sequence[float] | NDArray[np.float64], **fields: Any) -> Self:
        """The effect whose columns have these weights; the other fields as given or by default.

        Examples
        --------
        >>> from whsklearn.effects import Cogging
        >>> Cogging.from_coefficients([0.3, -0.4], order=17.0).amplitude
        0.5
        """
        weights = np.atleast_1d(np.asarray(coefficients, dtype=float))
        expected = 2 if cls.phased else 1
        if cls.column_kind == "none" or weights.shape != (expected,):
            columns = 0 if cls.column_kind == "none" else expected
            raise ValueError(
                f"{cls.__name__} has {columns} columns, got {weights.size} coefficients; give one for each column."
            )
        if cls.phased:
            fields["phase"] = math.atan2(-weights[1], weights[0])
            return cls(**{cls.size: math.hypot(*weights)}, **fields)
        return cls(**{cls.size: float(weights[0])}, **fields)

    def columns(self, signals: Any) -> NDArray[np.float64]:
        """Regressor columns at this shape; the effect is ``columns @ coefficients``.

        Parameters
        ----------
        signals : object
            With 1-D arrays as attributes ``time`` (s), ``position`` (rad), ``velocity``,
            ``acceleration`` and ``drive`` (Nm); ``kappa`` (s/rad) if sign(v) is to be
            tanh(kappa v).

        Returns
        -------
        ndarray of shape (n_samples, n_columns)
            Torque a coefficient, or position a coefficient where the port is ``output``;
            no column at all where the effect can only be simulated.
        """
        if self.evaluate is None:
            return np.empty((np.asarray(signals.position).size, 0))
        unit = np.array(self.resized(1.0).numbers)
        rows = zip(signals.time, signals.position, signals.velocity, signals.drive, strict=True)
        return np.array([[self.evaluate(unit, *map(float, row))] for row in rows], dtype=float).reshape(-1, 1)

    def contribution(self, signals: Any) -> NDArray[np.float64]:
        """What the effect asks of the drive (Nm), or adds to the measured position (rad)."""
        return self.columns(signals) @ self.coefficients

    def labelled(self) -> dict[str, float | str]:
        """All fields under names that carry their unit, as reports write them.

        Examples
        --------
        >>> from whsklearn.effects import Coulomb
        >>> Coulomb(0.7).labelled()
        {'torque_nm': 0.7}
        """
        numeric = {self.size: self.magnitude, **self.shape}
        return {self.quantities[k].labelled(k): v for k, v in numeric.items()} | self.options


def get_effect(name: str) -> type[Effect]:
    """The effect class of a canonical name.

    Raises
    ------
    ValueError
        If no effect has that name.

    Examples
    --------
    >>> from whsklearn.effects import get_effect
    >>> get_effect("coulomb").place
    'friction'
    """
    try:
        return _REGISTRY[name]
    except KeyError:
        known = ", ".join(sorted(_REGISTRY))
        raise ValueError(f"Unknown effect {name!r}; expected one of: {known}.") from None


def effect_names(place: str | None = None) -> tuple[str, ...]:
    """Names in the catalogue, of one place or of all, in the order of the chain."""
    ordered = sorted(_REGISTRY, key=lambda n: PLACES.index(_REGISTRY[n].place))
    return tuple(n for n in ordered if place is None or _REGISTRY[n].place == place)
