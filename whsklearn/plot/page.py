"""The HTML pages of `gap`, `identify` and `compare`: one stylesheet, for screens in light and dark and for paper."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

STYLE = Path(__file__).with_name("page.css")


def html_of(template: Path, filters: Mapping[str, Callable[..., str]] | None = None, **values: Any) -> str:
    """A page as text; the template puts ``style|safe`` into its head.

    Parameters
    ----------
    template : Path
        Of a jinja2 template; what is put into it is escaped.
    filters : mapping of str to callable, optional
        By the names that the template calls them.
    **values
        What the template shows.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = Path(folder, "page.html.j2")
    ...     _ = file.write_text("<p>{{ unit }}</p>")
    ...     html_of(file, unit="<Nm>")
    '<p>&lt;Nm&gt;</p>'
    """
    from jinja2 import Environment

    environment = Environment(autoescape=True)
    environment.filters |= filters or {}
    source = template.read_text(encoding="utf-8")
    return environment.from_string(source).render(style=STYLE.read_text(encoding="utf-8"), **values)
