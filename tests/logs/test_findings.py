"""A report says the worst first, in sentences, and can be written down."""

from __future__ import annotations

import json

import numpy as np

from whsklearn.logs import Finding, LogReport
from whsklearn.logs.findings import TITLES


def test_every_code_has_a_title():
    assert all(code.startswith("LOG") and title for code, title in TITLES.items())
    assert len(set(TITLES.values())) == len(TITLES)


def test_at_most_ten_rows_are_kept_as_plain_numbers():
    code = next(iter(TITLES))
    kept = Finding(code, "error", "Fifty rows.", np.arange(50), 0.5)
    assert kept.rows == tuple(range(10))
    json.dumps(LogReport((kept,)).to_dict())


def test_remarks_alone_are_no_trouble():
    code = next(iter(TITLES))
    assert LogReport((Finding(code, "info", "A remark."),)).ok
    assert not LogReport((Finding(code, "warning", "A doubt."),)).ok
    assert str(LogReport()) == "Nothing to remark."


def test_html_is_escaped():
    code = next(iter(TITLES))
    assert "<script>" not in LogReport((Finding(code, "info", "<script>"),))._repr_html_()
