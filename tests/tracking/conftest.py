"""A store of the test's own."""

from __future__ import annotations

from pathlib import Path

import pytest

from whsklearn import tracking
from whsklearn.tracking import open_tracker


@pytest.fixture
def tracker(mlflow_root: Path) -> tracking.Tracker:
    return open_tracker("test", tags={"data": "made up"})
