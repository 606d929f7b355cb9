"""What may be missing between u and y: the catalogue's effects as the compiled chain takes them.

A candidate is a code, a few numbers and what is known of each: how many leading ones the output is
linear in, which are found by a scan, their ranges and where a search starts, in the units of the log.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from whsklearn.effects import ChainResonance, ChainTone, effect_names, get_effect
from whsklearn.effects import codes as k
from whsklearn.effects import terms as s
from whsklearn.effects.codes import DEAD_ZONE_X, SATURATION_X, TONE_U
from whsklearn.effects.scales import Scales as EffectScales
from whsklearn.gap.plants import chain_evidence as rules


@dataclass(frozen=True)
class Scales:
    """Sizes of the signals of the fitted base model, from which starts and ranges follow."""

    u: float  # rms
    u_peak: float
    x: float
    x_peak: float
    dx: float
    v: float
    y: float
    n: int
    dt: float

    @property
    def seconds(self) -> float:
        """Length of the record."""
        return self.n * self.dt


Array = NDArray[np.float64]
Numbers = tuple[float, ...]
Range = tuple[float, float]


@dataclass(frozen=True)
class FoundEffect:
    """An effect of a u-y record: catalogue name, place, equation and numbers in the units of the log."""

    name: str
    place: str
    equation: str
    parameters: dict[str, float]

    def labelled(self) -> dict[str, float]:
        """The numbers by name; a u-y record has no units of its own."""
        return dict(self.parameters)


BETWEEN = "between the blocks"
AT_INPUT = "at the input"
# what the catalogue's equations are in a chain, where they are others
EQUATIONS = {
    "flexible_coupling": "a resonance of gain one between L1 and the law, natural frequency f, damping zeta",
    "backlash": "x_l = play of x, gap b",
}


@dataclass(frozen=True)
class Candidate:
    """One effect in one variant.

    Attributes
    ----------
    name, code : str, int
        Canonical name and what the compiled chain calls it.
    fields : tuple of str
        What the numbers are; waves have ``cosine`` and ``sine`` first.
    linear : int
        How many leading numbers the output is linear in for a fixed rest: 1, 2, or 0 where the size
        itself is a shape (a threshold, a delay).
    shapes : callable
        Scales -> list of tuples of the other numbers, where a search starts.
    ranges : callable
        Scales -> one (low, high) for each of them, spanned in ratios where low > 0.
    unit : callable
        Scales -> a small size for the derivative by the linear numbers.
    free : tuple of bool
        Whether each of them is fitted after the scan; all by default.
    scanned : int
        Independent places that the scan looks at, a factor on the odds; 1 if none.
    positive : bool
        Whether a physical size is positive.
    options : dict
        Text fields.
    own : type, optional
        The class of an effect of one's own.
    """

    name: str
    code: int
    fields: tuple[str, ...]
    linear: int = 1
    shapes: Callable[[Scales], list[Numbers]] = lambda _: [()]
    ranges: Callable[[Scales], list[Range]] = lambda _: []
    unit: Callable[[Scales], float] = lambda z: 1e-3 * z.v
    free: tuple[bool, ...] = ()
    scanned: int = 1
    positive: bool = False
    options: dict[str, str] = field(default_factory=dict)
    variant: str = ""
    own: type | None = None

    @property
    def label(self) -> str:
        """Name with the variant."""
        extra = self.variant or ",".join(self.options.values())
        return f"{self.name}[{extra}]" if extra else self.name

    @property
    def n_numbers(self) -> int:
        """How many numbers the compiled chain takes."""
        return len(self.fields)

    @property
    def n_estimated(self) -> int:
        """Numbers the data must give: those of the joint fit and those of a scan."""
        return sum(self.is_free(i) or self.scanned > 1 for i in range(self.n_numbers))

    def is_free(self, i: int) -> bool:
        """Whether number i takes part in the joint fit."""
        j = i - self.linear
        return j < 0 or not self.free or self.free[j]

    def named(self, q: Iterable[float]) -> dict[str, Any]:
        """Numbers by the names of the catalogue; a wave by its amplitude and phase."""
        rest = [(f, float(v)) for f, v in zip(self.fields, q, strict=False)]
        out: dict[str, Any] = {}
        if self.linear == 2:
            (_, cosine), (_, sine), *rest = rest
            size = "torque" if self.name == "position_friction" else "amplitude"
            out = {size: math.hypot(cosine, sine), "phase": math.atan2(-sine, cosine)}
        out.update(rest)
        if self.name == "sensor_rectification":
            out["fraction"] = min(out["fraction"], 1.0)
        return out | self.options

    def effect(self, q: Iterable[float]) -> FoundEffect:
        """What a report says of the effect with these numbers."""
        cls: Any = get_effect(self.name)
        equation = EQUATIONS.get(self.name, str(cls.equation))
        if self.variant == BETWEEN:
            return FoundEffect(self.name, "law", equation.replace("u", "x"), self.named(q))
        return FoundEffect(self.name, cls.place, equation, self.named(q))

    def of_library(self, q: Iterable[float]) -> Any:
        """The library's effect with these numbers; None for what bends a line in x, which is a law of its own."""
        if self.name == "flexible_coupling":
            return ChainResonance(**self.named(q))
        if self.variant == AT_INPUT:
            return ChainTone(**self.named(q), at="input")
        if self.variant == BETWEEN:
            return None
        cls: Any = get_effect(self.name)
        return cls(**{k: v for k, v in self.named(q).items() if k in cls.__dataclass_fields__})


