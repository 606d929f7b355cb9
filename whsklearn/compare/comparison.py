"""The result of a comparison of records, as data for the terminal, ``compare.json`` and the page."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.stats import t as student

from whsklearn.gap.diagnosis import spoken as in_words

SHOWN = 0.05  # of the scale of a number: an interval of 95 %


def spoken(row: Mapping[str, Any]) -> str:
    """Name of a number as a reader sees it, with its part where several share the name.

    >>> spoken({"name": "input_offset"}), spoken({"name": "cogging", "part": "cos 12 q"})
    ('input offset', 'cogging (cos 12 q)')
    """
    name = in_words(str(row["name"]))
    return f"{name} ({row['part']})" if row.get("part") else name


@dataclass(frozen=True)
class Change:
    """One number, or one effect, that changed.

    Attributes
    ----------
    name : str
        ``inertia``, ``delay``, ``gain``, or the canonical name of an effect.
    before, after : float
        Values in ``unit``; the amplitude of an effect with a cosine and a sine, the ratio for the gain.
    standard_error : float
        Standard error of the difference.
    degrees : float
        Degrees of freedom of that error.
    unit : str
    p_value : float
        Probability that records between which nothing changed show such a change in any number.
    rivals : list of str
        Other changes that explain the difference nearly as well.
    share : float
        Rms of the change in the drive, as a share of the rms drive.
    direction : tuple of float, optional
        Phase shift of an effect with a cosine and a sine, and its standard error (rad).
    between : tuple of str, optional
        If there are more than two records, those between which it changed.

    References
    ----------
    Kass and Raftery 1995, Bayes Factors, JASA 90(430), 773-795, for evidence and rivals.

    Examples
    --------
    >>> change = Change("coulomb", 0.05, 0.065, 0.001, 12.0, "Nm", 1e-6, [], 0.1)
    >>> print(change)
    coulomb rose 30 % (0.05 to 0.065 Nm, difference 0.0128 to 0.0172 with 95 %)
    >>> [round(x, 4) for x in change.interval]
    [0.0128, 0.0172]
    """

    name: str
    before: float
    after: float
    standard_error: float
    degrees: float
    unit: str
    p_value: float
    rivals: list[str]
    share: float
    direction: tuple[float, float] | None = None
    between: tuple[str, str] | None = None

    @property
    def change(self) -> float:
        """After less before."""
        return self.after - self.before

    @property
    def interval(self) -> tuple[float, float]:
        """Of the change, 95 %."""
        half = float(student.isf(SHOWN / 2.0, max(self.degrees, 1.0))) * self.standard_error
        return self.change - half, self.change + half

    @property
    def _likely(self) -> str:
        """The interval as a reader sees it, with as many digits as tell its ends apart."""
        low, high = self.interval
        digits = next((d for d in range(3, 9) if f"{low:.{d}g}" != f"{high:.{d}g}"), 9)
        return f"{low:.{digits}g} to {high:.{digits}g}"

    def __str__(self) -> str:
        name, unit = in_words(self.name), "" if self.unit == "1" else f" {self.unit}"
        if name.startswith(("mass at ", "moment at ")):  # of a link only the change is known
            text = f"{name} {self.change:+.3g}{unit} ({self._likely}{unit} with 95 %)"
            return self._with_rest(text)
        least = 2.0 * self.standard_error
        if abs(self.before) <= least < abs(self.after):
            how = "came"
        elif abs(self.after) <= least < abs(self.before):
            how = "went"
        elif self.before * self.after < 0.0:
            how = "changed sign"
        else:
            share = 100.0 * (abs(self.after) / abs(self.before) - 1.0) if self.before else float("inf")
            how = f"{'rose' if share > 0.0 else 'fell'} {abs(share):.3g} %"
        text = f"{name} {how} ({self.before:.3g} to {self.after:.3g}{unit}, difference {self._likely} with 95 %)"
        if self.direction is not None and abs(self.direction[0]) > 2.0 * self.direction[1]:
            turn, error = np.degrees(self.direction)
            text += f" and turned by {turn:.3g} ± {error:.2g} deg (standard error)"
        return self._with_rest(text)

    def _with_rest(self, text: str) -> str:
        """With the records between which it changed, and the rivals."""
        if self.between is not None:
            text += f" between {self.between[0]} and {self.between[1]}"
        if self.rivals:
            text += ", or " + " or ".join(map(in_words, self.rivals))
        return text

    def as_dict(self) -> dict[str, Any]:
        """As ``compare.json`` holds it."""
        out = {
            "name": self.name, "from": self.before, "to": self.after, "change": self.change,
            "standard_error": self.standard_error, "interval": list(self.interval), "unit": self.unit,
            "p_value": self.p_value, "rivals": self.rivals, "share_of_drive": self.share,
        }  # fmt: skip
        if self.direction is not None:
            out["turned_rad"], out["turned_standard_error_rad"] = self.direction
        if self.between is not None:
            out["between"] = list(self.between)
        return out


@dataclass
class Comparison:
    """The answer to the question "what changed?".

    Attributes
    ----------
    verdict : str
        ``moved``, ``nothing`` or ``cannot_tell``.
    sentence : str
    labels : list of str
        Labels of the records.
    changes : list of Change
        The most certain first.
    smallest_seen : dict
        Name -> the smallest change that would have been detected.
    reason : str
        Why nothing can be concluded.
    numbers : list of dict
        One row per number: name, part (of a wave its cosine or sine), unit, values and standard errors of all records,
        spread between and within them.
    notes : list of str
    usable : bool
        Whether every record can be used.
    alpha, seconds : float

    References
    ----------
    DerSimonian and Laird 1986, Meta-analysis in clinical trials, Controlled Clinical Trials 7(3), 177-188, for the
    spread between records.

    Examples
    --------
    >>> found = Comparison("nothing", "Nothing moved.", ["a.csv", "b.csv"], smallest_seen={"inertia": 0.001})
    >>> found.as_dict()["verdict"], found.smallest_rows
    ('nothing', [{'name': 'inertia', 'smallest': 0.001, 'unit': ''}])
    """

    verdict: str
    sentence: str
    labels: list[str]
    changes: list[Change] = field(default_factory=list)
    smallest_seen: dict[str, float] = field(default_factory=dict)
    reason: str = ""
    numbers: list[dict[str, Any]] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    usable: bool = True
    alpha: float = 0.01
    seconds: float = 0.0

    @property
    def smallest_rows(self) -> list[dict[str, Any]]:
        """One row per name: the smallest change that would have been detected, with its unit."""
        units = {r["name"]: r["unit"] for r in reversed(self.numbers)}
        others = {"gain": "1", "mass": "kg", "moment": "kg m"}
        return [
            {"name": n, "smallest": v, "unit": units.get(n, others.get(n.partition(" at ")[0], ""))}
            for n, v in self.smallest_seen.items()
        ]

    def as_dict(self) -> dict[str, Any]:
        """As ``compare.json`` holds it."""
        from whsklearn import __version__

        return {
            "verdict": self.verdict, "sentence": self.sentence, "records": self.labels,
            "changes": [c.as_dict() for c in self.changes], "smallest_seen": self.smallest_seen,
            "reason": self.reason, "numbers": self.numbers, "notes": self.notes, "alpha": self.alpha,
            "seconds": self.seconds, "version": __version__,
        }  # fmt: skip
