"""One stylesheet for every page; what is put into a page is escaped, and the stylesheet is not."""

from __future__ import annotations

from whsklearn.plot.page import STYLE, html_of


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
