"""``gap.html``: one page without outside files, the sentence first, then pictures, then tables."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from whsklearn.gap.diagnosis import Diagnosis

COLOURS = {
    "named": "#1b7f4d",
    "no_gap": "#2b6cb0",
    "partial": "#b7791f",
    "ambiguous": "#b7791f",
    "data_problem": "#b83232",
}
SILENCE = {
    "no_gap": "The base model, with its numbers refitted, explains the log to the noise of its encoder. That is "
    "said of this record only: effects marked not testable would not have shown.",
    "unknown": "More is left than noise, and it can be predicted from the motion on samples not fitted, and no "
    "effect of the catalogue explains it. No name is given rather than that of the nearest neighbour.",
    "coloured_noise": "More is left than encoder noise, but none of it can be predicted from motion, drive or time: "
    "disturbances, or noise with a colour of its own. No name is given.",
    "not_testable": "Nothing is seen, but most effects of the catalogue could not have been seen either: the axis "
    "moves too little or too uniformly.",
    "ambiguous": "Two or more effects explain this record about as well. The next experiment would distinguish them.",
    "partial": "What was added explains only a part of the gap. Something else is missing too.",
}


NO_PICTURES = (
    "The report has no pictures, because matplotlib is not installed; pip install 'whsklearn[plot]' and write it again."
)


def can_draw() -> bool:
    """Whether matplotlib is installed."""
    try:
        import matplotlib  # noqa: F401
    except ImportError:
        return False
    return True


def significant(value: Any) -> str:
    """Four significant digits; text as it is."""
    if isinstance(value, str) or value is None:
        return str(value)
    return f"{value:.4g}"


def render(diagnosis: Diagnosis) -> str:
    """The page as text."""
    from jinja2 import Environment

    environment = Environment(autoescape=True)
    environment.filters["sig"] = significant
    source = Path(__file__).with_name("html_report.html.j2").read_text(encoding="utf-8")
    pictures: list[tuple[str, str, str]] = []
    drawn = can_draw()
    if diagnosis.pictures and drawn:
        from whsklearn.gap.pictures import draw

        pictures = draw(diagnosis)
    return environment.from_string(source).render(
        d=diagnosis,
        pictures=pictures,
        no_pictures="" if drawn else NO_PICTURES,
        unit=diagnosis.pictures.get("units", ("", ""))[1],
        gap_unit=diagnosis.pictures.get("gap_unit", ""),
        colour=COLOURS.get(diagnosis.verdict, "#5a6773"),
        silence=SILENCE.get(diagnosis.verdict, ""),
    )
