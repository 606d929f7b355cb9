"""Records of a stream on their way to a file."""

from __future__ import annotations

import os

import pytest

from whsklearn.streaming.records import Out, OutputLost


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="no /dev/full")
def test_records_that_find_no_room_are_an_error_with_the_files_name(tmp_path):
    out = Out(tmp_path / "out", None)
    out.file.close()
    out.file = open("/dev/full", "ab", buffering=0)
    out({"kind": "estimate"})
    with pytest.raises(OutputLost, match="out cannot be written"):
        out.settle()
    out.close()
