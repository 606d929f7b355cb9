"""A log of one hinge that MuJoCo made."""

from __future__ import annotations

import numpy as np
import pytest

from tests.simulators.axis_xml import XML
from whsklearn.gap.record import ServoRecord
from whsklearn.simulators import MuJoCoSimulator


@pytest.fixture(scope="module")
def record():
    t = np.arange(1500) / 250.0
    drive = 0.8 * np.sin(2 * np.pi * 0.8 * t) + 0.5 * np.sin(2 * np.pi * 2.3 * t + 1)
    first = ServoRecord(t, drive, np.zeros_like(t))
    position = np.zeros_like(t)
    for _ in range(2):  # the replay is held near the log, so the log is its own
        position = MuJoCoSimulator(XML.format(joint=""), joint="axis").replay(
            ServoRecord(t, drive, position + 1e-12 * t), 100.0, restart="smoothed"
        )
    return ServoRecord(t, first.drive, position)
