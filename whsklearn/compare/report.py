"""The report of a comparison: ``compare.json`` for programs and ``compare.html`` for people."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

from whsklearn.compare.comparison import Comparison
from whsklearn.gap.report import significant
from whsklearn.logs.files import atomic_write
from whsklearn.plot.page import html_of

COLOURS = {"moved": "#1b7f4d", "nothing": "#2b6cb0", "cannot_tell": "#b7791f"}
WIDTH, ROW, MARGIN = 320.0, 16.0, 8.0  # px of a row of the pictures
REACH = 2.0  # standard errors that a whisker reaches either way


def write_report(found: Comparison, folder: str | os.PathLike[str]) -> Path:
    """Write ``compare.html`` and ``compare.json``.

    Parameters
    ----------
    found : Comparison
    folder : str or path
        Created if it does not exist.

    Returns
    -------
    path
        Path of the page.

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> from whsklearn.compare import Comparison, write_report
    >>> with TemporaryDirectory() as folder:
    ...     write_report(Comparison("nothing", "Nothing moved.", ["a.csv", "b.csv"]), folder).name
    'compare.html'
    """
    target = Path(folder)
    target.mkdir(parents=True, exist_ok=True)
    page = render(found).encode()
    atomic_write(target / "compare.json", (json.dumps(found.as_dict(), indent=2, allow_nan=False) + "\n").encode())
    atomic_write(target / "compare.html", page)
    return target / "compare.html"


def render(found: Comparison) -> str:
    """The page as text."""
    return html_of(
        Path(__file__).with_name("report.html.j2"),
        {"sig": significant},
        c=found,
        colour=COLOURS[found.verdict],
        pictures=[whiskers(row) for row in found.numbers],
        width=WIDTH,
        row=ROW,
    )


def whiskers(row: dict[str, Any]) -> list[tuple[float, float, float]]:
    """(low, middle, high) of every record in pixels from the left, for one number.

    Examples
    --------
    >>> whiskers({"values": [1.0, 2.0], "standard_errors": [0.25, 0.25]})
    [(8.0, 84.0, 160.0), (160.0, 236.0, 312.0)]
    """
    spans = [(v - REACH * e, v, v + REACH * e) for v, e in zip(row["values"], row["standard_errors"], strict=True)]
    low, high = min(s[0] for s in spans), max(s[2] for s in spans)
    by = (WIDTH - 2.0 * MARGIN) / max(high - low, 1e-300)
    return [(MARGIN + (a - low) * by, MARGIN + (b - low) * by, MARGIN + (c - low) * by) for a, b, c in spans]
