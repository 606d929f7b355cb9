"""Drawn sequences of faults over stream, checkpoint and resume: the end is that of the clean rows.

`benchmarks/faults.py` runs 200 drawn sequences and 100 kills; here are a few of both, and Hypothesis looks for more.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, rule

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "benchmarks"))
faults = pytest.importorskip("faults")


class FaultyStream(RuleBasedStateMachine):
    """A log that is written badly and a stream that dies; what is left at the end is compared."""

    @initialize(seed=st.integers(0, 2**31), block=st.integers(100, 2000))
    def begin(self, seed, block):
        self.folder = tempfile.TemporaryDirectory()
        self.rig, self.block = faults.Rig(Path(self.folder.name), np.random.default_rng(seed)), block
        self.rig.append(30)

    @rule(n=st.integers(1, 120))
    def rows(self, n):
        self.rig.append(n)

    @rule(back=st.integers(1, 25))
    def sent_again(self, back):
        rows = self.rig.clean[-back:]
        self.rig.append_sent_again(back if b"bad\n" not in rows else 1)

    @rule()
    def swapped(self):
        self.rig.append_swapped()

    @rule(stamp=st.sampled_from([1e9, -1e9, 1e300, -5.0]))
    def wrong_stamp(self, stamp):
        self.rig.append_wrong_stamp(stamp)

    @rule()
    def half_a_row(self):
        rest = self.rig.append_half()
        self.run()
        self.rig.write([rest])

    @rule(blocks=st.integers(1, 20))
    def killed(self, blocks):
        self.run(blocks=blocks)

    @rule(at=st.integers(1, 150))
    def a_callback_raises(self, at):
        self.run(fail_at=at)

    @rule(at=st.integers(1, 6))
    def the_disk_is_full(self, at):
        self.run(full_at=at)

    def run(self, **how):
        with faults.small_blocks(self.block):
            return self.rig.run(**how)

    def teardown(self):
        if not hasattr(self, "rig"):
            return
        self.rig.append(10)
        while not self.run():
            pass
        assert faults.compared(self.rig) == (0, 0, 0.0)
        self.folder.cleanup()


TestFaultyStream = FaultyStream.TestCase
TestFaultyStream.settings = settings(
    max_examples=10, stateful_step_count=10, suppress_health_check=list(HealthCheck), derandomize=True
)


@pytest.mark.parametrize("seed", range(5))
def test_a_drawn_sequence(tmp_path, seed):
    assert faults.sequence(seed, tmp_path) == (0, 0, 0.0)


@pytest.mark.skipif(sys.platform == "win32", reason="SIGKILL and fork")
@pytest.mark.filterwarnings("ignore:This process .* is multi-threaded:DeprecationWarning")
def test_killed_now_and_then(tmp_path):
    assert faults.kills(5, tmp_path) == (0, 0, 0.0)