Signal = tuple[float, str]  # a factor and one of the `Scales`


def _grid(*axes: Iterable[float]) -> list[Numbers]:
    return [tuple(map(float, p)) for p in itertools.product(*axes)]


def _starts(signal: str, grid: Array, *fixed: float) -> Callable[[Scales], list[Numbers]]:
    """Starts at shares of a signal's size, further numbers fixed."""
    return lambda z: _grid(getattr(z, signal) * grid, *([f] for f in fixed))


def _range(low: Signal, high: Signal) -> Callable[[Scales], list[Range]]:
    """One range between two shares of signals."""
    return lambda z: [(low[0] * getattr(z, low[1]), high[0] * getattr(z, high[1]))]


def _by_size(
    name: str, code: int, quantity: str, starts: tuple[str, Array], low: Signal, high: Signal, variant: str = ""
) -> Candidate:
    """An effect whose size is a shape: what it does turns single signs."""
    shapes, ranges = _starts(*starts), _range(low, high)
    return Candidate(
        name, code, (quantity,), linear=0, positive=True, shapes=shapes, ranges=ranges, variant=variant
    )  # fmt: skip


def _wave(name: str, code: int, signal: str = "x", unit: Callable[[Scales], float] = lambda z: 1e-3 * z.v) -> Candidate:
    """A cosine and a sine of an order of x, or of the output, whose readings show fewer."""
    most, highest = (12.0, 20.0) if signal == "x" else (8.0, 15.0)

    def scale(z: Scales) -> float:
        return max(float(getattr(z, signal)), 1e-300)

    return Candidate(
        name, code, ("cosine", "sine", "order"), linear=2, unit=unit, scanned=rules.PLACES["position"],
        shapes=lambda z: _grid(np.arange(0.4, most, 0.45) / scale(z)),
        ranges=lambda z: [(0.25 / scale(z), highest / scale(z))],
    )  # fmt: skip


def _spring(name: str, code: int, power: int) -> Candidate:
    """A spring, whose place of rest is not looked for: another one is an offset more."""
    return Candidate(
        name, code, ("stiffness", "centre"), shapes=lambda _: [(0.0,)], free=(False,),
        ranges=lambda z: [(-z.x_peak, z.x_peak)], unit=lambda z: 1e-3 * z.v / z.x**power,
    )  # fmt: skip


# where sizes that are shapes begin: of rms or peak of the signal that they act on
WIDTHS = np.array([0.02, 0.05, 0.1, 0.2, 0.4, 0.8])
LIMITS = np.array([0.95, 0.87, 0.78, 0.66, 0.52, 0.35])
SPEEDS = np.array([0.05, 0.1, 0.2, 0.4, 0.8, 1.5])
DISTANCES = np.array([0.05, 0.1, 0.2, 0.4, 0.8, 1.6, 3.2, 6.4])
ENDS = np.array([0.9, 0.8, 0.7, 0.6, 0.5, 0.35, 0.2])
# of the record's length, of a sample; and of the sampling rate
SPANS = np.array([0.05, 0.15, 0.4, 1.0, 3.0])
DELAYS, LAGS = np.array([0.1, 0.4, 1.0, 2.0, 4.0]), np.array([0.2, 0.45, 1.0, 3.0])
RESONANCES = np.array([0.04, 0.09, 0.16, 0.25, 0.38])

