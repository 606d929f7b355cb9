"""Which column is what: the names given, numbers, or the names that people give to time, drive and position."""

from __future__ import annotations

import re
from collections.abc import Sequence

from whsklearn.logs.errors import ColumnError
from whsklearn.logs.source import Source

# In the order in which a name is believed; one word of the column's name must equal one of these.
WORDS: dict[str, tuple[str, ...]] = {
    "time": ("time", "t", "timestamp", "stamp", "timestamps", "zeit", "clock", "seconds"),
    "drive": (
        "torque",
        "tau",
        "drive",
        "moment",
        "drehmoment",
        "current",
        "effort",
        "force",
        "load",
        "voltage",
        "u",
        "input",
    ),
    "position": ("position", "pos", "angle", "theta", "q", "lage", "winkel", "encoder", "y", "output"),
    "reference": ("reference", "ref", "setpoint", "desired", "target", "goal", "soll"),
}
_NOT_MEASURED = {*WORDS["reference"], "command", "cmd", "error", "velocity", "speed", "acceleration"}


def guess(source: Source, role: str) -> str | None:
    """The one column whose name says that it is `role`; None if there is none.

    Raises
    ------
    ColumnError
        If several columns say so equally.
    """
    for word in WORDS[role]:
        found = [n for n in source.names if word in words_of(n) and not _other(role, n)]
        if len(found) == 1:
            return found[0]
        if found:
            raise ColumnError(
                f"{source.name} has several columns for {role}: {', '.join(found[:8])}; name one with --{role}."
            )
    return None


def words_of(column: str) -> list[str]:
    """The words in a column's name, its unit among them."""
    return [w for w in re.split(r"[^a-z0-9]+", re.sub(r"(?<=[a-z])(?=[A-Z])", "_", column).lower()) if w]


def _other(role: str, column: str) -> bool:
    """Whether a word in the name says that it is something else: a set position is not the measured one."""
    return role in ("position", "drive") and bool(_NOT_MEASURED & set(words_of(column)))


def by_number(numbers: str, chain: bool = False) -> dict[str, str]:
    """Roles for ``--columns``: two for drive and position, three with time first, four with the reference last.

    Examples
    --------
    >>> by_number("0,3"), by_number("0,1,2")
    ({'drive': '0', 'position': '3'}, {'time': '0', 'drive': '1', 'position': '2'})
    """
    given = [c.strip() for c in numbers.split(",") if c.strip()]
    orders: dict[int, Sequence[str]] = {
        2: ("drive", "position"), 3: ("time", "drive", "position"), 4: ("time", "drive", "position", "reference"),
    }  # fmt: skip
    if len(given) not in orders or (chain and len(given) == 4):
        raise ValueError(
            f"--columns is {numbers!r}; expected two (drive, position), three (time, drive, position) or four with the "
            "reference last, by number from 0 or by name, such as --columns 0,1,2."
        )
    return dict(zip(orders[len(given)], given, strict=True))
