"""A fleet; and the recorded axis of `tests.streaming`."""

from __future__ import annotations

import pytest

from tests.cli.fleet_folder import write_axis
from tests.streaming.conftest import rows, undisturbed

__all__ = ["fleet", "rows", "undisturbed"]


@pytest.fixture(scope="session")
def fleet(tmp_path_factory):
    folder = tmp_path_factory.mktemp("fleet")
    for i in range(8):
        write_axis(folder, f"ax{i:02d}", 0.7 if i != 5 else 1.4, i, parts=1 + i % 2)
    broken = folder / "axis=broken"
    broken.mkdir()
    (broken / "part-0.parquet").write_bytes(b"PAR1 no more")
    return folder
