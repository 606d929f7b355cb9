"""The contract check lets a sound effect of one's own pass and catches broken ones."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import pytest

from tests import own_effect
from whsklearn.checks import EffectContractError, check_effect
from whsklearn.effects import Cogging, Effect, InputOffset, Quantity, base, get_effect
from whsklearn.systems import ServoAxis

TABLE = {"a": 1.0}  # the compiler takes no dict from outside


@dataclass(frozen=True)
class Magnet(own_effect.Magnet):
    """A torque in one place."""

    place: ClassVar[str] = "position"
    name: ClassVar[str] = "magnet"


@dataclass(frozen=True)
class Hum(Effect):
    """An addition to the measured position."""

    amplitude: float = 1e-3

    name: ClassVar[str] = "hum"
    place: ClassVar[str] = "sensor"
    equation: ClassVar[str] = "y = q + c sin(300 t)"
    size: ClassVar[str] = "amplitude"
    port: ClassVar[str] = "output"
    quantities: ClassVar[dict[str, Quantity]] = {"amplitude": Quantity("rad", 1e-6, 1.0, log=True)}

    @staticmethod
    def evaluate(p, time, position, velocity, drive):
        return p[0] * math.sin(300.0 * time)


for _name in ("magnet", "hum"):
    del base._REGISTRY[_name]  # which the tests of all modules share


@pytest.fixture(autouse=True)
def listed(monkeypatch):
    """Both in the catalogue, for one test."""
    monkeypatch.setattr(base, "_REGISTRY", {**base._REGISTRY, "magnet": Magnet, "hum": Hum})


def test_an_effect_of_ones_own_is_one_class():
    check_effect(Magnet)
    check_effect(Hum)
    assert get_effect("magnet") is Magnet


def test_two_effects_of_ones_own_act_together():
    drive = np.full(500, 0.5)
    both = ServoAxis(effects=[Magnet(0.3, 0.1), Hum()]).simulate_drive(drive)
    alone = ServoAxis(effects=[Magnet(0.3, 0.1)]).simulate_drive(drive)
    np.testing.assert_array_equal(both.true_position, alone.true_position)
    np.testing.assert_allclose(both.position - both.true_position, 1e-3 * np.sin(300 * both.time), atol=1e-12)
    twice = ServoAxis(effects=[Magnet(0.1, 0.1), Magnet(0.2, 0.1)]).simulate_drive(drive)
    np.testing.assert_allclose(twice.position, alone.position, atol=1e-12)


class Offset(Magnet):
    """Does something at size zero."""

    @staticmethod
    def evaluate(p, time, position, velocity, drive):
        return 0.01 + p[0] * math.exp(-((position / p[1]) ** 2))


class Square(Magnet):
    """Grows with the square of its size."""

    @staticmethod
    def evaluate(p, time, position, velocity, drive):
        return p[0] ** 2 * math.exp(-((position / p[1]) ** 2))


class Silent(Magnet):
    """Has columns, but nothing that could be simulated."""

    evaluate = None

    def columns(self, signals):
        return np.exp(-((signals.position / self.width) ** 2)).reshape(-1, 1)


class Turned(Magnet):
    """Its columns have the other sign than what is simulated."""

    def columns(self, signals):
        return -super().columns(signals)


class Infinite(Magnet):
    """Divides by velocity."""

    def columns(self, signals):
        with np.errstate(divide="ignore"):
            return (1.0 / signals.velocity).reshape(-1, 1)


class Meddling(Magnet):
    """Writes into the signals."""

    def columns(self, signals):
        signals.position[:] = 0.0
        return super().columns(signals)


class Nameless(Magnet):
    """Has no equation."""

    equation: ClassVar[str] = ""


class Bare(Magnet):
    """Says no unit for its width."""

    quantities: ClassVar[dict[str, Quantity]] = {"torque": Quantity("Nm", -1.0, 1.0)}


@pytest.mark.parametrize(
    ("broken", "complaint"),
    [
        (Offset, "size 0"),
        (Square, "size"),
        (Silent, "cannot be simulated|does not change"),
        (Turned, "not the torque of the columns"),
        (Infinite, "NaN or infinity"),
        (Meddling, "changes the signals"),
        (Nameless, "equation is missing"),
        (Bare, "quantity of width"),
    ],
)
def test_a_broken_effect_is_caught(broken, complaint):
    with pytest.raises(ValueError, match=complaint):
        check_effect(broken)


def test_a_wrong_sign_in_a_built_in_column_would_be_caught(monkeypatch):
    right = Cogging.columns
    monkeypatch.setattr(Cogging, "columns", lambda self, signals: -right(self, signals))
    with pytest.raises(EffectContractError, match="differs from the torque of its columns"):
        check_effect(Cogging)


def test_a_wrong_unit_in_a_built_in_column_would_be_caught(monkeypatch):
    right = InputOffset.columns
    monkeypatch.setattr(InputOffset, "columns", lambda self, signals: 1.1 * right(self, signals))
    with pytest.raises(EffectContractError, match="differs"):
        check_effect(InputOffset)


def test_what_is_no_effect_is_refused():
    with pytest.raises(EffectContractError, match="is not an effect"):
        check_effect(3.0)


def test_an_effect_that_cannot_be_compiled_is_told():
    class Fancy(Magnet):
        @staticmethod
        def evaluate(p, time, position, velocity, drive):
            return p[0] * TABLE["a"]

    with pytest.raises(ValueError, match="cannot be compiled"):
        ServoAxis(effects=[Fancy()]).simulate_drive(np.zeros(10))
