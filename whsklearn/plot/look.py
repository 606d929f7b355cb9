"""The look that displays share, and that of the HTML pages of `gap`, `identify` and `compare`.

A page has one stylesheet, for screens in light and dark and for paper.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

# Okabe and Ito's palette, which people with any colour vision can tell apart; black is for the measurement.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#7F7F7F", "#B8A000")
STYLES = ("-", ":", "-.")  # the dashes are for the truth
TRUTH = (0, (6, 4))  # the dashes of what is known, not estimated
STYLE = Path(__file__).with_name("page.css")


def titled(name: str, unit: str) -> str:
    """Name and unit of an axis; the name alone if the log has no unit."""
    return f"{name} ({unit})" if unit else name


class Display:
    """Shared by all displays: figure and axes in one style."""

    figure_: Any
    axes_: Any

    def plot(self, axes: Any = None) -> Any:
        """Draw it; ``figure_`` and ``axes_`` hold the picture. ``axes``: where to draw; a new figure by default."""
        raise NotImplementedError

    def _axes(self, axes: Any, rows: int, columns: int, size: tuple[float, float], **kwargs: Any) -> list[Any]:
        """Given axes, or new ones of a common look."""
        import matplotlib.pyplot as plt

        if axes is None:
            _, grid = plt.subplots(rows, columns, figsize=size, layout="constrained", squeeze=False, **kwargs)
            axes = list(grid.flat)
        axes = list(np.atleast_1d(np.asarray(axes, dtype=object)).flat)
        if len(axes) < rows * columns:
            raise ValueError(f"{type(self).__name__}.plot got {len(axes)} axes, expected {rows * columns}.")
        for ax in axes:
            ax.spines[["top", "right"]].set_visible(False)
            ax.grid(True, color="0.92", linewidth=0.8)
            ax.set_axisbelow(True)
        self.figure_, self.axes_ = axes[0].figure, axes
        return axes


def html_of(template: Path, filters: Mapping[str, Callable[..., str]] | None = None, **values: Any) -> str:
    """A page as text; the template puts ``style|safe`` into its head.

    ``template``: of a jinja2 template; what is put into it is escaped. ``filters``: by the names that the template
    calls them. ``**values``: what the template shows.
    """
    from jinja2 import Environment

    environment = Environment(autoescape=True)
    environment.filters |= filters or {}
    source = template.read_text(encoding="utf-8")
    return environment.from_string(source).render(style=STYLE.read_text(encoding="utf-8"), **values)
