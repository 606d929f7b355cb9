"""A servo axis as code that replays a drive: the integrator and the effects' equations, specialised to its numbers."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from whsklearn.effects import Effect, codes
from whsklearn.effects.equations import quantized, smooth_sign
from whsklearn.export.languages import Language, OneOf, StateArray, Symbol
from whsklearn.export.specialise import Specialiser
from whsklearn.systems._servo_kernel import (
    Body,
    DriveStage,
    Ends,
    arranged,
    body_of,
    chain_of,
    effective,
    fine_step,
    lattice_of,
    load_sum,
    motor_sum,
    read,
)
from whsklearn.systems.servo import ServoAxis, pack

STATES = ("position", "velocity", "load_position", "load_velocity")
WAVE = 3  # numbers stored per wave: the argument, its cosine and its sine


@dataclass
class Fragment:
    """Statements, the kinds of their variables, the expression of the result, and lengths of what is kept by name.

    >>> Fragment(["x = 2.0 * t;"], {"x": "real"}, "x + 1.0").timed
    True
    """

    lines: list[str]
    variables: dict[str, str]
    result: str = ""
    states: dict[str, int] = field(default_factory=dict)

    @property
    def timed(self) -> bool:
        """Whether the time ``t`` is in it."""
        return any(re.search(r"\bt\b", line) for line in [*self.lines, self.result])


class AxisCode(NamedTuple):
    """What a template shows of an axis.

    >>> from whsklearn import ServoAxis
    >>> from whsklearn.export.languages import C
    >>> code = axis_code(ServoAxis(0.05, law="viscous", sample_rate=500.0), C())
    >>> code.dt, code.substeps, code.history, code.states
    (0.002, 20, 1, {'position': 0, 'velocity': 0})
    """

    reading: Fragment  # the measured position
    substep: Fragment  # one fine step under the drive ``u`` at the time ``t``
    states: dict[str, int]
    dt: float
    substeps: int
    history: int  # past samples that act
    # for each fine step, the two samples that act (0 is the newest), and the share of the older one
    older: list[int]
    newer: list[int]
    share: list[float]


class Law(NamedTuple):
    """Effects of an axis in the form that its integrator takes.

    >>> from whsklearn.effects import Cogging
    >>> plant = pack(ServoAxis(law="viscous,coulomb", effects=[Cogging(0.05, 12.0)]))
    >>> law = arranged_law(plant.codes, plant.p, [])
    >>> law.effects.tolist(), law.ends.plain  # their codes; how many are functions of the state alone
    ([0, 1, 104], 3)
    """

    effects: Any
    p: Any
    own: Any
    ends: Ends


def _driven(law, z, state, body, chain, lags, held, t, h):  # type: ignore[no-untyped-def]
    """From the held drive to the torque, and one fine step under it."""
    u, first, second = effective(chain, held, lags[0], lags[1], h)
    if chain.lag > 0.0:
        lags[0] = first
    if chain.second_lag > 0.0:
        lags[1] = second
    before = (state[0], state[1], state[2], state[3])
    x, v, q, w = fine_step(law.effects, law.p, law.own, law.ends, z, body, before, u, t, h)
    state[0] = x
    state[1] = v
    state[2] = q
    state[3] = w


def _read(law, position, t, lattice):  # type: ignore[no-untyped-def]
    """The encoder's reading without its noise."""
    return quantized(lattice, read(law.effects, law.p, law.own, law.ends, t, position))


