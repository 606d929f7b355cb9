"""The page of recorded runs."""

from __future__ import annotations

from whsklearn.cli.ui import page


def test_page_opens_on_runs_not_on_traces():
    address = page("http://127.0.0.1:5000", "3")
    assert address.startswith("http://127.0.0.1:5000/#/experiments/3/runs?workflowType=machine_learning")
    assert page("http://127.0.0.1:5000", None) == "http://127.0.0.1:5000"
