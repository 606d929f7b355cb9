"""Both files of a report, and that the page holds what was found."""

from __future__ import annotations

import json

from whsklearn.compare import Change, Comparison, write_report


def test_page_and_json(tmp_path):
    numbers = [{"name": "coulomb", "unit": "Nm", "values": [0.05, 0.08], "standard_errors": [0.001, 0.001]}]
    change = Change("coulomb", 0.05, 0.08, 0.002, 10.0, "Nm", 1e-4, [], 0.1)
    found = Comparison("moved", "Coulomb rose.", ["<a>.csv", "b.csv"], [change], {"coulomb": 0.01}, numbers=numbers)
    page = write_report(found, tmp_path / "new").read_text(encoding="utf-8")
    assert "Coulomb rose." in page
    assert "&lt;a&gt;.csv" in page
    assert page.count("<circle") == 2
    assert "http" not in page.replace("http://www.w3.org", "")
    assert json.loads((tmp_path / "new" / "compare.json").read_text(encoding="utf-8"))["verdict"] == "moved"
