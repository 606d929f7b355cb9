"""Units: read off the names and headers of a log's columns, brought to SI, and put back where a person reads.

Everything inside is SI: s, rad and Nm, or m and N.  A drive in amperes stays in amperes: they cannot be turned into
newton metres without the torque constant, so friction comes in amperes then, and says so.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping

UNKNOWN = "as logged"
UNSTATED = frozenset({"", UNKNOWN})  # what stands for a unit that nothing states

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
    if re.fullmatch(r"(counts|ticks)/[0-9.e+]+", word):
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


def factor_between(source: str, target: str) -> float:
    """What a number in the unit ``source`` is to be multiplied with to be one in ``target``.

    A unit that is not known is taken for SI.

    Raises
    ------
    ValueError
        If the two measure different things, such as A and Nm.

    Examples
    --------
    >>> factor_between("Nm", "mNm"), factor_between("deg", "deg"), round(factor_between("rad/s", "rpm"), 3)
    (1000.0, 1.0, 9.549)
    """
    if source == target:
        return 1.0
    (here, a), (there, b) = factor_of(source), factor_of(target)
    if a != b and not {source, target} & UNSTATED:
        raise ValueError(f"{source} cannot be brought to {target}")
    return here / there


def respelled(unit: str, own: Mapping[str, str]) -> tuple[float, str]:
    """(factor to SI, spelling) of a compound SI unit where some symbols are to be others.

    Parameters
    ----------
    unit : str
        Such as ``Nm s2/rad2``.
    own : mapping of str to str
        SI symbol -> the symbol in its place, such as ``{"Nm": "mNm", "rad": "deg"}``.

    Examples
    --------
    >>> factor, spelling = respelled("Nm s/rad", {"Nm": "mNm", "rad": "deg"})
    >>> spelling, round(0.12 / factor, 6)  # 0.12 Nm s/rad in it
    ('mNm s/deg', 2.094395)
    """
    if not own:
        return 1.0, unit
    symbols = "|".join(re.escape(k) for k in own if k)
    token = re.compile(rf"(?<![A-Za-z])({symbols})(?![A-Za-z])([2-9²³]?)")
    factor = 1.0
    for part, sign in zip(unit.partition("/")[::2], (1, -1), strict=True):
        for symbol, power in token.findall(part):
            factor *= factor_of(own[symbol])[0] ** (sign * {"": 1, "²": 2, "³": 3}.get(power, power and int(power)))
    return factor, token.sub(lambda m: own[m[1]] + m[2], unit)


def inertia_unit(drive: str, motion: str) -> str:
    """Unit of drive over acceleration, from the SI symbols of drive and motion.

    Examples
    --------
    >>> inertia_unit("Nm", "rad"), inertia_unit("N", "m"), inertia_unit("A", "rad")
    ('kg m²', 'kg', 'A s²/rad')
    """
    return {("Nm", "rad"): "kg m²", ("N", "m"): "kg"}.get((drive, motion), f"{drive} s²/{motion}")


def readable(symbol: str, default: str = "") -> str:
    """The unit in which a motion or a drive in ``symbol`` is reported: as logged, except for counts per turn.

    A rate is reported in the unit of its motion, revolutions per minute in rad.

    Examples
    --------
    >>> readable("deg"), readable("counts/4096"), readable("mm/s"), readable("rpm"), readable("as logged", "rad")
    ('deg', 'rad', 'mm', 'rad', 'rad')
    """
    if symbol in UNSTATED:
        return default
    if symbol.startswith("counts/") or symbol == "rpm":
        return "rad"
    return symbol.removesuffix("/s")


def own_units(si: tuple[str, str], logged: tuple[str, str]) -> dict[str, str]:
    """SI symbols of drive and motion -> the units in which a report tells them, where these are others.

    Examples
    --------
    >>> own_units(("Nm", "rad"), ("mNm", "deg")), own_units(("A", "rad/s"), ("A", "deg/s"))
    ({'Nm': 'mNm', 'rad': 'deg'}, {'rad': 'deg'})
    """
    bases = [(s.removesuffix("/s"), unit) for s, unit in zip(si, logged, strict=True)]
    return {s: told for s, unit in bases if s and (told := readable(unit, s)) != s}


def turn_of(symbol: str) -> float | None:
    """How much of the unit a full turn is; None where the unit is no angle or the counts of a turn are not known."""
    factor, si = factor_of(symbol)
    return 2 * math.pi / factor if si == "rad" else None


def is_time(symbol: str) -> bool:
    """Whether a unit is one of time, ticks among them."""
    return symbol in _TIMES or symbol.startswith("ticks/")


def seconds_of(symbol: str) -> float:
    """Seconds in a unit of time; ``ticks/8000`` counts 8,000 a second.

    Examples
    --------
    >>> seconds_of("ms"), seconds_of("ticks/8000")
    (0.001, 0.000125)
    """
    return 1.0 / float(symbol.partition("/")[2]) if symbol.startswith("ticks/") else factor_of(symbol)[0]


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
            raise ValueError(
                f"The unit of time is {unit!r}; expected s, ms, us, ns or, for ticks of 8 kHz, ticks/8000."
            )
    return out
