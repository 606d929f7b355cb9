"""What a plant does unless it knows better."""

from __future__ import annotations

import numpy as np
import pytest

from whsklearn.gap.plant import Plant, Reading


class Bare(Plant):
    pass


def test_what_was_explained_is_the_power_that_is_gone():
    before, after = np.full(50, 5.0), np.full(50, 3.0)
    assert Bare().size(before, after) == pytest.approx(4.0)
    assert Bare().size(after, before) == 0.0


def test_no_family_or_curve_is_asked_for():
    assert list(Bare().family(1.0)) == []
    assert Bare().reading(1.0, 1.0) == Reading()
    assert Bare().learn(1.0) is None
