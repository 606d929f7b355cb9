"""Findings in a log, and the report that collects them.

Every finding has a stable code, a title, and an explanation of what to do or what was done.
"""

from __future__ import annotations

import html
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]  # a signal of a log, or its time stamps

TITLES = {
    "LOG001": "Sampling is irregular",
    "LOG002": "Samples are missing",
    "LOG003": "A time stamp is repeated",
    "LOG004": "Time runs backwards",
    "LOG005": "A signal is clipped",
    "LOG006": "Rows are repeated",
    "LOG007": "The position is quantized",
    "LOG008": "The drive is zero throughout",
    "LOG009": "The position never changes",
    "LOG010": "Values are missing",
    "LOG011": "The log was resampled",
    "LOG012": "A wrapped angle was unwrapped",
    "LOG013": "The clock restarts",
    "LOG014": "A held phase was removed",
    "LOG015": "The time stamps were read as dates or ticks",
    "LOG016": "A column may not be what its name says",
    "LOG017": "How the file was read",
    "LOG018": "The position is the integral of the velocity",
    "LOG019": "A unit is not known",
    "LOG020": "The log falls into segments",
    "LOG022": "The drive is a current",
    "LOG021": "Signed numbers were logged as unsigned ones",
    "LOG023": "The encoder jumped",
    "LOG024": "The position was not updated",
    "LOG025": "The log has no time",
}
SEVERITIES = ("info", "warning", "error")


@dataclass(frozen=True)
class Finding:
    """A finding: code, severity (info, warning, error), explanation, rows and a number.

    ``rows`` are positions in the file's data, the first row being 0; at most ten are kept.

    Attributes
    ----------
    code : str
        Stable, such as ``LOG007``.
    severity : {"info", "warning", "error"}
    explanation : str
        What was found and what it means.
    rows : tuple of int
        The first ten rows.
    value : float or None
        A related number.

    References
    ----------
    Ljung 1999, System Identification, 2nd ed., ch. 14, Preprocessing data.

    Examples
    --------
    >>> from whsklearn.logs import Finding
    >>> Finding("LOG008", "error", "The drive is constant.", rows=(0,)).title
    'The drive is zero throughout'
    """

    code: str
    severity: str
    explanation: str
    rows: Sequence[int] | NDArray[Any] = ()
    value: float | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "rows", tuple(int(r) for r in self.rows[:10]))

    @property
    def title(self) -> str:
        """The meaning of the code."""
        return TITLES[self.code]


@dataclass(frozen=True)
class LogReport:
    """Findings about a log, the worst first, and the checks that did not apply, with reasons.

    Attributes
    ----------
    findings : tuple of Finding
        The worst first.
    not_applicable : dict of str to str
        Reasons by check.
    jitter : float
        Largest deviation of a time step from the usual one, as a share of it.
    quantum : float or None
        Quantization step of the position, in its unit.

    References
    ----------
    Ljung 1999, System Identification, 2nd ed., ch. 14, Preprocessing data.

    Examples
    --------
    >>> import numpy as np
    >>> from whsklearn.logs import check_log
    >>> t = np.arange(200) / 100
    >>> report = check_log(t, {"drive": np.zeros(200), "position": np.sin(t)})
    >>> report.codes
    ('LOG008',)
    >>> report.ok
    False
    """

    findings: tuple[Finding, ...] = ()
    not_applicable: dict[str, str] = field(default_factory=dict)
    jitter: float = 0.0
    quantum: float | None = None

    def __post_init__(self) -> None:
        worst_first = sorted(self.findings, key=lambda f: -SEVERITIES.index(f.severity))
        object.__setattr__(self, "findings", tuple(worst_first))

    @property
    def ok(self) -> bool:
        """Whether nothing worse than an info was found."""
        return all(f.severity == "info" for f in self.findings)

    @property
    def codes(self) -> tuple[str, ...]:
        """Codes of the findings, the worst first."""
        return tuple(f.code for f in self.findings)

    @property
    def notes(self) -> tuple[str, ...]:
        """One or two plain sentences for each finding."""
        return tuple(f"{f.title}. {f.explanation}" for f in self.findings)

    def to_dict(self) -> dict[str, Any]:
        """The report as plain numbers and strings, for JSON."""
        return {
            "ok": self.ok,
            "jitter": self.jitter,
            "quantum": self.quantum,
            "findings": [{**asdict(f), "title": f.title} for f in self.findings],
            "not_applicable": dict(self.not_applicable),
        }

    def __str__(self) -> str:
        lines = [f"{f.code} {f.severity}: {f.title}. {f.explanation}" for f in self.findings]
        lines += [f"{code} not checked: {reason}" for code, reason in self.not_applicable.items()]
        return "\n".join(lines) if lines else "Nothing to remark."

    def _repr_html_(self) -> str:
        items = "".join(f"<li>{html.escape(line)}</li>" for line in str(self).splitlines())
        return f"<ul>{items}</ul>"