def axis_code(
    axis: ServoAxis, language: Language, *, velocity: bool = False, remember: bool = False, out: float = 1.0
) -> AxisCode:
    """Specialise the integrator to one axis.

    ``velocity``: whether to return the velocity instead of the encoder's reading.
    ``remember``: whether to compute sines and cosines of the motion from the previous ones, stored in ``wave``.
    ``out``: factor from the unit of the result to SI.
    """
    plant = pack(axis)
    law = arranged_law(plant.codes, plant.p, axis.effects)
    body, chain = Body(*map(float, body_of(plant))), DriveStage(*map(float, chain_of(plant)))
    two = body.share > 0.0
    lattice = float(lattice_of(plant)[0])
    dt = 1.0 / axis.sample_rate
    h = dt / axis.substeps
    memory: dict[tuple[int, int], int] = {}
    state = language.state

    def mechanical(i: int) -> str:
        return state(STATES[i]) if two or i < 2 else ""

    def hysteresis(i: int, k: int) -> str:
        return state("memory", memory.setdefault((i, k), len(memory)))

    def wave(name: str, i: int, argument: str) -> str:
        return f"near_{name}(&{state('wave', WAVE * i)}, {argument})"  # of ``model.c.j2``

    work = Specialiser(language, wave=wave if remember else None)
    work.call(
        _driven, law, StateArray(hysteresis), StateArray(mechanical), body, chain,
        StateArray(lambda i: state("lag", i)), Symbol("u"), Symbol("t"), h,
    )  # fmt: skip
    seeing = Specialiser(language, "r_")
    seen = state(STATES[2 if two and axis.sensor.side == "load" else 0])
    y = Symbol(state("velocity")) if velocity else seeing.call(_read, law, Symbol(seen), Symbol("t"), lattice)
    y = seeing.binary("Mult", y, 1.0 / out)
    older, newer, share = _holds(chain.delay / h, axis.substeps)
    states = dict.fromkeys(STATES[: 4 if two else 2], 0)
    if memory:
        states["memory"] = len(memory)
    if chain.lag > 0.0 or chain.second_lag > 0.0:
        states["lag"] = 2
    if work.waves:
        states["wave"] = WAVE * len(work.waves)
    reading, substep = Fragment(*seeing.finish(y), seeing.text(y)), Fragment(*work.finish())
    return AxisCode(reading, substep, states, dt, axis.substeps, max(older) + 1, older, newer, share)


def arranged_law(rows: Any, p: Any, effects: Iterable[Effect]) -> Law:
    """Rows in the integrator's order, the end of each kind, and user-defined effects as `plant_of` numbers them."""
    rows, p, ends = arranged(rows, p)
    classes = dict.fromkeys(type(e) for e in effects if e.evaluate is not None and e.magnitude != e.neutral)
    own = OneOf(tuple(c.evaluate for c in classes if c.evaluate is not None))
    return Law(rows, p, own, Ends(*map(int, ends)))


def _holds(delay: float, substeps: int) -> tuple[list[int], list[int], list[float]]:
    """The samples that act in each fine step under a delay in fine steps, as in the simulator."""
    older, newer, share = [], [], []
    for j in range(substeps):
        start = (j - delay) / substeps
        i, k = math.floor(start + 1e-9), math.floor(start + 1.0 / substeps - 1e-9)
        older.append(-i)
        newer.append(-k)
        share.append(1.0 if i == k else (k - start) * substeps)
    return older, newer, share


def torque_code(
    axis: ServoAxis, language: Language, drive: float = 1.0, rate: float = 1.0, far: float = 1.0
) -> Fragment:
    """The torque of friction and of position-dependent effects, as a function of ``position`` and ``velocity``.

    ``drive``, ``rate`` and ``far`` convert drive, velocity and position to SI.
    """
    plant = pack(axis)
    keep = [i for i, code in enumerate(plant.codes) if compensated(int(code))]
    law = arranged_law(plant.codes[keep], plant.p[keep], axis.effects)
    work = Specialiser(language)
    kappa = 1.0 / axis.smoothing if axis.friction == "tanh" else math.inf
    motion = (work.binary("Mult", by, Symbol(name)) for by, name in ((far, "position"), (rate, "velocity")))
    result = work.binary("Mult", work.call(static_torque, law, *motion, kappa, 0.0), 1.0 / drive)
    return Fragment(*work.finish(result), work.text(result))


def static_torque(law, position, velocity, kappa, drive):  # type: ignore[no-untyped-def]
    """Torque of the effects of a law at one instant; sign(velocity) has the sharpness kappa."""
    s, ds = smooth_sign(velocity, kappa)
    torque, _slope = motor_sum(law.effects, law.p, law.own, law.ends, 0, 0.0, position, velocity, s, ds, drive)
    return torque + load_sum(law.effects, law.p, law.ends, 0.0, position, velocity)


def compensated(code: int) -> bool:
    """Whether an effect is a function of position and velocity alone."""
    timed = (codes.DISTURBANCE_TONE, codes.FRICTION_DRIFT)
    driven = (codes.LOAD_FRICTION, codes.TORQUE_RIPPLE, codes.LEARNED_DRIVE)
    memory = codes.DAHL <= code <= codes.BOUC_WEN
    return not memory and code not in (*timed, *driven) and not codes.CHANGE_INERTIA <= code <= codes.CHANGE_GAIN
