"""The scales of a record, by unit and by name."""

from __future__ import annotations

import numpy as np
import pytest

from whsklearn.effects import Scales


def test_units_name_their_scale():
    s = Scales(torque=2.0, speed=3.0, reach=0.5, centre=1.0, duration=30.0)
    assert s.of("Nm") == (2.0, 0.0)
    assert s.of("rad/s") == (3.0, 0.0)
    assert s.of("rad") == (0.5, 1.0)  # positions count from the middle of the travel
    assert s.of("1") == (None, 0.0)
    assert s.of("Nm", "peak") == (1.5, 0.0)


def test_what_follows_from_them():
    s = Scales(reach=0.5, centre=-1.0, duration=30.0, inertia=0.04, resonance=50.0)
    assert s.extent == 1.5
    assert s.slowest == pytest.approx(0.1)  # three periods in the record
    # two equal halves of the inertia on this compliance ring at the resonance
    reduced = 0.04 / 4
    assert np.sqrt(1 / (s.compliance * reduced)) / (2 * np.pi) == pytest.approx(50.0)
