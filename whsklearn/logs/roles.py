"""The roles of columns: by given names, by number, or by the usual names of time, drive and position."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from whsklearn.logs.errors import ColumnError
from whsklearn.logs.source import Source
from whsklearn.logs.units import UNSTATED, factor_of, symbol_of, unit_in, unit_of, written_unit

# In order of preference; one word of the column's name must equal one of these.
WORDS: dict[str, tuple[str, ...]] = {
    "time": (
        "time", "t", "timestamp", "stamp", "timestamps", "zeit", "zeitstempel", "uhrzeit", "clock", "ts", "seconds",
        "millis", "temps", "tiempo", "tempo", "micros", "milliseconds", "microseconds", "ms", "us", "ticks", "tick",
        "datetime", "date", "datum", "xvalue",
    ),
    "drive": (
        "torque", "tau", "trq", "tor", "drive", "moment", "drehmoment", "couple", "coppia", "current", "strom", "iq",
        "effort", "force", "kraft", "load", "voltage", "spannung", "u", "input",
    ),
    "position": (
        "position", "pos", "angle", "theta", "q", "lage", "winkel", "posición", "posicion", "posizione", "encoder",
        "enc", "qpos", "y", "output",
    ),
    "reference": ("reference", "ref", "setpoint", "desired", "target", "goal", "soll", "sollwert", "set", "demand"),
    "velocity": (
        "velocity", "vel", "speed", "omega", "geschwindigkeit", "drehzahl", "vitesse", "velocidad", "velocità", "qvel",
        "qdot", "thetadot", "dtheta", "dot",
    ),
}  # fmt: skip
# Stems of languages that write words together or inflect them, and the word above that each stands for.
_STEMS = {
    "time": ("时间", "時間", "时刻", "時刻", "시간", "время"),
    "torque": ("转矩", "轉矩", "扭矩", "力矩", "トルク", "토크", "момент", "drehmoment", "antriebsmoment", "istmoment"),
    "current": ("电流", "電流", "전류", "motorstrom", "iststrom", "stromist"),
    "voltage": ("电压", "電圧", "전압", "напряжени"),
    "force": ("推力", "усили"),
    "position": ("位置", "位移", "変位", "위치", "положени", "istlage", "lageist", "istposition", "positionsist"),
    "angle": ("角度", "转角", "각도", "угол", "winkel"),
    "velocity": ("速度", "转速", "轉速", "속도", "скорост", "drehzahl", "geschwindigkeit"),
    "reference": ("目标", "目標", "指令", "设定", "给定", "목표", "지령", "задан", "soll", "consigne", "consigna"),
    "error": ("偏差", "schlepp", "abweichung"), "limit": ("grenz",), "acceleration": ("beschleunigung",),
}  # fmt: skip
_NOT_MEASURED = {
    *WORDS["reference"], *WORDS["velocity"], "command", "commanded", "cmd", "error", "lag", "acceleration", "acc",
    "ddot", "limit", "lim", "max", "min", "temperature", "temp", "temperatur", "valid", "status", "enable", "enabled",
    "fault", "deviation", "offset", "rate", "constant",
}  # fmt: skip
# Of another torque than the motor's, or of what feeds the drive
_NOT_DRIVING = {
    "disturbance", "friction", "gravity", "ff", "feedforward", "compensation", "comp", "external", "ext", "brake",
    "bus", "supply", "battery", "cpu", "digital",
}  # fmt: skip
_TICKS = {"ticks", "tick"}  # of a clock, or of an encoder
_COMMANDED = {*WORDS["reference"], "command", "commanded", "cmd"}
_NO_TORQUE = (_NOT_MEASURED - _COMMANDED) | _NOT_DRIVING | {*WORDS["position"], "pwm", "duty"}
_TORQUES = {w for w in WORDS["drive"] if len(w) > 1}
_VAGUE = {"load", "input", "output"}  # anything may be called so
# A share of the supply: it is only ever commanded, and taken where no torque, current or voltage is logged.
_DUTY, _NO_DUTY = {"pwm", "duty"}, {"limit", "lim", "max", "min", "error"}

# Roles by unit, if no word decides. A unit also outweighs a word of one letter: "i_q [A]" is not a position.
_ROLE_OF_UNIT = {
    **dict.fromkeys(("Nm", "N", "V", "A", "Arms", "Apk", "Vrms"), "drive"),
    **dict.fromkeys(("rad", "m", "counts"), "position"),
    **dict.fromkeys(("rad/s", "m/s", "counts/s"), "velocity"),
    "s": "time",
}


def guess(source: Source, role: str) -> str | None:
    """The one column whose name or unit identifies it as `role`; None if there is none.

    Of several that match equally well, the one whose values change; raises ColumnError if several do.

    >>> from whsklearn.logs.source import Source
    >>> source = Source("axis.csv", ["t", "i_q", "phi_deg", "M1"], lambda columns: {})
    >>> guess(source, "drive"), guess(source, "position"), guess(source, "reference")
    ('i_q', 'phi_deg', None)
    """
    free = [n for n in source.names if not _other(role, n)]
    units = {n: _role_of_unit(source, n) for n in free}
    named = {word: [n for n in free if word in words_of(n)] for word in WORDS[role]}
    fit = {word: [n for n in of if units[n] in (role, None)] for word, of in named.items()}  # by their units, too
    clear, long = [w for w in named if w not in _VAGUE], [w for w in named if len(w) > 1]
    by_unit = [n for n in free if units[n] == role]
    ranked = [*(fit[w] for w in clear), by_unit, *(fit[w] for w in named), *(named[w] for w in long)]
    found = next(filter(None, ranked), [])
    if not found and role == "drive":  # a torque that is only commanded drives, too
        words = {n: set(words_of(n)) for n in source.names}
        found = [n for n, w in words.items() if _COMMANDED & w and not _NO_TORQUE & w]
        found = [n for n in found if _TORQUES & words[n] or _role_of_unit(source, n) == "drive"]
        found = found or [n for n, w in words.items() if _DUTY & w and not _NO_DUTY & w]
    if len(found) > 1:
        found = _changing(source, found) or found
    if len(found) > 1:
        raise ColumnError(
            f"{source.name} has several columns for {role}: {', '.join(found[:8])}; name one with --{role}."
        )
    return found[0] if found else None


def says(column: str, role: str) -> bool:
    """Whether a column's name alone tells its role, by its unit or a word; a letter, input and output tell nothing.

    >>> [says(c, "drive") for c in ("torque", "M1 [Nm]", "u", "input", "torque_cmd")]
    [True, True, False, False, False]
    >>> says("position", "position"), says("angle_deg", "position"), says("speed_deg_s", "position")
    (True, True, False)
    """
    unit = unit_of(column)
    if unit not in UNSTATED:
        return _ROLE_OF_UNIT.get(factor_of(unit)[1]) == role
    told = {word for word in WORDS[role] if len(word) > 1} - _VAGUE
    return bool(told & set(words_of(column))) and not _other(role, column)


def _changing(source: Source, columns: list[str]) -> list[str]:
    """Those of the columns that hold more than one number: what never changes neither drives nor moves."""
    changing = []
    for name in columns:  # one by one: of several motors, no two can be read together
        read = source.fetch([name]).get(name)
        if (
            read is None
            or read.values.dtype.kind not in "fiu"
            or np.unique(read.values[np.isfinite(read.values)]).size > 1
        ):
            changing.append(name)
    return changing


def words_of(column: str) -> list[str]:
    """The words in a column's name, including its unit; i_q, the torque-producing current, is one word."""
    spelled = re.sub(r"(?<=[a-z])(?=[A-Z])", "_", column).lower()
    spelled = re.sub(r"(?<![a-z0-9])(i_?q|x_value)(?![a-z0-9])", lambda m: m[1].replace("_", ""), spelled)
    words = re.split(r"[^a-z0-9à-öø-ÿ]+", spelled)
    foreign = [word for word, stems in _STEMS.items() if any(s in spelled for s in stems)]
    return [re.sub(r"(?<=[a-z]{4})\d+$", "", w) for w in words if w] + foreign  # position0 is a position


