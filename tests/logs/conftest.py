"""A table of columns written to a file, and read again."""

from __future__ import annotations

import pandas as pd
import pytest

from tests.logs.rig import NAMES
from whsklearn.logs import load_log


@pytest.fixture
def write(tmp_path):
    def to_file(columns, name="axis.csv", **options):
        path = tmp_path / name
        frame = pd.DataFrame(columns)
        frame.to_parquet(path) if path.suffix == ".parquet" else frame.to_csv(path, index=False, **options)
        return path

    return to_file


@pytest.fixture
def load(write):
    def read(columns, **names):
        return load_log(write(columns), **{**NAMES, **names})

    return read
