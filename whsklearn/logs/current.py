"""A current is not a torque: the torque constant is required, and its uncertainty is propagated."""

from __future__ import annotations

import math
import re
from typing import Any

from whsklearn.logs.roles import words_of
from whsklearn.logs.units import UNKNOWN, factor_of

_CURRENT = {"current", "strom", "iq", "ampere", "amps"}
AMPERES = ("A", "Arms", "Apk")  # SI symbols of a current
# What a drive in this SI unit is
DRIVEN_BY = {"Nm": "torque", "N": "force", **dict.fromkeys(AMPERES, "current"), "V": "voltage", "Vrms": "voltage"}
_EFFORT = {"effort", "load", "pwm"}
_FORM = re.compile(r"\s*([0-9.]+(?:e[+-]?\d+)?)\s*(?:(?:\+-|\+/-|±)\s*([0-9.]+(?:e[+-]?\d+)?))?\s*", re.IGNORECASE)


def torque_constant_of(given: Any) -> tuple[float, float]:
    """Nm (or N) per ampere and its standard deviation, from a number, a pair, or text such as ``0.12+-0.01``.

    Raises ValueError if it is none of these, or not positive.

    >>> torque_constant_of("0.12+-0.01"), torque_constant_of(0.5)
    ((0.12, 0.01), (0.5, 0.0))
    """
    parts = given if isinstance(given, tuple | list) else (given,)
    if isinstance(given, str):
        parts = [x for x in found.groups() if x] if (found := _FORM.fullmatch(given)) else []
    try:
        numbers = [float(x) for x in parts]
    except (TypeError, ValueError):
        numbers = []
    if not 1 <= len(numbers) <= 2 or not all(map(math.isfinite, numbers)) or numbers[0] <= 0 or numbers[-1] < 0:
        raise ValueError(
            f"The torque constant is {given!r}; expected Nm per ampere and its standard deviation, such as 0.12+-0.01."
        )
    return numbers[0], numbers[1] if len(numbers) == 2 else 0.0


def is_current(column: str, unit: str) -> bool:
    """Whether a column holds a current, by its unit or, without one, by its name.

    >>> is_current("i_q", UNKNOWN), is_current("u", "mA"), is_current("torque", "Nm")
    (True, True, False)
    """
    si = factor_of(unit)[1]
    return si in AMPERES or (si == UNKNOWN and bool(_CURRENT & set(words_of(column))))


def doubt(column: str, unit: str) -> str:
    """The question to ask before a recognised column is used as the drive; empty for a torque or a voltage.

    >>> doubt("torque", UNKNOWN), doubt("effort [Nm]", "Nm")
    ('', '')
    """
    if is_current(column, unit):
        return (
            f"Column {column!r} is a current, not a torque. For results in Nm add --torque-constant 0.12+-0.01 (Nm/A "
            f"with its standard deviation); for results in amperes name it, --drive {column!r}."
        )
    if factor_of(unit)[1] == UNKNOWN and _EFFORT & set(words_of(column)):
        return (
            f"Column {column!r} may be a torque, a current or a percentage of either. Name it and its unit: --drive "
            f"{column!r} --unit drive=Nm (or A, with --torque-constant; or %)."
        )
    return ""
