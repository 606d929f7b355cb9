"""The report of a design: ``reference.csv`` for the rig, ``design.json`` for programs, ``design.html`` for people."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import NamedTuple

import numpy as np

from whsklearn.gap.design import Design, Limits
from whsklearn.gap.pictures import thinned
from whsklearn.gap.record import Array
from whsklearn.gap.report import significant
from whsklearn.logs.files import atomic_write
from whsklearn.logs.units import factor_of
from whsklearn.plot.look import html_of

SAID = {True: "would be named", False: "would not be named", None: "depends on the noise"}
WIDTH, HEIGHT, MARGIN = 680.0, 130.0, 16.0  # px of a picture; the margin above and below holds a line of text


def write_design(
    made: Design, limits: Limits, folder: str | os.PathLike[str], units: tuple[str, str] = ("Nm", "rad")
) -> Path:
    """Write ``reference.csv``, ``design.json`` and ``design.html``.

    ``limits``: as given, in ``units``. ``folder``: created if it does not exist. ``units``: of drive and position;
    empty where the log states none. Returns the path of the page.

    >>> from tempfile import TemporaryDirectory
    >>> reached = Limits(0.4, 1.9, 1.1, 6.0)
    >>> made = Design(np.arange(50.0), *np.zeros((2, 50)), reached, {"cogging": True}, {})
    >>> with TemporaryDirectory() as folder:
    ...     page = write_design(made, Limits(0.5, 2.0, 1.2, 6.0), folder)
    ...     sorted(p.name for p in Path(folder).iterdir())
    ['design.html', 'design.json', 'reference.csv']
    """
    by, far = (factor_of(unit)[0] if unit else 1.0 for unit in units)
    reached = Limits(
        made.reached.position / far, made.reached.speed / far, made.reached.drive / by, made.reached.seconds
    )
    advice = made.advice(units[0] or "of drive", by)
    answer = {"would_be_named": made.named, "limits": limits._asdict(), "reached": reached._asdict(), "advice": advice}
    path, motion = made.reference / far, units[1]
    named = (
        ("position", motion, path, limits.position),
        ("speed", f"{motion}/s" if motion else "", np.gradient(path, made.time), limits.speed),
        ("drive of the simulated axis", units[0], made.drive / by, limits.drive),
    )
    page = html_of(
        Path(__file__).with_name("design.html.j2"),
        {"sig": significant},
        advice=advice,
        rows=[(name, SAID[yes], made.factors.get(name), name in made.factors) for name, yes in made.named.items()],
        pictures=[(name, unit, against(made.time, x, limit)) for name, unit, x, limit in named],
        limits=limits,
        reached=reached,
        units=units,
        seconds=float(made.time[-1]),
        width=WIDTH,
        height=HEIGHT,
    )
    target = Path(folder)
    target.mkdir(parents=True, exist_ok=True)
    table = np.column_stack([made.time, path])
    header = f"time_s,reference_{motion or 'rad'}"
    np.savetxt(target / "reference.csv", table, delimiter=",", header=header, comments="", fmt="%.9g")
    atomic_write(target / "design.json", (json.dumps(answer, indent=2) + "\n").encode())
    atomic_write(target / "design.html", page.encode())
    return target / "design.html"


class Picture(NamedTuple):
    """A signal against its limit: the points of a polyline, and the heights of the limits and of zero, in px.

    >>> picture = against(np.array([0.0, 1.0]), np.array([0.5, -0.5]), 0.5)
    >>> picture.points, picture.limit
    ('0.0,16.0 680.0,114.0', 0.5)
    """

    points: str
    top: float
    zero: float
    bottom: float
    limit: float


def against(time: Array, signal: Array, limit: float) -> Picture:
    """A signal over time, scaled so that the limits on both sides are the edges of the picture.

    >>> picture = against(np.array([0.0, 1.0]), np.array([0.0, -0.5]), 0.5)
    >>> picture.points, picture.top, picture.zero, picture.bottom
    ('0.0,65.0 680.0,114.0', 16.0, 65.0, 114.0)
    """
    half = HEIGHT / 2.0 - MARGIN
    x, y = thinned(time, signal)
    across = WIDTH * np.asarray(x) / max(float(time[-1]), 1e-300)
    up = HEIGHT / 2.0 - half * np.asarray(y) / limit
    points = " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(across, up, strict=True))
    return Picture(points, MARGIN, HEIGHT / 2.0, HEIGHT - MARGIN, limit)
