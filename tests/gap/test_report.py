"""The files of a report: whole, of one diagnosis, and none left of another."""

from __future__ import annotations

import html
import json
import sys

import pytest
from jinja2 import UndefinedError

from whsklearn import ServoAxis
from whsklearn.datasets import make_servo_log
from whsklearn.effects import Cogging
from whsklearn.gap import Diagnosis, GapFinder, NamedEffect
from whsklearn.gap.report import write_report
from whsklearn.models import load_model

FOUND = Diagnosis("named", "Cogging is missing.", effects=[NamedEffect(Cogging(0.1, 12.0), {}, 99.0, 1.0, 0.9)])
FOUND.pictures = {}


class Xml:
    """A repaired model that is no model of ours."""

    def to_xml(self):
        return "<mujoco/>"


def test_the_page_the_numbers_and_the_repaired_model_stand_side_by_side(tmp_path):
    page = write_report(FOUND, tmp_path / "new" / "report", ServoAxis(effects=[Cogging(0.1, 12.0)]))
    folder = page.parent
    assert sorted(p.name for p in folder.iterdir()) == ["gap.html", "gap.json", "repaired.json", "run.json"]
    assert "Cogging is missing." in page.read_text(encoding="utf-8")
    assert json.loads((folder / "gap.json").read_text())["effects"][0]["name"] == "cogging"
    assert [e.name for e in load_model(folder / "repaired.json").effects] == ["cogging"]


def test_nothing_of_an_earlier_model_stays(tmp_path):
    write_report(FOUND, tmp_path, ServoAxis())
    write_report(FOUND, tmp_path, Xml())
    assert not (tmp_path / "repaired.json").exists()
    assert (tmp_path / "repaired.xml").read_text() == "<mujoco/>"
    write_report(FOUND, tmp_path)
    assert not (tmp_path / "repaired.xml").exists()


def test_what_cannot_be_drawn_leaves_the_earlier_report_whole(tmp_path):
    write_report(FOUND, tmp_path, ServoAxis())
    before = {p.name: p.read_bytes() for p in tmp_path.iterdir()}
    broken = Diagnosis("named", "x")
    broken.effects = [object()]
    with pytest.raises(UndefinedError):
        write_report(broken, tmp_path, ServoAxis())
    assert {p.name: p.read_bytes() for p in tmp_path.iterdir()} == before


def test_without_matplotlib_all_is_written_but_the_pictures(tmp_path, monkeypatch):
    drawn = GapFinder("servo").fit(make_servo_log([], duration=6.0, random_state=0))
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.warns(UserWarning, match=r"no pictures.*pip install 'whsklearn\[plot\]'"):
        page = drawn.report(tmp_path)
    assert {"gap.html", "gap.json", "run.json", "repaired.json"} == {p.name for p in tmp_path.iterdir()}
    assert "whsklearn[plot]" in html.unescape(page.read_text(encoding="utf-8"))
    assert "data:image" not in page.read_text(encoding="utf-8")
