"""A recorded axis as a stream of rows, the stream that nothing disturbed, and a fleet."""

from __future__ import annotations

import numpy as np
import pytest

from tests.cli.fleet_folder import write_axis
from tests.cli.recorded_stream import QUICK, axis, stream, write


@pytest.fixture(scope="session")
def rows():
    u, y = axis(2600, 0)
    y += 0.05 * np.random.default_rng(1).normal(size=y.size)
    return [f"{0.01 * i:.2f},{a:.12g},{b:.12g}\n" for i, (a, b) in enumerate(zip(u, y, strict=True))]


@pytest.fixture(scope="session")
def undisturbed(tmp_path_factory, rows):
    folder = tmp_path_factory.mktemp("undisturbed")
    log = write(folder / "log.csv", rows)
    done = stream(log, "--out", folder / "out.jsonl", "--predictions", *QUICK)
    assert done.exit_code == 0, done.output
    return folder


@pytest.fixture(scope="session")
def fleet(tmp_path_factory):
    folder = tmp_path_factory.mktemp("fleet")
    for i in range(8):
        write_axis(folder, f"ax{i:02d}", 0.7 if i != 5 else 1.4, i, parts=1 + i % 2)
    broken = folder / "axis=broken"
    broken.mkdir()
    (broken / "part-0.parquet").write_bytes(b"PAR1 no more")
    return folder
