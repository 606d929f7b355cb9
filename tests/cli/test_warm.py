"""Everything that is compiled ahead is named, with the time that it took."""

from __future__ import annotations

import re

import pytest
from click.testing import CliRunner

from whsklearn.cli import warm


def test_what_was_compiled_is_told_line_by_line(monkeypatch):
    monkeypatch.setattr(warm, "searches", lambda: iter(["a search"]))
    monkeypatch.setattr(warm, "identifications", lambda: iter(["an axis"]))
    done = CliRunner().invoke(warm.main, [], catch_exceptions=False)
    lines = done.output.splitlines()
    assert lines[0].startswith("the default fit: ")
    assert lines[-1].startswith("an axis: ")
    assert all(re.fullmatch(r"[a-z ]+: \d+\.\d s", line) for line in lines)


@pytest.mark.slow
def test_an_axis_is_simulated_searched_and_identified():
    assert [*warm.searches(), *warm.identifications()] == ["simulation of an axis", "gap", "identify"]
