"""Units: read from column names and headers, converted to SI, and converted back in reports.

Internally everything is in SI: s, rad and Nm, or m and N. A drive in amperes stays in amperes, because it cannot be
converted to newton metres without the torque constant; friction is then reported in amperes.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping

from whsklearn.logs.errors import ColumnError

UNKNOWN = "as logged"
UNSTATED = frozenset({"", UNKNOWN})  # a unit that is not stated
ROLES = ("time", "drive", "position", "reference", "command", "velocity")  # of columns
OTHER_NAMES = {"input": "drive", "output": "position"}

# Symbol -> factor to SI, SI symbol, other spellings. Radians count as SI. Separators and case do not matter:
# N·m, N m and nm are one spelling.
_KNOWN: dict[str, tuple[float, str, tuple[str, ...]]] = {
    "s": (1.0, "s", ("sec", "secs", "second", "seconds", "秒", "с", "сек", "초")),
    "ms": (1e-3, "s", ("msec", "millis", "millisecond", "milliseconds", "毫秒", "ミリ秒", "мс")),
    "us": (1e-6, "s", ("usec", "micros", "microsecond", "microseconds", "微秒", "мкс")),
    "ns": (1e-9, "s", ("nsec", "nanos", "nanosecond", "nanoseconds")),
    "min": (60.0, "s", ("mins", "minute", "minutes")), "h": (3600.0, "s", ("hr", "hrs", "hour", "hours")),
    "d": (86400.0, "s", ("day", "days", "tage")),
    "rad": (1.0, "rad", ("radian", "radians", "弧度", "ラジアン", "рад")),
    "deg": (math.pi / 180, "rad", (
        "degree", "degrees", "°", "grad", "degré", "degrés", "grado", "grados", "gradi", "度", "град", "도",
    )),
    "arcmin": (math.pi / 10800, "rad", ("′",)), "arcsec": (math.pi / 648000, "rad", ("″", "′′")),
    "gon": (math.pi / 200, "rad", ()),
    "turns": (2 * math.pi, "rad", ("turn", "rev", "revs", "revolution", "revolutions", "umdr", "umdrehungen")),
    "m": (1.0, "m", ("米", "м", "metre", "metres", "meter", "meters")), "mm": (1e-3, "m", ("毫米", "мм")),
    "inch": (0.0254, "m", ("inches", "in")), "ft": (0.3048, "m", ("foot", "feet")),
    "counts": (1.0, "counts", (
        "count", "cnt", "cts", "tick", "ticks", "inc", "incs", "incr", "increment", "increments", "inkr", "inkrement",
        "inkremente", "pulse", "pulses", "qc",  # qc: quadrature counts of EPOS drives
    )),
    "Nm": (1.0, "Nm", ("牛米", "нм", "newtonmetre", "newtonmetres", "newtonmeter", "newtonmeters")),
    "mNm": (1e-3, "Nm", ("nmm",)), "Ncm": (1e-2, "Nm", ("cnm",)), "daNm": (10.0, "Nm", ("kncm",)),
    "N": (1.0, "N", ("牛", "н", "newton", "newtons")),
    "V": (1.0, "V", ("volt", "volts")),
    "A": (1.0, "A", ("amp", "amps", "ampere", "amperes", "安", "а")),
    # Effective and peak values are units of their own: which of the two a torque constant is for, no log tells.
    "Arms": (1.0, "Arms", ("a_rms", "aeff", "a_eff")), "mArms": (1e-3, "Arms", ("ma_rms", "maeff")),
    "Apk": (1.0, "Apk", ("a_pk", "apeak", "a_peak")), "Vrms": (1.0, "Vrms", ("v_rms", "veff")),
    "rpm": (math.pi / 30, "rad/s", (
        "1/min", "min1", "r/min", "u/min", "tr/min", "ot/min", "obr/min", "giri/min", "转/分", "об/мин",
    )),
    "%": (1.0, "%", ("percent", "pct", "prozent")), "permille": (0.1, "%", (
        "‰", "promille", "permil", "perthousand", "1/1000",
    )),
}  # fmt: skip
_COMMON = tuple(_KNOWN)  # which messages list
# SI prefixes, with the units that logs have them on
_PREFIXED = {
    "k": (1e3, "N Nm A V"), "da": (10.0, "N"), "d": (0.1, "N Nm m"), "c": (1e-2, "m deg"),
    "m": (1e-3, "N A V rad deg turns"), "u": (1e-6, "N Nm A V rad deg m"),
}  # fmt: skip
for _prefix, (_by, _units) in _PREFIXED.items():
    for _unit in _units.split():
        _KNOWN[_prefix + _unit] = (_by * _KNOWN[_unit][0], _KNOWN[_unit][1], ("mrev",) * (_unit == "turns"))
_KNOWN |= {"MN": (1e6, "N", ()), "MNm": (1e6, "Nm", ())}
# Forces that are weights, by ISO 80000-4, with the units of length that make torques of them
for _force, _by, _others, _arms in (
    ("kgf", 9.80665, ("kg", "kp"), "m cm mm"), ("gf", 9.80665e-3, ("g",), "m cm"),
    ("lbf", 4.4482216152605, ("lb",), "in ft"), ("ozf", 4.4482216152605 / 16, ("oz",), "in"),
):  # fmt: skip
    _KNOWN[_force] = (_by, "N", _others[1:])  # a kg, a g, an lb and an oz alone are masses
    for _arm in _arms.split():
        _spelled = tuple(t for f in (_force, *_others) for t in (f + _arm, _arm + f))
        _length = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "in": 0.0254, "ft": 0.3048}[_arm]
        _KNOWN[f"{_force} {_arm}"] = (_by * _length, "Nm", tuple(t for t in _spelled if t not in ("gm", "mg", "mkg")))
# Motion per time. A ratio of other units is another quantity: its unit is not known.
_MOTIONS = ("rad", "m", "counts")
for _unit, (_by, _si, _) in list(_KNOWN.items()):
    if _si in _MOTIONS:
        _KNOWN[f"{_unit}/s"] = (_by, f"{_si}/s", ())
        _KNOWN[f"{_unit}/min"] = (_by / 60.0, f"{_si}/s", ())
del _KNOWN["turns/min"]
for _rate, _short in (("turns/s", "rps"), ("m/s", "mps"), ("deg/s", "dps"), ("inch/s", "ips"), ("rpm", "turns/min")):
    _KNOWN[_rate] = (*_KNOWN[_rate][:2], (*_KNOWN[_rate][2], _short))
_PER_TURN = re.compile(r"(?:counts|ticks)/(\d+\.?\d*(?:e\+?\d+)?)")
_COUNTS = re.compile(r"([a-z]+)/(\d+)|(\d+) ?(?:cpr|([a-z]+)/(?:rev|turn|revolution))")  # of a turn
_MULTIPLE = re.compile(r"(\d*[.,]?\d+(?:e[+-]?\d+)?|1/10+)\s*[·*]?\s*([^\d\s.,/].*)", re.IGNORECASE)
# A share of a torque or a current that the drive knows: `% rated`, `%MN`, `‰ of rated current`
_SHARE = re.compile(r"(%|percent|prozent|‰|per ?mill?e?|promille|per ?thousand|1/1000)(?:$|\s*[a-z][^/]*|\s*\(.*)")
_WIDE = str.maketrans("\uff08\uff09\uff3b\uff3d", "()[]")  # the brackets of Chinese and Japanese keyboards
_TIMES = {"s", "ms", "us", "ns", "min", "h", "d"}
# At the end of a name, units only after one of _MARKS: torque_min is a minimum, and kp a gain.
_ONLY_MARKED = set("min h d day grad amp in ft foot meter kp ua ka kv uv un dn dan dm".split())
_MARKS = {"in", "time", "t", "zeit"}

# Words behind a unit that tell which signal it is, not in what unit: torque_nm_filtered.
_WHICH = frozenset(
    "filtered filt raw measured meas actual act ist set setpoint soll ref reference desired des target cmd command "
    "demand value val".split()
)
# Words in brackets that state no unit
_NO_UNIT = frozenset(
    "none null na nan nil unknown undefined raw unitless dimensionless unit units user axis joint motor load side left "
    "right encoder sensor drive channel ch feedback fb abs".split()
)


def _plain(spelling: str) -> str:
    """A spelling in lower case without separators."""
    return re.sub(r"[\s·⋅*.^⁻-]", "", spelling.strip().lower().replace("µ", "u").replace("μ", "u").replace("¹", "1"))


_SPELLED = {_plain(s): symbol for symbol, (_, _, others) in _KNOWN.items() for s in (symbol, *others)}
_SPELLED |= {"mn": "mN", "mnm": "mNm"}  # in any other case than that of MN and MNm


def unit_of(column: str, default: str = UNKNOWN) -> str:
    """The unit at the end of a column's name, in brackets or after an underscore; `default` if there is none.

    >>> unit_of("position_deg"), unit_of("Torque [mN·m]"), unit_of("speed (rad/s)"), unit_of("velocity_rad_s")
    ('deg', 'mNm', 'rad/s', 'rad/s')
    >>> unit_of("current"), unit_of("a"), unit_of("torque_min"), unit_of("time [min]")
    ('as logged', 'as logged', 'as logged', 'min')
    >>> unit_of("torque_nm_filtered"), unit_of("encoder_ticks"), unit_of("counts_per_s"), unit_of("stiffness [Nm/rad]")
    ('Nm', 'counts', 'counts/s', 'as logged')
    >>> unit_of("Actual Current (0.01 A)"), unit_of("Position [0.001 deg]"), unit_of("angle (degrés)")
    ('0.01 A', '0.001 deg', 'deg')
    >>> unit_of("motorTorqueNm"), unit_of("torque_mNm"), unit_of("speedRadPerS"), unit_of("电机转矩（牛·米）")
    ('Nm', 'mNm', 'rad/s', 'Nm')
    """
    text = str(column)
    if re.fullmatch(r"[a-z]{2,}(?:[A-Z][A-Za-z0-9]*)+", text):  # capitals divide its words
        text = re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", text)
    written = written_unit(text)
    if (symbol := symbol_of(written) or multiple_of(written)) is not None:
        return symbol
    if not written and (symbol := multiple_of(re.split(r",\s|\s/\s|\sin\s", text)[-1])) is not None:
        return symbol  # Position, 0.01 deg
    product = re.search(r"[^\W\d][·⋅*×.]\s?\w+$", written)
    if product is not None and symbol_of(re.split(r"\s+(?=\S*\w[·⋅*×.])", written)[-1]) is None:
        return default  # the last unit of a product, such as m of foo·m, is not that of the column
    if written:
        text = text.translate(_WIDE)
        inside = _words(written)
        if symbol := _at_end(["", *inside]):
            return symbol
        if any(len(w) > 1 and w in _SPELLED for w in inside):
            return default  # a unit of another quantity, such as Nm/rad
        text = text.rpartition(written)[0]
    words = _words(text)
    alone = len("".join(w for w in words if w not in _WHICH)) > 1  # one letter is a quantity's: M_ist
    whole = ["", *words] if alone else []
    return (symbol_of(text) if "/" in text else None) or _at_end(words) or _at_end(whole) or default


def _words(text: str) -> list[str]:
    """Words in lower case, with ``/`` as a word."""
    return re.findall(r"[a-z0-9%°²³à-öø-ÿа-я]+|/", re.sub("[µμ]", "u", text.lower()))


def _at_end(words: list[str]) -> str | None:
    """The unit that the last words spell, the longest first; the first word names a quantity (or is empty)."""
    while len(words) > 2 and (words[-1] in _WHICH or (words[-1].isdigit() and len(words[-2]) > 1)):
        words = words[:-1]  # a number behind one letter is a power, as in m_s_2
    for n in (3, 2, 1):
        before, tail = words[:-n], words[-n:]
        if not before or tail[0] in ("/", "per"):
            continue
        over = tail[::2] if n == 3 and tail[1] in ("/", "per") else tail
        ratio = _ratio(*over) if len(over) == 2 else None
        if over is tail and tail[-1] == "min" and ratio != "rpm":
            ratio = None  # position_deg_min is a minimum
        symbol = ratio or _SPELLED.get("".join(tail))
        if symbol and not ("".join(tail) in _ONLY_MARKED and before[-1] not in _MARKS):
            return None if _measures_more(before) else symbol
    return None


def _measures_more(before: list[str]) -> bool:
    """Whether the words before a unit make it a part of another one; ``Winkel/rad`` is an angle in rad."""
    if before[-1] == "/":
        return not before[0] or (len(before) > 2 and before[-2] in _SPELLED)
    unit = before[-1] in _SPELLED and before[-1] != "in"  # which is no inch: torque in Nm
    return before[-1] == "per" or (len(before) > 1 and len(before[-1]) > 1 and unit)


def _ratio(top: str, bottom: str) -> str | None:
    """The symbol of one unit per another, in any spelling of both, if it is known."""
    units = _SPELLED.get(_plain(top)), _SPELLED.get(_plain(bottom))
    return _SPELLED.get(_plain(f"{units[0]}/{units[1]}"))


def written_unit(column: str) -> str:
    """The text in brackets at the end of a column's name, whether or not it is a unit; empty if there is none.

    >>> written_unit("Torque [N·m]"), written_unit("torque_nm")
    ('N·m', '')
    """
    bracket = re.search(r"[\[(<]\s*([^\])>]+?)\s*[\])>]\s*$", str(column).translate(_WIDE).strip())
    return bracket[1] if bracket else ""


def symbol_of(text: str) -> str | None:
    """The symbol of a unit in any usual spelling; None for an unknown unit.

    ``counts/4096`` and ``ticks/16384`` give the counts per turn; for a time, the ticks per second.

    >>> symbol_of("NM"), symbol_of("deg/s"), symbol_of("counts/4096"), symbol_of("oz-in"), symbol_of("furlong")
    ('Nm', 'deg/s', 'counts/4096', 'ozf in', None)
    >>> symbol_of("A rms"), symbol_of("% of rated torque"), symbol_of("‰ rated"), symbol_of("%/s")
    ('Arms', '%', 'permille', None)
    """
    word = text.strip().lower()
    if _per_turn(word) is not None:
        return word
    if (turn := _COUNTS.fullmatch(word)) is not None and _SPELLED.get(turn[1] or turn[4] or "counts") == "counts":
        counts = f"counts/{turn[2] or turn[3]}"
        return counts if _per_turn(counts) else None
    if (mega := re.fullmatch(r"MN([\s·⋅*.-]*m)?", text.strip())) is not None:
        return "MNm" if mega[1] else "MN"

    if symbol := _SPELLED.get(_plain(word)):
        return symbol
    if (share := _SHARE.fullmatch(word)) is not None and multiple_of(word) is None:
        return "%" if share[1][:4] in ("%", "perc", "proz") else "permille"
    rate = re.fullmatch(r"(.+?)[\s·⋅*]*(?:(?:/| per )\s*(\w+)|\b(s|sec|min)\s*\^?\s*(?:-1|⁻¹))", word)
    return _ratio(rate[1], rate[2] or rate[3]) if rate is not None else None


def _per_turn(symbol: str) -> float | None:
    """The number behind ``counts/`` or ``ticks/``; None for anything else, such as ``counts/0``."""
    found = _PER_TURN.fullmatch(symbol)
    number = float(found[1]) if found is not None else 0.0
    return number if 0.0 < number < math.inf else None


def multiple_of(text: str) -> str | None:
    """A multiple of a unit, as drives write raw numbers; None for anything else.

    >>> multiple_of("0.01A"), multiple_of("1e-3 degrees"), multiple_of("1/1000 deg"), multiple_of("10 furlong")
    ('0.01 A', '1e-3 deg', '0.001 deg', None)
    """
    found = _MULTIPLE.fullmatch(text.strip())
    if found is None or (symbol := symbol_of(found[2])) is None:
        return None
    by = found[1].replace(",", ".").removeprefix("1/")
    by = f"{1 / float(by):.12g}" if "/" in found[1] else by
    return f"{by} {symbol}" if float(by) > 0 else None


def unit_in(stated: str, column: str, role: str = "drive") -> str:
    """The unit of a column of a file, by what the file states about it or else by its name.

    A unit that is stated and not known is returned as it is written, so that nobody takes the numbers to be in SI.

    >>> unit_in("mNm", "torque_nm"), unit_in("", "Position [deg]"), unit_in("", "torque"), unit_in("", "tau (axis 2)")
    ('mNm', 'deg', 'as logged', 'as logged')
    >>> unit_in("", "IL.FB (Arms)"), unit_in("", "gain [Nm/A]"), unit_in("furlong", "x"), unit_in("-", "x_mm")
    ('Arms', 'Nm/A', 'furlong', 'mm')
    """
    found = symbol_of(stated) or multiple_of(stated) or unit_of(column)
    if found == UNKNOWN and role != "time":
        found = next((t for t in (stated, written_unit(column)) if states_a_unit(t)), UNKNOWN)
    return unit_for(role, found)


def states_a_unit(text: str) -> bool:
    """Whether a text in the place of a unit may be one: a word that does not just tell which signal it is.

    >>> states_a_unit("furlong"), states_a_unit("axis 2"), states_a_unit("-")
    (True, False, False)
    """
    words = [w for w in re.findall(r"[^\W\d_]+|[^\x00-\x7f\u2013\u2014]", text.lower()) if w not in _WHICH]
    return bool(words) and _NO_UNIT.isdisjoint(words)  # a sign, such as a degree that was read wrongly, may be one


def is_known(symbol: str) -> bool:
    """Whether a symbol is that of a unit of the table, a multiple of one, or counts of a turn.

    >>> is_known("0.01 A"), is_known("counts/4096"), is_known("furlong"), is_known(UNKNOWN)
    (True, True, False, False)
    """
    factor, si = factor_of(symbol)
    return si in _KNOWN or factor != 1.0


def unit_for(role: str, symbol: str) -> str:
    """The unit of a signal: ``Nm`` of a position is a nanometre, although columns also spell newton metres that way.

    >>> unit_for("position", "Nm"), unit_for("drive", "Nm")
    ('nm', 'Nm')
    """
    return "nm" if symbol == "Nm" and role in ("position", "reference", "command") else symbol


def factor_of(symbol: str) -> tuple[float, str]:
    """Factor and SI symbol of a unit; 1 and the unit itself if it is not known.

    >>> factor_of("ms"), factor_of("A"), factor_of("as logged")
    ((0.001, 's'), (1.0, 'A'), (1.0, 'as logged'))
    >>> round(factor_of("counts/4096")[0] * 4096, 6), factor_of("counts/4096")[1]
    (6.283185, 'rad')
    >>> factor_of("0.01 A"), factor_of("10 furlong")
    ((0.01, 'A'), (1.0, '10 furlong'))
    """
    if (of := _per_turn(symbol)) is not None:
        return 2 * math.pi / of, "rad"
    if symbol == "nm":  # of a position, see `unit_for`
        return 1e-9, "m"
    if known := _KNOWN.get(symbol) or _KNOWN.get(_SPELLED.get(_plain(symbol), "")):
        return known[:2]
    if (multiple := multiple_of(symbol)) is not None:
        times, _, unit = multiple.partition(" ")
        by, si = factor_of(unit)
        return float(times) * by, si
    return 1.0, symbol


def factor_between(source: str, target: str) -> float:
    """The factor that converts a number from the unit ``source`` to ``target``.

    An unknown unit is taken to be SI.

    Raises ValueError if the two measure different things, such as A and Nm.

    >>> factor_between("Nm", "mNm"), factor_between("deg", "deg"), round(factor_between("rad/s", "rpm"), 3)
    (1000.0, 1.0, 9.549)
    """
    if source == target:
        return 1.0
    (here, a), (there, b) = factor_of(source), factor_of(target)
    if a != b and not {source, target} & UNSTATED:
        raise ValueError(f"{source} cannot be converted to {target}")
    return here / there


def respelled(unit: str, own: Mapping[str, str]) -> tuple[float, str]:
    """(factor to SI, spelling) of a compound SI unit in which some symbols are replaced.

    ``unit``: such as ``Nm s2/rad2``. ``own``: SI symbol -> its replacement, such as ``{"Nm": "mNm", "rad": "deg"}``.

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

    >>> inertia_unit("Nm", "rad"), inertia_unit("N", "m"), inertia_unit("A", "rad")
    ('kg m²', 'kg', 'A s²/rad')
    """
    return {("Nm", "rad"): "kg m²", ("N", "m"): "kg"}.get((drive, motion), f"{drive} s²/{motion}")


def readable(symbol: str, default: str = "") -> str:
    """The unit in which a motion or a drive in ``symbol`` is reported: as logged, but for counts a turn and multiples.

    A rate is reported in the unit of its motion, revolutions per minute in rad.

    >>> readable("deg"), readable("counts/4096"), readable("mm/s"), readable("rpm"), readable("as logged", "rad")
    ('deg', 'rad', 'mm', 'rad', 'rad')
    """
    if symbol in UNSTATED:
        return default
    if _per_turn(symbol) is not None or symbol == "rpm":
        return "rad"
    return re.sub("/(s|min)$", "", _base(symbol))


def integral_of(symbol: str) -> tuple[float, str]:
    """Factor and unit of a rate's integral over seconds: that of ``rpm`` is a sixtieth of a turn.

    >>> integral_of("deg/s"), integral_of("rpm") == (1 / 60, "turns"), integral_of("as logged")
    ((1.0, 'deg'), True, (1.0, 'as logged'))
    """
    if symbol == "rpm" or symbol.endswith("/min"):
        return 1.0 / 60.0, "turns" if symbol == "rpm" else symbol.removesuffix("/min")
    return 1.0, symbol.removesuffix("/s")


def own_units(si: tuple[str, str], logged: tuple[str, str]) -> dict[str, str]:
    """SI symbols of drive and motion -> the units used in a report, if they differ.

    >>> own_units(("Nm", "rad"), ("mNm", "deg")), own_units(("A", "rad/s"), ("A", "deg/s"))
    ({'Nm': 'mNm', 'rad': 'deg'}, {'rad': 'deg'})
    """
    bases = [(s.removesuffix("/s"), unit) for s, unit in zip(si, logged, strict=True)]
    return {s: told for s, unit in bases if s and (told := readable(unit, s)) != s}


def assumed(drive: str, motion: str) -> tuple[str, str]:
    """Units of drive and motion; one that is not stated is taken to be SI: N and m along a line, else Nm and rad.

    >>> assumed(UNKNOWN, "deg"), assumed(UNKNOWN, "mm"), assumed("N", UNKNOWN)
    (('Nm', 'deg'), ('N', 'mm'), ('N', 'm'))
    """
    along_a_line = factor_of(drive)[1] == "N" if motion in UNSTATED else factor_of(motion)[1] == "m"
    force, place = ("N", "m") if along_a_line else ("Nm", "rad")
    return force if drive in UNSTATED else drive, place if motion in UNSTATED else motion


def turn_of(symbol: str) -> float | None:
    """A full turn in this unit; None if the unit is not an angle or the counts per turn are unknown."""
    factor, si = factor_of(symbol)
    return 2 * math.pi / factor if si == "rad" else None


def _base(symbol: str) -> str:
    """The unit of a multiple: that of ``0.01 A`` is ``A``."""
    found = _MULTIPLE.fullmatch(symbol)
    return found[2] if found is not None and symbol not in _KNOWN else symbol


def is_time(symbol: str) -> bool:
    """Whether a unit is one of time, including ticks."""
    return _base(symbol) in _TIMES or (symbol.startswith("ticks/") and _per_turn(symbol) is not None)


def time_unit_of(column: str, symbol: str) -> str:
    """The unit of a time column: at the end of its name, or within it, as in ``ms_today``.

    >>> time_unit_of("ms_today", UNKNOWN), time_unit_of("micros", UNKNOWN), time_unit_of("time", UNKNOWN)
    ('ms', 'us', 'as logged')
    """
    if symbol != UNKNOWN:
        return symbol
    words = (_SPELLED.get(w, "") for w in re.split(r"[^a-z]+", column.lower()) if len(w) > 1)
    return next((s for s in words if s in _TIMES - {"min", "h", "d"}), symbol)


def seconds_of(symbol: str) -> float:
    """Seconds per unit of time; ``ticks/8000`` counts 8,000 per second.

    >>> seconds_of("ms"), seconds_of("ticks/8000")
    (0.001, 0.000125)
    """
    return 1.0 / float(symbol.partition("/")[2]) if symbol.startswith("ticks/") else factor_of(symbol)[0]


def stated(units: Mapping[str, str]) -> dict[str, str]:
    """Units by role, with roles and symbols in the spelling of the library.

    Raises ColumnError if a unit's role is not known.
    """
    out = {}
    for role, unit in units.items():
        name = OTHER_NAMES.get(role, role)
        if name not in ROLES:
            raise ColumnError(
                f"A unit was given for {role!r}; expected one of {', '.join(ROLES)}, such as --unit position=deg."
            )
        symbol = symbol_of(unit) or multiple_of(unit) or unit
        out[name] = symbol if unit.startswith("N") else unit_for(name, symbol)  # who writes Nm does not mean nm
        if name == "time" and not is_time(out[name]):
            raise ColumnError(
                f"The unit of time is {unit!r}; expected s, ms, us, ns, min, h or, for ticks of 8 kHz, ticks/8000."
            )
    return out


def of_an_axis(units: dict[str, str]) -> None:
    """Raise ColumnError if a unit by role, as `stated` gives it, cannot be that of the role in the log of an axis.

    >>> of_an_axis({"drive": "Arms", "position": "0.001 deg"})
    """
    for role, unit in units.items():
        si = factor_of(unit)[1]
        kinds = {"time": ("s",), "drive": tuple(_KNOWN), "velocity": tuple(f"{u}/s" for u in _MOTIONS)}
        fits = kinds.get(role, (*_MOTIONS, *kinds["velocity"]))
        if is_known(unit) and (si in fits or role == "time"):
            continue
        known = [
            u for u in (*_COMMON, "mrad", "um", "mA", "deg/s", "mm/s") if _KNOWN[u][1] in fits and _KNOWN[u][1] != "s"
        ]
        raise ColumnError(
            f"The unit of {role} is {unit!r}; expected one of {', '.join(known)}, or a multiple of one, such as "
            f"'0.01 {known[0]}'."
        )
