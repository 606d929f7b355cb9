"""An effect of a user's own runs compiled as it is written."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import pytest

from whsklearn import ServoAxis
from whsklearn.effects import CableSpring, Effect, Quantity
from whsklearn.effects import base as catalogue


@pytest.fixture
def spring():
    """A cable spring, written by a user."""

    @dataclass(frozen=True)
    class Mine(Effect):
        stiffness: float = 0.1
        centre: float = 0.0
        name: ClassVar[str] = "mine"
        place: ClassVar[str] = "position"
        equation: ClassVar[str] = "c (q - q_0)"
        size: ClassVar[str] = "stiffness"
        quantities: ClassVar[dict[str, Quantity]] = {
            "stiffness": Quantity("Nm/rad", 0.0, 10.0),
            "centre": Quantity("rad", -3.0, 3.0),
        }

        @staticmethod
        def evaluate(p, time, position, velocity, drive):
            return p[0] * (position - p[1]) + 0.0 * math.cos(velocity)

    yield Mine
    catalogue._REGISTRY.pop("mine")


def test_it_is_simulated_as_the_catalogues_own(spring):
    drive = np.sin(np.arange(1500) / 150)
    own = ServoAxis().with_effect(spring(0.8, 0.1)).simulate_drive(drive, noise=False).true_position
    ours = ServoAxis().with_effect(CableSpring(0.8, 0.1)).simulate_drive(drive, noise=False).true_position
    np.testing.assert_allclose(own, ours, atol=1e-9)


def test_its_column_is_its_equation(spring):
    q = np.linspace(-2, 2, 30)
    np.testing.assert_allclose(spring(0.8, 0.1).value(position=q), 0.8 * (q - 0.1), atol=1e-12)
