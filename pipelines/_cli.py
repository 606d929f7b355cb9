"""What every job's command line shares: options, one-sentence errors, tables that fit 100 columns."""

from __future__ import annotations

import functools
import textwrap
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

import click

from whsklearn.tracking import Tracker, TrackingError, open_tracker

ROOT = Path(__file__).resolve().parents[1]
WIDTH = 100


def job(function: Callable[..., None]) -> click.Command:
    """A click command with ``--seed`` and ``--no-track`` whose expected errors are one clear sentence."""

    @click.command(help=function.__doc__, context_settings={"show_default": True, "max_content_width": WIDTH})
    @click.option("--seed", type=click.IntRange(min=0), default=0, help="Seed of everything random.")
    @click.option("--track/--no-track", default=True, help="Record the runs in MLflow, or leave the record out.")
    @functools.wraps(function)
    def command(**kwargs: Any) -> None:
        try:
            function(**kwargs)
        except (ValueError, TrackingError, ImportError, OSError) as error:
            raise click.ClickException(str(error)) from error
        except KeyboardInterrupt:
            click.echo("Interrupted; what was finished is kept.", err=True)
            raise SystemExit(130) from None

    return command


def tracker_for(experiment: str, track: bool, **tags: str) -> Tracker:
    """The record of a job, beneath the checkout's mlruns/ unless the environment names another."""
    if track:
        click.echo("Opening the record of runs (the first time takes some seconds) ...", err=True)
    return open_tracker(experiment, root=ROOT, enabled=track, tags=tags)


def say_where(tracker: Tracker) -> None:
    """Tell where the runs can be seen."""
    if tracker.client is not None:
        click.echo("\nRecorded in MLflow; `make ui` shows the runs.")


def wrapped(text: str) -> str:
    """The text in lines of 100 columns."""
    return textwrap.fill(text, WIDTH)


def table(header: Sequence[str], rows: Iterable[Sequence[Any]], *, title: str = "") -> str:
    """A plain table, first column left, the others right, cut to 100 columns.

    Examples
    --------
    >>> print(table(["model", "NMSE"], [["PEM", 0.01234], ["RLS", None]]))
    model    NMSE
    -------------
    PEM    0.0123
    RLS         -
    """
    cells = [list(header), *[[cell(v) for v in row] for row in rows]]
    widths = [max(len(r[i]) for r in cells) for i in range(len(header))]
    spare = WIDTH - sum(widths) - 2 * (len(widths) - 1)
    widths[0] += min(0, spare)
    lines = [
        "  ".join([r[0][: widths[0]].ljust(widths[0]), *(v.rjust(w) for v, w in zip(r[1:], widths[1:], strict=True))])
        for r in cells
    ]
    rule = "-" * min(WIDTH, max(map(len, lines)))
    return "\n".join([*([title, ""] if title else []), lines[0], rule, *lines[1:]])


def cell(value: Any) -> str:
    """A number in three significant digits, a dash for what is missing."""
    if value is None:
        return "-"
    if isinstance(value, float):
        return f"{value:.3g}" if 1e-3 <= abs(value) < 1e5 or value == 0 else f"{value:.2e}"
    return str(value)
