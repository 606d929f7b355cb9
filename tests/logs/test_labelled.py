"""Lines that label their numbers."""

from __future__ import annotations

import gzip

import numpy as np
import pytest

from whsklearn.logs.errors import LogError
from whsklearn.logs.labelled import is_labelled, open_labelled

ROWS = [(5001 + 10 * i, 0.5 * i, -0.25 * i) for i in range(6)]


@pytest.mark.parametrize(
    "line",
    ["t: {} q: {} i: {}", "t={}, q={}, i={}", "12:30:01.123 -> t: {} q: {} i: {}", "[INFO] t: {} | q: {} | i: {}"],
)
def test_every_way_of_labelling_gives_the_same_numbers(tmp_path, line):
    text = "\n".join(["ready", *(line.format(*row) for row in ROWS), ""])
    assert is_labelled(text.encode())
    (tmp_path / "a.txt").write_text(text)
    source = open_labelled(tmp_path / "a.txt")
    read = source.fetch(["t", "q", "i"])
    np.testing.assert_array_equal(np.column_stack([read[n].values for n in ("t", "q", "i")]), ROWS)
    assert "1 line(s)" in source.notes[-1]


def test_units_behind_the_numbers_are_kept(tmp_path):
    (tmp_path / "a.txt").write_text("".join(f"speed: {q} rad/s, i: {i} mA\n" for _, q, i in ROWS))
    assert open_labelled(tmp_path / "a.txt").units == {"speed": "rad/s", "i": "mA"}


def test_a_table_is_not_taken_for_one_and_half_an_archive_is_refused(tmp_path):
    assert not is_labelled(b"t,q\n" + b"0.1,2\n" * 20)
    assert not is_labelled(b"")
    packed = gzip.compress(b"t: 1 q: 2\n" * 100)
    (tmp_path / "a.txt.gz").write_bytes(packed[: len(packed) // 2])
    with pytest.raises(LogError, match="not a complete archive"):
        open_labelled(tmp_path / "a.txt.gz")