CATALOGUE: tuple[Candidate, ...] = (
    Candidate("viscous", s.VISCOUS, ("coefficient",)),
    Candidate("coulomb", s.COULOMB, ("torque",)),
    Candidate("asymmetric_coulomb", s.ASYMMETRIC_COULOMB, ("torque",)),
    Candidate("asymmetric_viscous", s.ASYMMETRIC_VISCOUS, ("coefficient",)),
    *(
        Candidate(
            "stribeck", s.STRIBECK_EXP, ("torque", "velocity", "exponent"), variant=variant, free=(True, False),
            shapes=_starts("dx", SPEEDS, exponent), ranges=lambda z: [(0.01 * z.dx, 2.0 * z.dx), (0.5, 2.5)],
        )
        for exponent, variant in ((2.0, ""), (1.0, "exponent 1"))
    ),
    Candidate("quadratic_drag", s.QUADRATIC_DRAG, ("coefficient",), unit=lambda z: 1e-3 * z.v / z.dx**2),
    Candidate("load_friction", k.LOAD_FRICTION, ("coefficient",), unit=lambda z: 1e-3 * z.v / z.u),
    _wave("position_friction", s.POSITION_FRICTION),
    Candidate(
        "presliding_hysteresis", k.DAHL, ("torque", "distance"),
        shapes=_starts("dx", DISTANCES), ranges=_range((0.02, "dx"), (20.0, "dx")),
    ),
    Candidate(
        "friction_drift", k.FRICTION_DRIFT, ("torque", "time_constant"),
        shapes=_starts("seconds", SPANS), ranges=_range((0.02, "seconds"), (10.0, "seconds")),
    ),
    Candidate("input_offset", k.INPUT_OFFSET, ("torque",), unit=lambda z: 1e-3 * z.u),
    _by_size("dead_zone", k.DEAD_ZONE, "width", ("u", WIDTHS), (1e-3, "u"), (0.95, "u_peak")),
    _by_size("saturation", k.SATURATION, "limit", ("u_peak", LIMITS), (0.1, "u_peak"), (0.999, "u_peak")),
    _by_size("input_delay", k.INPUT_DELAY, "delay", ("dt", DELAYS), (1e-3, "dt"), (50.0, "dt")),
    _by_size("actuator_lag", k.ACTUATOR_LAG, "time_constant", ("dt", LAGS), (0.05, "dt"), (200.0, "dt")),
    _wave("torque_ripple", k.TORQUE_RIPPLE, unit=lambda _: 1e-3),
    _by_size("backlash", k.BACKLASH, "gap", ("x", WIDTHS), (1e-3, "x"), (1.5, "x_peak")),
    Candidate(
        "flexible_coupling", k.FLEXIBLE_COUPLING, ("frequency", "damping_ratio"), linear=0, positive=True,
        shapes=lambda z: _grid(RESONANCES / z.dt, [0.1]),
        ranges=lambda z: [(0.005 / z.dt, 0.49 / z.dt), (0.002, 0.95)],
    ),
    _wave("cogging", k.COGGING),
    Candidate("gravity_imbalance", k.GRAVITY_IMBALANCE, ("cosine", "sine"), linear=2),
    _spring("cable_spring", k.CABLE_SPRING, 1),
    _spring("hardening_spring", k.HARDENING_SPRING, 3),
    Candidate(
        "end_stop", k.END_STOP, ("stiffness", "angle"), positive=True, unit=lambda z: 1e-3 * z.v / z.x,
        shapes=_starts("x_peak", ENDS), ranges=_range((0.05, "x_peak"), (0.98, "x_peak")),
    ),
    Candidate("output_offset", k.OUTPUT_OFFSET, ("offset",), unit=lambda z: 1e-3 * z.y),
    Candidate("output_drift", k.OUTPUT_DRIFT, ("rate",), unit=lambda z: 1e-3 * z.y / z.seconds),
    Candidate(
        "sensor_rectification", k.SENSOR_RECTIFICATION, ("fraction",), linear=0, positive=True,
        shapes=lambda _: _grid([0.03, 0.15, 0.35, 0.8]), ranges=lambda _: [(1e-3, 1.0)],
    ),
    _wave("encoder_eccentricity", k.ENCODER_ECCENTRICITY, "y", lambda z: 1e-4 * z.y),
    *(
        Candidate(
            "disturbance_tone", code, ("cosine", "sine", "frequency"), linear=2, variant=variant, unit=unit,
            ranges=lambda z: [(0.5 / z.seconds, 0.5 / z.dt)], scanned=rules.PLACES["time"],
        )
        for code, variant, unit in (
            (k.DISTURBANCE_TONE, "", lambda z: 1e-3 * z.v),
            (TONE_U, AT_INPUT, lambda z: 1e-3 * z.u),
        )
    ),
    *(
        Candidate(
            "parameter_change", code, ("change", "time"), free=(False,), scanned=rules.PLACES["step"], unit=unit,
            shapes=lambda z: _grid(np.linspace(0.08, 0.92, 43) * z.seconds),
            ranges=_range((0.02, "seconds"), (0.98, "seconds")), options={"parameter": parameter},
        )
        for parameter, code, unit in (
            ("inertia", k.CHANGE_INERTIA, lambda z: 1e-3 * z.v / z.dx),
            ("viscous", k.CHANGE_VISCOUS, lambda z: 1e-3 * z.v / z.dx),
            ("coulomb", k.CHANGE_COULOMB, lambda z: 1e-3 * z.v),
            ("gain", k.CHANGE_GAIN, lambda _: 1e-3),
        )
    ),
)  # fmt: skip


