"""Tables for drives: cogging torque over a turn, friction torque over speed, and the error that remains.

Sources: TF5200 friction compensation, Beckhoff Infosys, P-COMP-00041 to 00047 (at most 20 speeds in 0.001 degree/s
or um/s, ascending; values in the drive's own unit, for CANopen and SERCOS drives 0.1 % of the rated torque).
ServoOne (LTI, now KEBA) and Moog MSD, Device Help: P 380 CON_TCoggAddTab, 250 currents in A over a turn, entry = angle
/ turn * 250; P 386 CON_SCON_TFric, steps in % of the rated torque, at the speeds of P 387 CON_SCON_TFricSpeed in rpm.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np

from whsklearn.effects import Effect
from whsklearn.effects.base import ArgumentError, Array, rms
from whsklearn.export.axis_code import compensated
from whsklearn.export.model import ROUNDED, Exported, Loss, losses_of, of_a_whole_order, parts_of, rigid
from whsklearn.logs.current import AMPERES
from whsklearn.logs.files import atomic_write
from whsklearn.systems.servo import ServoAxis

Torque = Callable[[Array], Array]
ENTRIES = 3600  # entries of cogging.csv: one per tenth of a degree
_FINE = 36_000  # angles of a turn at which the replay compares table and model
_USUAL = 10.0  # rad/s or m/s
_KEBA_ENTRIES = 250
_TF5200_ENTRIES = 20
_RPM = math.pi / 30
_MILLIDEGREE = math.radians(1e-3)


class Ratings(NamedTuple):
    """Ratings that convert torques to a drive's units; tables that need a value of None are left out.

    Attributes
    ----------
    torque : float or None
        Rated torque of the motor (Nm or N).
    constant : float or None
        Nm (or N) per ampere.
    speed : float or None
        Highest speed of the friction tables, in the unit of the model's motion per second; None for 10 rad/s or m/s.

    References
    ----------
    CiA 402, object 6076h, motor rated torque.

    Examples
    --------
    >>> from whsklearn.export import Ratings
    >>> Ratings(torque=1.3, constant=0.12).speed is None
    True
    """

    torque: float | None = None
    constant: float | None = None
    speed: float | None = None


class Left(NamedTuple):
    """The torque that remains with a table, predicted by replaying the table against the model.

    Attributes
    ----------
    name : str
        Of the table.
    before, after : float
        Rms of the torque (or of the current or voltage that makes it) without the table and with it.
    unit : str
        Of both, and of the tables.

    References
    ----------
    Beckhoff Infosys, TF5200 friction compensation (FCT-C25), for what such a table does.

    Examples
    --------
    >>> from whsklearn.export import Left
    >>> left = Left("cogging.csv", before=0.04, after=0.001)
    >>> round(left.after / left.before, 3)
    0.025
    """

    name: str
    before: float
    after: float
    unit: str = "Nm"


def write_tables(model: Exported, out: Path, ratings: Ratings) -> tuple[list[Path], list[Loss], list[Left]]:
    """Write ``cogging.csv``, ``friction.csv`` and, where ratings are given, the lists of TF5200 and ServoOne.

    Raises ValueError if the model is a chain, has neither cogging nor friction, or moves in a unit for which no highest
    speed is known.
    """
    axis = model.need_axis("A table for a drive")
    unit, length = model.si
    if ratings.speed is None and length not in ("rad", "m"):
        raise ArgumentError(f"The model moves in {length}; give the highest speed in {length}/s with --speed.")
    asked, friction, _ = divided(rigid(axis))  # steady motion takes the friction of a load behind a play as well
    rest = divided(axis)[2]
    if not asked and not friction:
        raise ValueError("The model has neither cogging nor friction, so there is nothing to put into a table.")
    waves = [w for wave in asked if (w := of_a_whole_order(wave)) is not None]
    changed = [w for w, whole in zip(asked, waves, strict=True) if whole is not w]
    losses = model.told(losses_of(rest, "no table can represent it"))
    losses += model.told(losses_of(changed, ROUNDED))
    if waves and length != "rad":
        losses += model.told(losses_of(waves, "a table over a turn needs a rotary axis"))
    rated, ampere = ratings.torque, ratings.constant
    if unit in AMPERES:  # the tables are then in amperes, too
        rated, ampere = None if rated is None or ampere is None else rated / ampere, 1.0
    elif unit not in ("Nm", "N"):
        rated = ampere = None
    if ratings.torque is not None and rated is None:
        why = "are shares of a rated torque; give the torque constant of a drive in A, or a model of a torque"
        losses.append(Loss("friction in the lists of TF5200 and ServoOne", f"drive in {unit}", f"they {why}"))
    parts = _Tabled(
        partial(torque_of, waves, velocity=np.zeros(1)) if waves and length == "rad" else None,
        partial(torque_of, asked, velocity=np.zeros(1)),
        partial(torque_of, friction, np.zeros(1)) if friction else None,
        unit, length, rated, ampere, ratings.speed or _USUAL,
    )  # fmt: skip
    out.mkdir(parents=True, exist_ok=True)
    paths: list[Path] = []
    left: list[Left] = []
    for name, (lines, remaining) in (
        ("cogging.csv", parts.over_a_turn()),
        ("friction.csv", parts.over_speed()),
        ("tf5200_frict_comp.lis", parts.tf5200()),
        ("servo_one.csv", parts.servo_one()),
    ):
        if lines:
            atomic_write(out / name, ("\n".join(lines) + "\n").encode())
            paths.append(out / name)
        left += remaining
    return paths, losses, [one._replace(unit=unit) for one in left]


class _Tabled(NamedTuple):
    """What the tables are made from; a method gives the lines of a file (none if it cannot be) and what is left."""

    cogging: Torque | None  # over the angle, of waves of whole orders
    identified: Torque  # of the same waves as they were identified
    friction: Torque | None  # over the speed
    unit: str
    length: str
    rated: float | None  # rated torque in ``unit``
    ampere: float | None  # ``unit`` for each ampere
    top: float  # highest speed

    def over_a_turn(self) -> tuple[list[str], list[Left]]:
        if self.cogging is None:
            return [], []
        angle = np.arange(ENTRIES) * 2 * np.pi / ENTRIES
        lines = [f"angle_rad,feedforward_{self.unit.lower()}", *_rows(angle, self.cogging(angle))]
        return lines, [_over_a_turn("cogging.csv", self.identified, self.cogging, ENTRIES, hold=False)]

    def over_speed(self) -> tuple[list[str], list[Left]]:
        if self.friction is None:
            return [], []
        speeds = self.top * np.concatenate([-np.geomspace(1, 1e-3, 100), np.geomspace(1e-3, 1, 100)])
        torque = self.friction(speeds)
        lines = [f"velocity_{self.length}_per_s,feedforward_{self.unit.lower()}", *_rows(speeds, torque)]
        return lines, [_over_speed("friction.csv", self.friction, speeds, self.top, torque)]

    def tf5200(self) -> tuple[list[str], list[Left]]:
        rated = self.rated
        if self.friction is None or rated is None or self.length not in ("rad", "m"):
            return [], []
        speeds = self.top * np.geomspace(1e-3, 1, _TF5200_ENTRIES)
        unit = _MILLIDEGREE if self.length == "rad" else 1e-6
        steps = np.maximum(np.round(speeds / unit), 1.0).astype(int)
        values = np.round(_both_ways(self.friction, speeds) * 1000 / rated).astype(int)
        lines = ["frict_comp.mode 3", f"frict_comp.table_entries {steps.size}", "frict_comp.scaling_factor 1000"]
        for i, (v, x) in enumerate(zip(steps.tolist(), values.tolist(), strict=True)):
            lines += [f"frict_comp.table[{i}].in {v}", f"frict_comp.table[{i}].out {x}"]
        read = values * rated / 1000
        return lines, [_over_speed("tf5200_frict_comp.lis", self.friction, steps * unit, self.top, read)]

    def servo_one(self) -> tuple[list[str], list[Left]]:
        lines: list[str] = []
        left: list[Left] = []
        if self.cogging is not None and self.ampere is not None:
            current = self.cogging(np.arange(_KEBA_ENTRIES) * 2 * np.pi / _KEBA_ENTRIES) / self.ampere
            lines += [f"380,{i},CON_TCoggAddTab,{x:.6g},A" for i, x in enumerate(current.tolist())]
            name = "servo_one.csv (P 380)"
            left.append(_over_a_turn(name, self.identified, self.cogging, _KEBA_ENTRIES, hold=True))
        if self.friction is not None and self.length == "rad" and self.rated is not None:
            speeds = _three(self.friction, self.top)
            read = _both_ways(self.friction, speeds)
            steps = np.diff(read, prepend=0.0) * 100 / self.rated
            lines += [f"386,{i},CON_SCON_TFric,{x:.6g},%" for i, x in enumerate(steps.tolist())]
            lines += [f"387,{i},CON_SCON_TFricSpeed,{x:.6g},rpm" for i, x in enumerate((speeds / _RPM).tolist())]
            left.append(_over_speed("servo_one.csv (P 386)", self.friction, speeds, self.top, read))
        return (["parameter,index,name,value,unit", *lines] if lines else []), left


def divided(axis: ServoAxis) -> tuple[list[Effect], list[Effect], list[Effect]]:
    """Effects that are waves over a turn, those of speed alone, and the rest.

    >>> from whsklearn import ServoAxis
    >>> from whsklearn.effects import Cogging, GravityImbalance
    >>> parts = divided(ServoAxis(effects=[Cogging(0.05, 12.0), GravityImbalance(0.2)]))
    >>> [[e.name for e in part] for part in parts]
    [['cogging'], ['viscous', 'coulomb'], ['gravity_imbalance']]
    """
    angles, speeds = np.linspace(0.0, 2 * np.pi, 73), np.array([-3.0, -0.2, 0.2, 3.0])
    waves: list[Effect] = []
    friction: list[Effect] = []
    rest: list[Effect] = []
    for effect in parts_of(axis):
        table = np.zeros((1, 1))
        with np.errstate(invalid="ignore", divide="ignore"):  # a delay needs time, and is NaN without it
            if effect.place != "sensor" and compensated(effect.code):
                table = np.array([torque_of([effect], angles, np.array([v])) for v in speeds])
            size = np.abs(table).max()
            moves, turns = (np.ptp(table, axis=k).max() > 1e-9 * size for k in (0, 1))
        whole = of_a_whole_order(effect) is not None
        if not 0.0 < size < np.inf or (turns and (moves or not whole)):
            rest.append(effect)
        else:
            (waves if turns or whole else friction).append(effect)
    return waves, friction, rest


def torque_of(effects: list[Effect], position: Array, velocity: Array) -> Array:
    """The torque of some effects at positions and velocities, which are broadcast, in the model's units."""
    return np.asarray(sum(e.value(position=position, velocity=velocity) for e in effects))


