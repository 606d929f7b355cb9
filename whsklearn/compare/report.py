"""The report of a comparison: ``compare.json`` for programs and ``compare.html`` for people."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

from whsklearn.compare.comparison import Comparison, spoken
from whsklearn.gap.diagnosis import spoken as in_words
from whsklearn.gap.report import probability, significant
from whsklearn.logs.files import atomic_write
from whsklearn.plot.look import html_of

COLOURS = {"moved": "#1b7f4d", "nothing": "#2b6cb0", "cannot_tell": "#b7791f"}
WIDTH, HEIGHT, MARGIN = 320.0, 120.0, 28.0  # px of a picture; the margin above and below holds a line of text
FINEST = 8  # decimal places; smaller errors are written with an exponent
REACH = 2.0  # standard errors that a whisker reaches either way


def write_report(found: Comparison, folder: str | os.PathLike[str], origins: Sequence[str] = ()) -> Path:
    """Write ``compare.html`` and ``compare.json`` of what was ``found`` into a ``folder``; return the page's path.

    The folder is created if it does not exist. ``origins``: a line on each record, for the head of the page.

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
    page = render(found, origins).encode()
    atomic_write(target / "compare.json", (json.dumps(found.as_dict(), indent=2, allow_nan=False) + "\n").encode())
    atomic_write(target / "compare.html", page)
    return target / "compare.html"


def render(found: Comparison, origins: Sequence[str] = ()) -> str:
    """The page as text, with the lines ``origins`` in place of the labels."""
    return html_of(
        Path(__file__).with_name("report.html.j2"),
        {"sig": significant, "spoken": spoken, "in_words": in_words, "p": probability, "known": with_error},
        c=found,
        origins=origins or [", ".join(found.labels)],
        colour=COLOURS[found.verdict],
        pictures=[over_records(row) for row in found.numbers],
        width=WIDTH,
        height=HEIGHT,
    )


def with_error(value: float, error: float) -> str:
    """A value and its standard error, both to the second digit of the error.

    >>> with_error(1.474e-4, 1.13e-3), with_error(5234.0, 130.0), with_error(0.3, 0.0), with_error(-0.02, 1.2)
    ('0.0001 ± 0.0011', '5230 ± 130', '0.3 ± 0', '0.0 ± 1.2')
    """
    places = 1 - math.floor(math.log10(error)) if error > 0.0 else FINEST
    if places >= FINEST:
        return f"{value:.4g} ± {error:.2g}"
    return " ± ".join(f"{round(x, places) + 0.0:.{max(places, 0)}f}" for x in (value, error))


class _Picture(NamedTuple):
    """A number over the records: (x, y, top, bottom) of every record in px, and the values at the ends of the axis."""

    points: list[tuple[float, float, float, float]]
    low: float
    high: float


def over_records(row: dict[str, Any]) -> _Picture:
    """One number of all records in their order, with whiskers of two standard errors."""
    spans = [(v - REACH * e, v, v + REACH * e) for v, e in zip(row["values"], row["standard_errors"], strict=True)]
    low, high = min(s[0] for s in spans), max(s[2] for s in spans)
    by = (HEIGHT - 2.0 * MARGIN) / max(high - low, 1e-300)
    apart = WIDTH / len(spans)
    points = [
        ((k + 0.5) * apart, HEIGHT - MARGIN - (v - low) * by, HEIGHT - MARGIN - (b - low) * by,
         HEIGHT - MARGIN - (a - low) * by)
        for k, (a, v, b) in enumerate(spans)
    ]  # fmt: skip
    return _Picture(points, low, high)
