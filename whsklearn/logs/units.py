"""Units of a log's columns: read off their names and headers, and the factors that bring them to SI.

A drive keeps its own unit: amperes cannot be turned into newton metres without the torque constant, so
friction comes in amperes then, and says so.
"""

from __future__ import annotations

import math
import re

UNKNOWN = "as logged"

# Spelling in a name or a header -> (symbol, factor to SI, SI symbol). Radians count as SI.
_KNOWN: dict[str, tuple[str, float, str]] = {
    "s": ("s", 1.0, "s"), "sec": ("s", 1.0, "s"), "seconds": ("s", 1.0, "s"),
    "ms": ("ms", 1e-3, "s"), "us": ("us", 1e-6, "s"), "ns": ("ns", 1e-9, "s"),
    "rad": ("rad", 1.0, "rad"), "mrad": ("mrad", 1e-3, "rad"),
    "deg": ("deg", math.pi / 180, "rad"), "degrees": ("deg", math.pi / 180, "rad"), "°": ("deg", math.pi / 180, "rad"),
    "turns": ("turns", 2 * math.pi, "rad"), "rev": ("turns", 2 * math.pi, "rad"),
    "m": ("m", 1.0, "m"), "mm": ("mm", 1e-3, "m"), "um": ("um", 1e-6, "m"),
    "counts": ("counts", 1.0, "counts"), "count": ("counts", 1.0, "counts"), "ticks": ("counts", 1.0, "counts"),
    "nm": ("Nm", 1.0, "Nm"), "mnm": ("mNm", 1e-3, "Nm"), "n": ("N", 1.0, "N"), "kn": ("kN", 1e3, "N"),
    "v": ("V", 1.0, "V"), "mv": ("mV", 1e-3, "V"), "a": ("A", 1.0, "A"), "ma": ("mA", 1e-3, "A"),
    "rad_s": ("rad/s", 1.0, "rad/s"), "deg_s": ("deg/s", math.pi / 180, "rad/s"), "m_s": ("m/s", 1.0, "m/s"),
    "mm_s": ("mm/s", 1e-3, "m/s"), "rpm": ("rpm", math.pi / 30, "rad/s"),
    "percent": ("%", 1.0, "%"), "%": ("%", 1.0, "%"),
}  # fmt: skip
_SPELLED = {symbol.lower(): key for key, (symbol, _, _) in _KNOWN.items()} | {"n·m": "nm", "n*m": "nm", "n m": "nm"}
_TIMES = {"s", "ms", "us", "ns"}


def unit_of(column: str, default: str = UNKNOWN) -> str:
    """The unit at the end of a column's name, in brackets or after an underscore; `default` if there is none.

    Examples
    --------
    >>> unit_of("position_deg"), unit_of("Torque [Nm]"), unit_of("speed (rad/s)"), unit_of("velocity_rad_s")
    ('deg', 'Nm', 'rad/s', 'rad/s')
    >>> unit_of("current"), unit_of("a")
    ('as logged', 'as logged')
    """
    text = str(column).strip()
    bracket = re.search(r"[\[(<]\s*([^\])>]+?)\s*[\])>]\s*$", text)
    if bracket and (symbol := symbol_of(bracket.group(1))) is not None:
        return symbol
    words = [w for w in re.split(r"[^a-z0-9%°]+", text.lower()) if w]
    for n in (2, 1):
        tail = "_".join(words[-n:])
        if len(words) > n and tail in _KNOWN:
            return _KNOWN[tail][0]
    return default


def symbol_of(text: str) -> str | None:
    """The symbol for a unit as people spell it; None for a word that is no unit we know.

    ``counts/4096`` and ``turns/16384`` say how many counts make a turn.

    Examples
    --------
    >>> symbol_of("NM"), symbol_of("deg/s"), symbol_of("counts/4096"), symbol_of("furlong")
    ('Nm', 'deg/s', 'counts/4096', None)
    """
    word = text.strip().lower()
    if re.fullmatch(r"counts/[0-9.e+]+", word):
        return word
    key = _SPELLED.get(word, word)
    return _KNOWN[key][0] if key in _KNOWN else None


def factor_of(symbol: str) -> tuple[float, str]:
    """Factor and SI symbol of a unit; 1 and the unit itself where it is not known.

    Examples
    --------
    >>> factor_of("ms"), factor_of("A"), factor_of("as logged")
    ((0.001, 's'), (1.0, 'A'), (1.0, 'as logged'))
    >>> round(factor_of("counts/4096")[0] * 4096, 6), factor_of("counts/4096")[1]
    (6.283185, 'rad')
    """
    if symbol.startswith("counts/"):
        return 2 * math.pi / float(symbol.partition("/")[2]), "rad"
    key = _SPELLED.get(symbol.lower(), symbol.lower())
    if key not in _KNOWN:
        return 1.0, symbol
    _, factor, si = _KNOWN[key]
    return factor, si


def turn_of(symbol: str) -> float | None:
    """How much of the unit a full turn is; None where the unit is no angle or the counts of a turn are not known."""
    factor, si = factor_of(symbol)
    return 2 * math.pi / factor if si == "rad" else None


def is_time(symbol: str) -> bool:
    """Whether a unit is one of time."""
    return symbol in _TIMES


def stated(units: dict[str, str] | None) -> dict[str, str]:
    """Units given by role, with roles and symbols as the library spells them.

    Raises
    ------
    ValueError
        If a unit's role is not known.
    """
    roles = {"input": "drive", "output": "position"}
    out = {}
    for role, unit in (units or {}).items():
        name = roles.get(role, role)
        if name not in {"time", "drive", "position", "reference", "command", "velocity"}:
            raise ValueError(
                f"A unit was given for {role!r}; expected one of time, drive, position, reference, command, velocity, "
                "such as --unit position=deg."
            )
        out[name] = symbol_of(unit) or unit
        if name == "time" and not is_time(out[name]):
            raise ValueError(f"The unit of time is {unit!r}; expected s, ms, us or ns.")
    return out