def _rows(x: Array, y: Array) -> list[str]:
    return [f"{a:.9g},{b:.9g}" for a, b in zip(x.tolist(), y.tolist(), strict=True)]


def _both_ways(torque: Torque, speeds: Array) -> Array:
    """Half the difference between the two directions: a list of positive speeds is used for both."""
    return 0.5 * (torque(speeds) - torque(-speeds))


def _three(torque: Torque, top: float) -> Array:
    """Three speeds that describe a friction curve best: near rest, at its minimum or strongest bend, the highest."""
    v = top * np.geomspace(5e-3, 1, 60)
    f = _both_ways(torque, v)
    best = min(range(1, 59), key=lambda i: float(np.sum((np.interp(v, v[[0, i, -1]], f[[0, i, -1]]) - f) ** 2)))
    return v[[0, best, -1]]


def _over_a_turn(name: str, torque: Torque, tabled: Torque, entries: int, *, hold: bool) -> Left:
    """Evaluate a table at fine angles of one turn, holding each entry until the next or interpolating linearly."""
    angle = np.arange(_FINE) * 2 * np.pi / _FINE
    known = torque(angle)
    at = angle * entries / (2 * np.pi)
    table = tabled(np.arange(entries) * 2 * np.pi / entries)
    read = table[at.astype(int)] if hold else np.interp(at, np.arange(entries + 1), np.append(table, table[0]))
    return Left(name, rms(known), rms(known - read))


def _over_speed(name: str, torque: Torque, speeds: Array, top: float, read: Array) -> Left:
    """Evaluate a friction table at fine speeds of both directions; a table of positive speeds is used for both."""
    fine = top * np.concatenate([-np.geomspace(1, 2e-3, 500), np.geomspace(2e-3, 1, 500)])
    known = torque(fine)
    table = np.interp(fine, speeds, read) if speeds[0] < 0 else np.sign(fine) * np.interp(np.abs(fine), speeds, read)
    return Left(name, rms(known), rms(known - table))
