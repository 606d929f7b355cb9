"""A recorded axis as a stream of rows, and the stream that nothing disturbed."""

from __future__ import annotations

import numpy as np
import pytest

from tests.streaming.recorded_stream import QUICK, axis, stream, write


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
