"""Effects as flat arrays."""

from __future__ import annotations

import numpy as np

from whsklearn.effects import Cogging, Viscous
from whsklearn.systems._servo_pack import plant_of


def test_rows_are_in_the_order_of_the_effects_with_their_numbers_first():
    effects = [Cogging(0.2, 7.0, 0.3), Viscous(0.1)]
    plant = plant_of(effects, np.zeros(12))
    assert plant.codes.tolist() == [e.code for e in effects]
    for row, e in zip(plant.p, effects, strict=True):
        np.testing.assert_array_equal(row[: len(e.row)], e.row)
        assert not row[len(e.row) :].any()
