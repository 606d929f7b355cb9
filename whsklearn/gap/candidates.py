"""What may be missing: the catalogue's effects as the compiled pass takes them, with starts and bounds.

A candidate is a code of `whsklearn.effects.codes`, its row of numbers and what is known of each:
whether the torque is linear in it, whether it spans ratios, its range and where a search starts.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from whsklearn.effects import codes as k


@dataclass(frozen=True)
class Scene:
    """The scales of one record, from which starts and bounds follow."""

    torque: float  # rms drive
    inertia: float
    speed: float  # rms velocity
    reach: float  # half the travel
    middle: float  # middle of the travel
    seconds: float
    dt: float
    load: float  # largest drive
    resonance: float  # highest frequency that the steps can carry


Range = tuple[float, float]


@dataclass(frozen=True)
class Candidate:
    """One effect in one variant.

    Attributes
    ----------
    name : str
        Canonical name in the catalogue.
    code : int
        What the compiled pass calls it.
    fields : tuple of str
        The catalogue's fields of the slots in use, linear ones first.
    linear : int
        How many leading slots the torque is linear in: 1, 2 (cosine and sine), or 0.
    ranged : callable
        Scene -> one (low, high) a shape slot; shape slots span ratios if low > 0.
    starts : callable
        Scene -> list of tuples of shape numbers to start from.
    scanned : str
        ``order``, ``frequency`` or ``time`` if the first shape number is found by a scan.
    positive : bool
        Whether a physical size is positive.
    """

    name: str
    code: int
    fields: tuple[str, ...]
    linear: int = 1
    ranged: Callable[[Scene], list[Range]] = lambda s: []
    starts: Callable[[Scene], list[tuple[float, ...]]] = lambda s: [()]
    scanned: str = ""
    positive: bool = False
    options: dict[str, str] = field(default_factory=dict)
    substeps: int = 1
    on_load: bool = False  # whether the encoder sits behind the transmission
    held: tuple[int, ...] = ()  # shape slots that keep their start
    elementary: bool = False  # so common that it goes first where several effects are missing

    @property
    def n_slots(self) -> int:
        """Numbers in use."""
        return len(self.fields)

    @property
    def paired(self) -> bool:
        """Whether the size is a cosine and a sine."""
        return self.linear == 2

    @property
    def label(self) -> str:
        """Name with the variant, for internal use."""
        extra = "".join(f"[{v}]" for v in self.options.values())
        return f"{self.name}{extra}#{self.code}{'L' if self.on_load else ''}"

    def effect(self, q: NDArray[np.float64]) -> Any:
        """The catalogue's effect with these numbers."""
        from whsklearn.effects import get_effect

        cls = get_effect(self.name)
        shape = {f: float(v) for f, v in zip(self.fields[self.linear :], q[self.linear : self.n_slots], strict=True)}
        if self.paired:
            return cls.from_coefficients([float(q[0]), float(q[1])], **shape)  # type: ignore[attr-defined]
        size = {f: float(v) for f, v in zip(self.fields[: self.linear], q, strict=False)}
        return cls(**size, **shape, **self.options)


def _geometric(low: float, high: float, n: int) -> list[tuple[float, ...]]:
    return [(float(x),) for x in np.geomspace(low, high, n)]


def _two_mass_starts(s: Scene) -> list[tuple[float, ...]]:
    """Compliance, load share, damping ratio for resonances of 8 to 60 Hz."""
    out: list[tuple[float, ...]] = []
    for hz in (7.0, 12.0, 20.0, 35.0, 60.0):
        if hz < s.resonance:
            share = 0.45
            out.append((1.0 / (s.inertia * share * (1 - share) * (2 * np.pi * hz) ** 2), share, 0.06))
    return out


def change_times(s: Scene) -> Range:
    """Where a change can be seen: with some record on either side of it."""
    return max(0.05 * s.seconds, 1.5), min(0.95 * s.seconds, s.seconds - 1.0)


def _gap_starts(s: Scene) -> list[tuple[float, ...]]:
    return [(gap, 0.45, min(60.0, 0.6 * s.resonance), 0.15) for gap in (0.0015, 0.005, 0.015, 0.05)]


