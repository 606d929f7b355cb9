"""All displays share axes, colours and refusals; all pages one stylesheet, and what is put into one is escaped."""

from __future__ import annotations

import matplotlib.pyplot as plt
import pytest

from whsklearn.plot.look import STYLE, Display, html_of


def test_given_axes_are_drawn_on_and_too_few_refused():
    display = Display()
    _, grid = plt.subplots(2, 1)
    assert display._axes(grid, 2, 1, (4, 3)) == list(grid)
    assert display.figure_ is grid[0].figure
    with pytest.raises(ValueError, match="got 2 axes, expected 3"):
        display._axes(grid, 3, 1, (4, 3))


def test_the_style_comes_as_it_is_and_values_are_escaped(tmp_path):
    template = tmp_path / "page.html.j2"
    template.write_text("<style>{{ style|safe }}</style><p>{{ name|loud }}</p>")
    page = html_of(template, {"loud": str.upper}, name="<q>")
    assert page == f"<style>{STYLE.read_text(encoding='utf-8')}</style><p>&lt;Q&gt;</p>"


def test_a_dark_screen_sets_every_colour_and_paper_none():
    style = STYLE.read_text(encoding="utf-8")
    light, dark = (set(part.split("}")[0].split(";")) for part in style.split(":root{")[1:])
    names = {entry.split(":")[0] for entry in light if entry.startswith("--")}
    assert {entry.split(":")[0] for entry in dark} == names
    assert "@media screen and (prefers-color-scheme:dark)" in style
