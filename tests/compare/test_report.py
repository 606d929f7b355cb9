"""Both files of a report, and that the page holds what was found."""

from __future__ import annotations

import json

import numpy as np

from whsklearn.compare import Change, Comparison, write_report
from whsklearn.compare.report import HEIGHT, over_records


def test_page_and_json(tmp_path):
    numbers = [{"name": "coulomb", "unit": "Nm", "values": [0.05, 0.08], "standard_errors": [0.001, 0.001]}]
    change = Change("coulomb", 0.05, 0.08, 0.002, 10.0, "Nm", 1e-4, [], 0.1)
    found = Comparison("moved", "Coulomb rose.", ["<a>.csv", "b.csv"], [change], {"coulomb": 0.01}, numbers=numbers)
    origins = ["<a>.csv: 20 s at 500 Hz.", "b.csv: 10 s at 500 Hz."]
    page = write_report(found, tmp_path / "new", origins).read_text(encoding="utf-8")
    assert "Coulomb rose." in page
    assert "b.csv: 10 s at 500 Hz." in page
    assert "&lt;a&gt;.csv" in page
    assert page.count("<circle") == 2
    assert page.count("0.0500 ± 0.0010") == 2  # in the table and beside the picture
    assert "http" not in page.replace("http://www.w3.org", "")
    assert json.loads((tmp_path / "new" / "compare.json").read_text(encoding="utf-8"))["verdict"] == "moved"


def test_a_picture_keeps_the_order_and_the_scale_of_the_values():
    row = {"values": [3.0, 1.0, 2.0], "standard_errors": [0.1, 0.3, 0.1]}
    picture = over_records(row)
    x, y, top, bottom = (np.array(p) for p in zip(*picture.points, strict=True))
    assert np.all(np.diff(x) > 0.0)
    np.testing.assert_allclose(np.diff(y) / np.diff(row["values"]), np.diff(y)[0] / -2.0)  # one scale, up is more
    np.testing.assert_allclose((bottom - top) / (bottom - top)[0], [1.0, 3.0, 1.0])
    assert 0.0 < top.min() < bottom.max() < HEIGHT
    assert (picture.low, picture.high) == (0.4, 3.2)
