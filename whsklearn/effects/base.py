"""What an effect is: a name, a place in the chain, an equation, a size and a shape.

One catalogue serves the friction law of the Wiener-Hammerstein system, the
simulators and the gap workflow.  An effect is a declaration: its fields are the numbers, each with its unit and
range, and its class attributes say what they mean.  A subclass is a frozen dataclass, and one with a
``name`` is in the registry, by being defined.

An effect of your own
---------------------
Declare one class whose first field is its size, and one static method
``evaluate(p, time, position, velocity, drive)`` in plain ``math``: ``p`` holds the
fields in their order, and the result is the torque that the drive must supply for the effect
(``port = "torque"``) or what it adds to the measured position (``port = "output"``).
It must be proportional to the size; then the regressor columns, the simulation in
`whsklearn.systems.ServoAxis` (where it is compiled and called in every fine step),
the search for it and the gap workflow follow from that one method, and
`whsklearn.checks.check_effect` checks that it is sound::

    class Magnet(Effect):
        torque: float = number(0.1, "Nm", -1, 1)
        width: float = number(0.2, "rad", 0.01, 1, log=True)

        name = "magnet"
        place = "position"
        equation = "c exp(-(q/w)^2)"

        @staticmethod
        def evaluate(p, time, position, velocity, drive):
            return p[0] * math.exp(-((position / p[1]) ** 2))

How a search sees an effect
---------------------------
A search needs no table of its own.  A compiled kernel takes an effect as its ``code`` and its ``row`` of numbers:
`linear` leading ones, then those in `searched`, whose `bounds` and `starts` in one record follow from the `Quantity` of
each field and the record's `Scales`.  `from_row` makes an effect of a row again.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any, ClassVar, Self, dataclass_transform

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sklearn.utils import Bunch

from whsklearn.effects import codes
from whsklearn.effects.own import address_of, own_values_along
from whsklearn.effects.quantity import Quantity, Scales
from whsklearn.effects.rows import values_along
from whsklearn.effects.surroundings import Surroundings

Array = NDArray[np.float64]  # a signal, or any other numbers
Bools = NDArray[np.bool_]  # marks of samples
Integers = NDArray[np.int64]  # counts

PLACES = ("friction", "drive", "transmission", "position", "sensor", "time")

BARELY = 1e-300  # the size at which a size-dependent column is evaluated if the size is zero

MOST_STARTS = 60  # each start costs a pass over the record

_REGISTRY: dict[str, type[Effect]] = {}


class _Frozen:
    """Refuses assignment; below `Effect`, whose subclasses leave out the methods that a frozen dataclass makes."""

    def __setattr__(self, name: str, value: Any) -> None:
        raise dataclasses.FrozenInstanceError(f"cannot assign to field {name!r}")

    def __delattr__(self, name: str) -> None:
        raise dataclasses.FrozenInstanceError(f"cannot delete field {name!r}")


@dataclass_transform(frozen_default=True)
@dataclass(frozen=True)
class Effect(_Frozen):
    """Base of every effect; subclass it, give it a ``name``, and it is registered.

    Attributes
    ----------
    name : str
        Canonical name, the one that reports and files use.
    place : str
        One of ``friction drive transmission position sensor time``; laws of their
        own, such as a polynomial in x, use ``static`` and stay out of the catalogue.
    equation : str
        The effect in symbols, one line.
    size : str
        The field that scales the effect, the first one; at zero it has no influence.
    quantities : dict of str to Quantity
        Unit and range of every field, from its `number`.
    signature : str
        What distinguishes the effect from its neighbours in data.
    needs : str
        What a record must contain for the effect to be seen.
    aliases : tuple of str
        Effects that no record of drive and position alone can tell from it.
    reference : str
        Where the equation comes from.
    port : str
        Where it enters: ``torque`` (the drive must supply it), ``input`` (it changes the drive; its columns are torques
        nevertheless), ``output`` (it adds to the measured position) or ``block`` (it changes the structure).
    column_kind : str
        ``exact`` if the effect is columns times coefficients at its shape, ``at_size`` if the columns also depend on
        the size, ``first_order`` if this holds for small sizes only, ``none`` if it can only be simulated.
    neutral : float
        The size at which the effect has no influence.
    phased : bool
        Whether the effect is amplitude cos(argument + phase), hence linear in two columns.
    choices : dict of str to tuple of str
        Allowed values of each text field, from its `choice`.
    parent : str
        Effect without which this one is not tried, such as ``coulomb`` for effects that modify it; empty for none.
    commoner : tuple of str
        Effects that are preferred to this one if both explain a record about equally well.
    covers : tuple of str
        Effects that its own parameters already include: an offset only moves the rest position of a spring.
    elementary : bool
        Whether it is so common that it is tried first when much is missing.
    repeats : bool
        Whether a model may contain several of it, such as cogging of two orders.
    rotary : bool
        Whether it needs an axis that turns: no weight swings about a slide.
    held : tuple of str
        Fields that a search keeps at their starting values.
    essential : tuple of str
        Fields, besides the first shape number, at whose limits it would be another effect or none.
    later : tuple of str
        Fields that a search keeps at their starting values until it has accepted the effect; they are then freed, and
        stay free if that improves the fit enough.
    sought : bool
        Whether a search tries this class in addition to the registered class of its name, because it has a shape that
        the other cannot take.
    finest : float
        Largest time step at which its simulation is accurate (s).
    evaluate : callable or None
        ``evaluate(p, time, position, velocity, drive)``, for user-defined effects.

    References
    ----------
    Armstrong-Helouvry, Dupont and Canudas de Wit 1994, A survey of models, analysis tools and compensation methods
    for the control of machines with friction, Automatica 30(7), 1083-1138.

    Examples
    --------
    >>> from whsklearn.effects import Cogging, get_effect
    >>> effect = Cogging(0.05, order=12.0)
    >>> effect.magnitude, effect.shape
    (0.05, {'order': 12.0, 'phase': 0.0})
    >>> effect.equation, effect.labelled()["amplitude_nm"]
    ('A cos(k q + phi)', 0.05)
    >>> get_effect("cogging") is Cogging
    True
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
    parent: ClassVar[str] = ""
    commoner: ClassVar[tuple[str, ...]] = ()
    covers: ClassVar[tuple[str, ...]] = ()
    elementary: ClassVar[bool] = False
    held: ClassVar[tuple[str, ...]] = ()
    later: ClassVar[tuple[str, ...]] = ()
    essential: ClassVar[tuple[str, ...]] = ()
    sought: ClassVar[bool] = False
    repeats: ClassVar[bool] = False
    rotary: ClassVar[bool] = False
    finest: ClassVar[float] = math.inf
    evaluate: ClassVar[Callable[..., float] | None] = None
    code: ClassVar[int] = -1

    def __init_subclass__(cls, catalogued: bool = True, **kwargs: Any) -> None:
        """Make the class a dataclass, read its fields, and register it under its name unless told otherwise."""
        super().__init_subclass__(**kwargs)
        if "__dataclass_fields__" not in cls.__dict__:  # they are there in the copy that ``slots=True`` makes
            dataclass(frozen=True)(cls)
            del cls.__setattr__, cls.__delattr__  # a class may carry the decorator too, which refuses to replace them
        fields = dataclasses.fields(cls)
        cls.size = cls.size or next((f.name for f in fields), "")
        cls.quantities = cls.quantities | {f.name: f.metadata["quantity"] for f in fields if "quantity" in f.metadata}
        cls.choices = cls.choices | {f.name: tuple(f.metadata["codes"]) for f in fields if "codes" in f.metadata}
        for f in fields:
            if "codes" in f.metadata and f.name in cls.__annotations__:
                cls.code = _code_of(f)  # type: ignore[assignment]
        if cls.evaluate is not None and "code" not in cls.__dict__:
            cls.code = codes.USER_OUTPUT if cls.port == "output" else codes.USER_TORQUE
        if cls.__dict__.get("name") and cls.place in PLACES and catalogued:
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
        """The error message for an invalid field."""
        unit = self.quantities[name].unit if name in self.quantities else "its unit"
        return f"{type(self).__name__}: {name} is {value!r}, expected {expected}; give it in {unit}."

    @classmethod
    def positive_fields(cls) -> frozenset[str]:
        """Shape fields that must be above zero: those with a logarithmic range."""
        return frozenset(n for n, q in cls.quantities.items() if q.log and q.low > 0 and n != cls.size)

    @property
    def magnitude(self) -> float:
        """The value of the field that scales the effect."""
        return float(getattr(self, self.size))

    def resized(self, magnitude: float) -> Self:
        """The same effect at another size.

        ``magnitude``: value of the field ``size``, in its unit.

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
        """Names of the shape fields that a search varies: all but the size and the phase of a phased effect."""
        skip = {cls.size, *cls.choices, *(("phase",) if cls.phased else ())}
        return tuple(f.name for f in dataclasses.fields(cls) if f.name not in skip)

    @property
    def numbers(self) -> tuple[float, ...]:
        """The size and then the shape, in the order of the fields."""
        return (self.magnitude, *self.shape.values())

    # -- as kernels and searches take it ----------------------------------------------

    @classmethod
    def linear(cls) -> int:
        """Number of leading entries of a row in which the effect is linear: two if phased, one, or none."""
        if cls.column_kind != "exact":
            return 0
        return 2 if cls.phased and cls.evaluate is None else 1

    @classmethod
    def searched(cls) -> tuple[str, ...]:
        """Names of the entries after the linear ones of a row, in order."""
        if cls.evaluate is not None:
            return tuple(f.name for f in dataclasses.fields(cls) if f.name != cls.size and f.name not in cls.choices)
        return cls.shape_fields() if cls.linear() else (cls.size, *cls.shape_fields())

    @property
    def row(self) -> tuple[float, ...]:
        """The numbers as compiled kernels take them: linear ones first, then those in `searched`.

        Examples
        --------
        >>> from whsklearn.effects import Cogging
        >>> Cogging(0.5, order=17.0).row
        (0.5, -0.0, 17.0)
        """
        if self.phased and self.evaluate is None:
            return (*(float(c) for c in self.coefficients), *(self.shape[f] for f in self.shape_fields()))
        return self.numbers

    @classmethod
    def from_row(cls, row: Sequence[float] | NDArray[np.float64], **options: str) -> Self:
        """The effect of a row of numbers, the inverse of `row`.

        ``row``: the numbers in the order of the fields. ``**options``: fields that are text.

        Examples
        --------
        >>> from whsklearn.effects import Cogging
        >>> Cogging.from_row((0.0, -0.5, 17.0))
        Cogging(amplitude=0.5, order=17.0, phase=1.57...)
        """
        n, names = cls.linear(), cls.searched()
        fields: dict[str, Any] = {f: float(v) for f, v in zip(names, row[n : n + len(names)], strict=True)}
        if n == 0:
            return cls(**fields, **options)
        return cls.from_coefficients([float(v) for v in row[:n]], **fields, **options)

    @classmethod
    def variants(cls) -> list[dict[str, str]]:
        """Every combination of the text fields; one empty combination if there are none."""
        names = list(cls.choices)
        return [dict(zip(names, values, strict=True)) for values in itertools.product(*cls.choices.values())]

    @classmethod
    def bounds(cls, scales: Scales) -> list[tuple[float, float]]:
        """Search range of every number in `searched`, in a record of these ``scales``."""
        return [cls.quantities[f].bounds(scales) for f in cls.searched()]

    @classmethod
    def starts(cls, scales: Scales) -> list[tuple[float, ...]]:
        """Points in `searched` from which a search of a record of these ``scales`` begins: the product of their grids.

        Above 60 points the grids are thinned; those of quantities with starts of their own are thinned last.
        """
        grids = [cls.quantities[f].grid(scales)[: 1 if f in cls.later else None] for f in cls.searched()]
        while math.prod(map(len, grids)) > MOST_STARTS:
            given = [bool(cls.quantities[f].starts) for f in cls.searched()]
            i = max(range(len(grids)), key=lambda k: (not given[k] and len(grids[k]) > 2, len(grids[k])))
            grids[i] = grids[i][:: max(2, len(grids[i]) // 3)]
        return list(itertools.product(*grids))

    @classmethod
    def later_starts(cls, scales: Scales) -> list[tuple[float, ...]]:
        """Starting points in `later` once the effect is accepted: the product of their grids in a record of these
        ``scales``, without the value at which they were held.
        """
        grids = [cls.quantities[f].grid(scales) for f in cls.later]
        return list(itertools.product(*(g[1:] or g for g in grids)))

    @classmethod
    def scanned(cls) -> str:
        """The field that only a fine grid finds (its quantity says how); empty if the starts suffice."""
        return next((f for f in cls.searched() if cls.quantities[f].scan), "")

    @classmethod
    def parent_of(cls, **options: str) -> str:
        """The effect without which a variant is not tried: `parent`, unless a choice in ``options`` decides."""
        return cls.parent

    @property
    def coefficients(self) -> NDArray[np.float64]:
        """Weights of the columns: the size, or amplitude (cos phase, -sin phase)."""
        if self.phased:
            phase = self.shape["phase"]
            return self.magnitude * np.array([math.cos(phase), -math.sin(phase)])
        return np.array([self.magnitude] if self.column_kind != "none" else [])

    @classmethod
    def from_coefficients(cls, coefficients: Sequence[float] | NDArray[np.float64], **fields: Any) -> Self:
        """The effect whose columns have these weights; other fields are as given or default.

        ``coefficients``: weights of its columns. ``**fields``: the other fields.

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

        ``signals``: with 1-D arrays as attributes ``time`` (s), ``position`` (rad), ``velocity``, ``acceleration`` and
        ``drive`` (Nm); ``drive_rate`` (Nm/s) if the slope of the drive is known better than from these samples;
        ``kappa`` (s/rad) for tanh(kappa v) in place of sign(v). Returns (n_samples, n_columns): torque
        (position if the port is ``output``) per unit of each coefficient; no column if the effect can only be
        simulated.
        """
        n = np.asarray(signals.position).size
        if self.column_kind == "first_order":  # what a small delay or lag takes from the drive, per second of either
            rate = getattr(signals, "drive_rate", None)
            if rate is None:
                rate = np.gradient(np.asarray(signals.drive, dtype=float), np.asarray(signals.time, dtype=float))
            return np.asarray(rate, dtype=float).reshape(-1, 1)
        if self.column_kind == "none" or self.code < 0:
            return np.empty((n, 0))
        if self.column_kind == "at_size":
            size = self.magnitude
            if math.isinf(size):
                return np.zeros((n, 1))
            size = size if size != 0.0 else BARELY
            return (self.along((size, *self.row[1:]), signals) / size).reshape(-1, 1)
        shape = self.row[self.linear() :]
        return np.column_stack([self.along((*unit, *shape), signals) for unit in np.eye(self.linear())])

    def along(self, row: Sequence[float], signals: Any) -> NDArray[np.float64]:
        """The drive that the effect takes with the numbers in ``row``, or its contribution to the reading, shape (n,).

        ``row``: numbers in place of its own, as in `row`. ``signals``: as `columns` takes them; what is absent counts
        as zero.
        """
        absent = np.zeros(np.asarray(signals.position).size)
        time, position, velocity, acceleration, drive = (
            np.ascontiguousarray(getattr(signals, name, absent), dtype=float)
            for name in ("time", "position", "velocity", "acceleration", "drive")
        )
        if self.evaluate is not None:
            return own_values_along(address_of((type(self),)), np.array(row), time, position, velocity, drive)
        p = np.zeros((1, codes.N_NUMBERS))
        p[0, : len(row)] = row
        kappa = getattr(signals, "kappa", None)
        sharpness = math.inf if kappa is None else float(kappa)
        return values_along(self.code, p, time, position, velocity, acceleration, drive, sharpness)

    def contribution(self, signals: Any) -> NDArray[np.float64]:
        """The drive that the effect takes (Nm), or what it adds to the measured position (rad).

        ``signals``: ``time`` (s), ``position`` (rad), ``velocity``, ``acceleration`` and ``drive`` (Nm), shape (n,)
        each.
        """
        weights = self.coefficients  # a limit may be infinite; its column is then zero
        return self.columns(signals) @ np.where(np.isfinite(weights), weights, 0.0)

    def value(
        self,
        *,
        time: ArrayLike = 0.0,
        position: ArrayLike = 0.0,
        velocity: ArrayLike = 0.0,
        acceleration: ArrayLike = 0.0,
        drive: ArrayLike = 0.0,
    ) -> Any:
        """`contribution` for signals given one by one, broadcast against each other: a number, or an array (n,).

        ``time``, ``position``, ``velocity``, ``acceleration``, ``drive``: in s, rad, rad/s, rad/s2 and Nm.

        Examples
        --------
        >>> from whsklearn.effects import Coulomb
        >>> Coulomb(0.7).value(velocity=-2.0)
        -0.7
        """
        names = ("time", "position", "velocity", "acceleration", "drive")
        values = np.broadcast_arrays(
            *(np.asarray(v, dtype=float) for v in (time, position, velocity, acceleration, drive))
        )
        signals = SimpleNamespace(**{n: np.array(v).reshape(-1) for n, v in zip(names, values, strict=True)})
        out = self.contribution(signals)
        return float(out[0]) if values[0].ndim == 0 else out.reshape(values[0].shape)

    def implausible(self, seen: Surroundings) -> str:
        """Why an effect with these numbers cannot be what a record lacks, as part of a sentence; empty if it can.

        A search refuses what its own physics speaks against; most effects have nothing to add to their ranges.

        ``seen``: the record, and the model that the effect is part of.
        """
        return ""

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


def rms(x: ArrayLike) -> float:
    """Root mean square of all entries, of any shape.

    >>> rms([3.0, -3.0])
    3.0
    """
    return float(np.sqrt(np.mean(np.square(x))))


def signals_of(record: Bunch, drive: str = "drive") -> Bunch:
    """True signals of a simulated record, as `Effect.columns` takes them; with ``drive="torque"`` that at the motor."""
    acceleration = np.gradient(record.velocity, record.time)
    return Bunch(
        time=record.time, position=record.true_position, velocity=record.velocity, acceleration=acceleration,
        drive=record[drive],
    )  # fmt: skip


def _code_of(field: dataclasses.Field[Any]) -> property:
    """The property ``code`` of an effect whose equation a text field selects."""
    return property(
        lambda self: field.metadata["codes"][getattr(self, field.name)], doc=f"The code of its {field.name}."
    )


class ArgumentError(ValueError):
    """An argument that does not fit: on the command line a wrong option.

    Such as a name that no effect has, or a format that cannot hold the model.

    Examples
    --------
    >>> from whsklearn.effects import get_effect
    >>> from whsklearn.effects.base import ArgumentError
    >>> try:
    ...     get_effect("magic")
    ... except ArgumentError as error:
    ...     print(str(error)[:23])
    Unknown effect 'magic';
    """


def get_effect(name: str) -> type[Effect]:
    """The effect class of a canonical name.

    ``name``: such as ``cogging``. Raises ValueError if no effect has that name.

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
        raise ArgumentError(f"Unknown effect {name!r}; expected one of: {known}.") from None


def shapes_of(name: str) -> tuple[type[Effect], ...]:
    """The class of a canonical name, and further classes of that name that a search tries.

    ``name``: such as ``presliding_hysteresis``.

    >>> from whsklearn.effects.base import shapes_of
    >>> [c.__name__ for c in shapes_of("presliding_hysteresis")]
    ['PreslidingHysteresis', 'LuGre']
    """
    cls = get_effect(name)
    return (cls, *(c for c in cls.__subclasses__() if c.sought and c.name == name))


def effect_names(place: str | None = None) -> tuple[str, ...]:
    """Names in the catalogue, of one place or of all places, in the order of the chain.

    ``place``: one of ``PLACES``.

    Examples
    --------
    >>> from whsklearn.effects import effect_names
    >>> effect_names("transmission")
    ('backlash', 'flexible_coupling')
    """
    ordered = sorted(_REGISTRY, key=lambda n: PLACES.index(_REGISTRY[n].place))
    return tuple(n for n in ordered if place is None or _REGISTRY[n].place == place)