def _role_of_unit(source: Source, column: str) -> str | None:
    """The role that a column's unit implies; the unit is from the file or the end of the name."""
    return _ROLE_OF_UNIT.get(factor_of(unit_in(source.units.get(column, ""), column))[1])


def _other(role: str, column: str) -> bool:
    """Whether a word in the name excludes the role: a set position is not the measured one."""
    unit = written_unit(column)
    words = set(words_of(column.replace(unit, " ") if symbol_of(unit) else column))  # arc min is no minimum
    if role == "time":
        return bool(words & _TICKS) and bool(words & {*WORDS["position"], *WORDS["velocity"]})
    if role == "drive" and (_NOT_DRIVING & words or ("sensor" in words and words & {*WORDS["position"]})):
        return True
    return role in ("position", "drive") and bool(_NOT_MEASURED & words)


def by_number(numbers: str, chain: bool = False) -> dict[str, str]:
    """Roles for ``--columns``: two for drive and position, three with time first, four with the reference last.

    >>> by_number("0,3"), by_number("0,1,2")
    ({'drive': '0', 'position': '3'}, {'time': '0', 'drive': '1', 'position': '2'})
    """
    given = [c.strip() for c in numbers.split(",") if c.strip()]
    orders: dict[int, Sequence[str]] = {
        2: ("drive", "position"), 3: ("time", "drive", "position"), 4: ("time", "drive", "position", "reference"),
    }  # fmt: skip
    if len(given) not in orders or (chain and len(given) == 4):
        raise ColumnError(
            f"--columns is {numbers!r}; expected two (drive, position), three (time, drive, position) or four with the "
            "reference last, by number from 0 or by name, such as --columns 0,1,2."
        )
    return dict(zip(orders[len(given)], given, strict=True))