# where the law is a line in x, what bends it has the names that it has before L1
BENDS: tuple[Candidate, ...] = (
    _by_size("saturation", SATURATION_X, "limit", ("x_peak", LIMITS), (0.1, "x_peak"), (0.999, "x_peak"), BETWEEN),
    _by_size("dead_zone", DEAD_ZONE_X, "width", ("x", WIDTHS), (1e-3, "x"), (0.95, "x_peak"), BETWEEN),
)


def catalogue_for(law_codes: Iterable[int], *, bends: bool = False) -> list[Candidate]:
    """All candidates but those that the law already holds; effects of one's own are among them.

    ``bends``: also those of x, for a law that is a line in it.
    """
    held = {int(c) for c in law_codes}
    known = [c for c in CATALOGUE if not (c.code in (s.VISCOUS, s.COULOMB, s.QUADRATIC_DRAG) and c.code in held)]
    return known + own_candidates() + (list(BENDS) if bends else [])


def own_candidates() -> list[Candidate]:
    """Every effect that a user has written, with ranges and starts from its own quantities."""
    classes: list[Any] = [get_effect(name) for name in effect_names()]
    return [_own_candidate(cls) for cls in classes if cls.evaluate is not None]


def _own_candidate(cls: Any) -> Candidate:
    def unit(z: Scales) -> float:
        return 1e-3 * (z.y if cls.port == "output" else z.v)

    scan = cls.quantities[cls.scanned()].scan if cls.scanned() else ""
    return Candidate(
        cls.name, cls.code, (cls.size, *cls.searched()), own=cls, unit=unit,
        shapes=lambda z: cls.starts(as_effects_see(z)), ranges=lambda z: cls.bounds(as_effects_see(z)),
        positive=cls.quantities[cls.size].positive, free=tuple(f not in cls.held for f in cls.searched()),
        scanned=rules.PLACES[scan],
    )  # fmt: skip


def own_attribute(name: str, attribute: str) -> tuple[str, ...]:
    """What an effect of one's own says of other names; nothing for the library's, which say it of an axis."""
    cls: Any = get_effect(name)
    return tuple(getattr(cls, attribute)) if cls.evaluate is not None else ()


def as_effects_see(z: Scales) -> EffectScales:
    """The scales of a chain by the names of an axis: x is its position, x(t) - x(t-1) its velocity, v its torque."""
    return EffectScales(
        torque=z.v, peak=3.0 * z.v, speed=z.dx, reach=z.x_peak, duration=z.seconds, dt=z.dt,
        resonance=0.25 / z.dt,
    )  # fmt: skip
