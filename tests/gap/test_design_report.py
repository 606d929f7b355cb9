"""The page of a design: its numbers are in the units of the log, and its pictures touch the limits that are reached."""

from __future__ import annotations

import json

import numpy as np
import pytest

from whsklearn.gap.design import Design, Limits
from whsklearn.gap.design_report import HEIGHT, MARGIN, against, write_design


def test_the_files_are_in_the_units_of_the_log(tmp_path):
    time = np.linspace(0.0, 1.0, 50)
    made = Design(time, 0.1 * np.sin(time), np.zeros(50), Limits(0.1, 0.2, 0.5, 1.0), {"cogging": True}, {})
    page = write_design(made, Limits(10.0, 20.0, 600.0, 1.0), tmp_path, ("mNm", "deg"))
    reached = json.loads((tmp_path / "design.json").read_text())["reached"]
    assert reached["drive"] == pytest.approx(500.0)
    assert reached["position"] == pytest.approx(np.rad2deg(0.1))
    table = np.loadtxt(tmp_path / "reference.csv", delimiter=",", skiprows=1)
    np.testing.assert_allclose(table[:, 1], np.rad2deg(made.reference), rtol=1e-8, atol=1e-8)
    assert "cogging" in page.read_text(encoding="utf-8")


def test_a_signal_at_its_limit_touches_the_edge():
    picture = against(np.linspace(0.0, 1.0, 5), np.array([0.0, 2.0, 0.0, -2.0, 0.0]), 2.0)
    heights = [float(p.split(",")[1]) for p in picture.points.split()]
    assert (min(heights), max(heights)) == (picture.top, picture.bottom) == (MARGIN, HEIGHT - MARGIN)