_ORDER: Callable[[Scene], list[Range]] = lambda s: [(0.8 * max(1.0, 1.0 / s.reach), 4000.0)]  # noqa: E731
_FLEX: Callable[[Scene], list[Range]] = lambda s: [  # noqa: E731
    (1e-4 / s.inertia / 1e3, 1.0 / s.inertia),
    (0.05, 0.95),
    (0.003, 1.0),
]

CATALOGUE: tuple[Candidate, ...] = (
    Candidate("viscous", k.VISCOUS, ("coefficient",), positive=True, elementary=True),
    Candidate("coulomb", k.COULOMB, ("torque",), positive=True, elementary=True),
    Candidate("asymmetric_coulomb", k.ASYMMETRIC_COULOMB, ("torque",)),
    Candidate("asymmetric_viscous", k.ASYMMETRIC_VISCOUS, ("coefficient",)),
    Candidate(
        "stribeck",
        k.STRIBECK_EXP,
        ("torque", "velocity", "exponent"),
        ranged=lambda s: [(0.004 * s.speed, 0.5 * s.speed), (0.5, 2.6)],  # any wider is curvature at speed
        starts=lambda s: [(f * s.speed, d) for f in (0.01, 0.03, 0.08, 0.2, 0.4) for d in (1.0, 2.0)],
        positive=True,
    ),
    Candidate("quadratic_drag", k.QUADRATIC_DRAG, ("coefficient",), positive=True),
    Candidate("load_friction", k.LOAD_FRICTION, ("coefficient",), positive=True),
    Candidate(
        "position_friction",
        k.POSITION_FRICTION,
        ("cos", "sin", "order"),
        linear=2,
        ranged=_ORDER,
        scanned="order",
    ),
    Candidate(
        "presliding_hysteresis",
        k.DAHL,
        ("torque", "distance"),
        ranged=lambda s: [(2e-4 * s.reach, 0.5 * s.reach)],
        starts=lambda s: _geometric(5e-4 * s.reach, 0.1 * s.reach, 8),
        positive=True,
    ),
    Candidate(
        "friction_drift",
        k.FRICTION_DRIFT,
        ("torque", "time_constant"),
        ranged=lambda s: [(0.03 * s.seconds, 30 * s.seconds)],
        starts=lambda s: _geometric(0.1 * s.seconds, 5 * s.seconds, 5),
    ),
    Candidate("input_offset", k.INPUT_OFFSET, ("torque",), elementary=True),
    Candidate(
        "dead_zone",
        k.DEAD_ZONE,
        ("width",),
        linear=0,
        ranged=lambda s: [(1e-4 * s.torque, 2 * s.torque)],
        starts=lambda s: _geometric(0.01 * s.torque, 0.6 * s.torque, 5),
        positive=True,
    ),
    Candidate(
        "saturation",
        k.SATURATION,
        ("limit",),
        linear=0,
        ranged=lambda s: [(0.1 * s.torque, 1.1 * s.load)],
        starts=lambda s: [(f * s.load,) for f in (0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9)],
        positive=True,
    ),
    Candidate(
        "input_delay",
        k.INPUT_DELAY,
        ("delay",),
        linear=0,
        ranged=lambda s: [(1e-2 * s.dt, 0.3)],
        starts=lambda s: [(1.5 * s.dt,), (4 * s.dt,), (0.02,), (0.05,)],
        positive=True,
    ),
    Candidate(
        "actuator_lag",
        k.ACTUATOR_LAG,
        ("time_constant",),
        linear=0,
        ranged=lambda s: [(1e-2 * s.dt, 0.5)],
        starts=lambda s: [(1.5 * s.dt,), (4 * s.dt,), (0.02,), (0.05,)],
        positive=True,
    ),
    Candidate("torque_ripple", k.TORQUE_RIPPLE, ("cos", "sin", "order"), linear=2, ranged=_ORDER, scanned="order"),
    Candidate(
        "backlash",
        k.BACKLASH,
        ("gap", "load_share", "frequency", "damping_ratio"),
        linear=0,
        ranged=lambda s: [(1e-5, 0.5), (0.05, 0.95), (8.0, s.resonance), (0.01, 1.5)],
        starts=_gap_starts,
        substeps=16,
        positive=True,
    ),
    Candidate(
        "backlash",
        k.BACKLASH,
        ("gap", "load_share", "frequency", "damping_ratio"),
        on_load=True,
        linear=0,
        ranged=lambda s: [(1e-5, 0.5), (0.05, 0.95), (8.0, s.resonance), (0.01, 1.5)],
        starts=_gap_starts,
        substeps=16,
        positive=True,
    ),
    Candidate(
        "flexible_coupling",
        k.FLEXIBLE_COUPLING,
        ("compliance", "load_share", "damping_ratio"),
        linear=0,
        ranged=_FLEX,
        starts=_two_mass_starts,
        substeps=6,
        positive=True,
    ),
    Candidate(
        "flexible_coupling",
        k.FLEXIBLE_COUPLING,
        ("compliance", "load_share", "damping_ratio"),
        on_load=True,
        linear=0,
        ranged=_FLEX,
        starts=_two_mass_starts,
        substeps=6,
        positive=True,
    ),
    Candidate(
        "cogging",
        k.COGGING,
        ("cos", "sin", "order"),
        linear=2,
        ranged=lambda s: [(1.4 * max(1.0, 0.8 / s.reach), 4000.0)],  # one period a turn is imbalance
        scanned="order",
    ),
    Candidate("gravity_imbalance", k.GRAVITY_IMBALANCE, ("cos", "sin"), linear=2),
    Candidate(
        "cable_spring",
        k.CABLE_SPRING,
        ("stiffness", "centre"),
        ranged=lambda s: [(-(abs(s.middle) + 3 * s.reach), abs(s.middle) + 3 * s.reach)],
        starts=lambda s: [(s.middle,)],
        positive=True,
    ),
    Candidate(
        "hardening_spring",
        k.HARDENING_SPRING,
        ("stiffness", "centre"),
        ranged=lambda s: [(-(abs(s.middle) + s.reach), abs(s.middle) + s.reach)],
        starts=lambda s: [(0.0,)],
        positive=True,
        held=(0,),
    ),
    Candidate(
        "end_stop",
        k.END_STOP,
        ("stiffness", "angle"),
        ranged=lambda s: [(0.2 * s.reach, abs(s.middle) + s.reach)],
        starts=lambda s: [(f * (abs(s.middle) + s.reach),) for f in (0.5, 0.65, 0.75, 0.83, 0.9, 0.95)],
        positive=True,
    ),
    Candidate(
        "sensor_rectification",
        k.SENSOR_RECTIFICATION,
        ("fraction",),
        linear=0,
        ranged=lambda s: [(0.9, 1.0)],
        starts=lambda s: [(1.0,)],
        held=(0,),
        positive=True,
    ),
    Candidate(
        "encoder_eccentricity",
        k.ENCODER_ECCENTRICITY,
        ("cos", "sin", "order"),
        linear=2,
        ranged=_ORDER,
        starts=lambda s: [(1.0,), (2.0,), (3.0,), (4.0,)],
    ),
    Candidate(
        "disturbance_tone",
        k.DISTURBANCE_TONE,
        ("cos", "sin", "frequency"),
        linear=2,
        ranged=lambda s: [(max(0.02, 3.0 / s.seconds), 200.0)],
        scanned="frequency",
    ),
    *(
        Candidate(
            "parameter_change",
            code,
            ("change", "time"),
            ranged=lambda s: [change_times(s)],
            scanned="time",
            options={"parameter": which},
        )
        for code, which in (
            (k.CHANGE_INERTIA, "inertia"),
            (k.CHANGE_VISCOUS, "viscous"),
            (k.CHANGE_COULOMB, "coulomb"),
            (k.CHANGE_GAIN, "gain"),
        )
    ),
)

ALIASES: dict[str, tuple[str, ...]] = {
    "input_offset": ("asymmetric_coulomb",),
    "asymmetric_coulomb": ("input_offset",),
}

COMMONER: dict[str, tuple[str, ...]] = {  # preferred where both explain a record about as well
    "asymmetric_coulomb": ("input_offset",),
    "cable_spring": ("gravity_imbalance",),
    "hardening_spring": ("gravity_imbalance",),
    "cogging": ("gravity_imbalance",),
}

BY_NAME: dict[str, Candidate] = {}
for _c in CATALOGUE:
    BY_NAME.setdefault(_c.name, _c)


def candidate(name: str) -> Candidate:
    """The first candidate of a canonical name.

    Raises
    ------
    ValueError
        If the compiled pass does not know the effect.
    """
    if name not in BY_NAME:
        raise ValueError(f"{name!r} cannot stand in the law of an axis; expected one of {', '.join(sorted(BY_NAME))}.")
    return BY_NAME[name]
