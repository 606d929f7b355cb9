"""Columns of a candidate are the catalogue's equation, at any size of it."""

from __future__ import annotations

import numpy as np
import pytest

from whsklearn.gap.plants.servo_candidates import ColumnSignals, catalogue
from whsklearn.gap.plants.servo_model import ServoTerm

RNG = np.random.default_rng(3)
TIME = np.arange(400) * 0.01
ANGLE = 1.2 * np.sin(2.1 * TIME) + 0.3 * np.sin(7.0 * TIME)
MOTION = ColumnSignals(TIME, ANGLE, np.gradient(ANGLE, TIME), RNG.normal(size=400), RNG.normal(size=400))
SHAPES = {"order": 5.0, "frequency": 2.0, "time": 1.7}
LINEAR = [c for c in catalogue() if c.linear and c.cls.port == "torque" and not c.cls.later]


def shape_of(kind):
    """Numbers of a shape within what a record shows."""
    return tuple(SHAPES.get(f, 0.4) for f in kind.fields[kind.linear :])


@pytest.mark.parametrize("kind", LINEAR, ids=lambda c: c.label)
@pytest.mark.parametrize("size", [0.3, 1.7])
def test_columns_times_sizes_are_the_effects_own_torque(kind, size):
    sizes = (size, 0.4)[: kind.linear]
    columns = kind.unit_columns(shape_of(kind), MOTION)
    assert columns.shape == (TIME.size, kind.linear)
    torque = ServoTerm(kind, (*sizes, *shape_of(kind))).effect.contribution(MOTION)
    np.testing.assert_allclose(columns @ np.array(sizes), torque, atol=1e-10)


def test_a_soft_sign_is_close_to_the_sign_away_from_rest():
    kind = next(c for c in LINEAR if c.name == "coulomb")
    sharp, soft = (kind.unit_columns((), MOTION._replace(kappa=k))[:, 0] for k in (None, 50.0))
    fast = np.abs(MOTION.velocity) > 0.2
    np.testing.assert_array_equal(sharp, np.sign(MOTION.velocity))
    np.testing.assert_allclose(soft[fast], sharp[fast], atol=1e-6)
    assert np.all(np.abs(soft) < 1.0 + 1e-12)
