"""Friction before sliding: stiffness, end level, loops and memory."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from sklearn.utils import Bunch

from whsklearn.effects import BoucWen, GeneralizedMaxwellSlip, LuGre, PreslidingHysteresis, Scales

X_S = 0.01
SHAPES = [
    PreslidingHysteresis(2.0, X_S),
    LuGre(2.0, X_S, ratio=1.0, damping=0.0),
    GeneralizedMaxwellSlip(2.0, X_S, ratio=1.0),
    BoucWen(2.0, X_S, beta=0.7),
]


def along(path, speed=0.1):
    """Signals of a path travelled at constant speed."""
    path = np.asarray(path, dtype=float)
    step = np.diff(path, prepend=path[0])
    time = np.cumsum(np.abs(step)) / speed
    zeros = np.zeros_like(path)
    return Bunch(time=time, position=path, velocity=speed * np.sign(step), acceleration=zeros, drive=zeros)


def through(*corners, n=4000):
    """A path through corners in straight lines."""
    legs = [np.linspace(a, b, n, endpoint=False) for a, b in itertools.pairwise(corners)]
    return np.concatenate([*legs, [corners[-1]]])


@pytest.mark.parametrize("effect", SHAPES, ids=lambda e: type(e).__name__)
def test_starts_at_zero_and_ends_at_its_torque_in_either_direction(effect):
    torque = effect.contribution(along(through(0.0, 12 * X_S)))
    assert torque[0] == 0.0
    assert torque[-1] == pytest.approx(2.0, rel=1e-3)
    back = effect.contribution(along(through(0.0, -12 * X_S)))
    np.testing.assert_allclose(back, -torque, atol=1e-12)


@pytest.mark.parametrize("effect", SHAPES[:2] + SHAPES[3:], ids=lambda e: type(e).__name__)
def test_stiffness_at_the_start_is_torque_over_distance(effect):
    torque = effect.contribution(along([0.0, 1e-5 * X_S]))
    assert torque[-1] == pytest.approx(2.0 * 1e-5, rel=1e-3)


@pytest.mark.parametrize("effect", SHAPES, ids=lambda e: type(e).__name__)
def test_does_not_depend_on_speed_nor_on_the_sampling_of_the_path(effect):
    fine = along(through(0.0, 3 * X_S, -2 * X_S, n=6000), speed=5.0)
    coarse = along(through(0.0, 3 * X_S, -2 * X_S, n=60), speed=0.01)
    assert effect.contribution(fine)[-1] == pytest.approx(effect.contribution(coarse)[-1], rel=1e-2)


@pytest.mark.parametrize("effect", SHAPES, ids=lambda e: type(e).__name__)
def test_a_loop_costs_work(effect):
    signals = along(through(0.0, X_S, -X_S, X_S, -X_S, X_S))
    torque = effect.contribution(signals)
    assert np.trapezoid(torque, signals.position) > 0.0


def test_dahl_is_bouc_wen_with_beta_one_and_lugre_without_stribeck():
    signals = along(through(0.0, X_S, -X_S, 0.5 * X_S))
    dahl = PreslidingHysteresis(2.0, X_S).contribution(signals)
    np.testing.assert_allclose(BoucWen(2.0, X_S, beta=1.0).contribution(signals), dahl, atol=1e-12)
    np.testing.assert_allclose(LuGre(2.0, X_S, ratio=1.0, damping=0.0).contribution(signals), dahl, atol=1e-12)


def test_dahl_follows_its_closed_form():
    path = through(0.0, 3 * X_S)
    expected = 2.0 * (1.0 - np.exp(-path / X_S))
    np.testing.assert_allclose(PreslidingHysteresis(2.0, X_S).contribution(along(path)), expected, atol=1e-9)


@pytest.mark.parametrize("speed", [0.001, 0.05, 0.2, 2.0])
def test_lugre_slides_at_the_level_of_stribeck(speed):
    effect = LuGre(2.0, X_S, ratio=1.8, velocity=0.1, damping=1e-3)
    torque = effect.contribution(along(through(0.0, 60 * X_S), speed))
    assert torque[-1] == pytest.approx(2.0 * (1.0 + 0.8 * np.exp(-((speed / 0.1) ** 2))), rel=1e-3)


def test_maxwell_slip_remembers_the_outer_loop_and_dahl_does_not():
    def gap(effect):
        """Torque after an inner loop has closed, less the torque where it began."""
        path = through(0.0, 1.2 * X_S, 0.6 * X_S, 1.2 * X_S, n=2000)
        torque = effect.contribution(along(path))
        return abs(torque[-1] - torque[2000])

    assert gap(GeneralizedMaxwellSlip(2.0, X_S, elements=8.0)) < 1e-9
    assert gap(PreslidingHysteresis(2.0, X_S)) > 0.01


def test_mean_slip_distance_of_maxwell_elements_is_the_distance():
    n = 5.0
    path = through(0.0, 2.0 * X_S)
    torque = GeneralizedMaxwellSlip(2.0, X_S, elements=n).contribution(along(path))
    slips = 2.0 * X_S * np.arange(1, n + 1) / (n + 1)
    assert slips.mean() == pytest.approx(X_S)
    expected = 2.0 * np.mean(np.minimum(path[:, None] / slips, 1.0), axis=1)
    np.testing.assert_allclose(torque, expected, atol=1e-9)


def test_searches_of_lugre_begin_with_kicks_of_a_few_levels_over_every_distance():
    scales = Scales(reach=2.0, speed=3.0)
    accelerated = scales.speed**2 / scales.reach
    kicks = []
    for x_s, ratio, _, damping in LuGre.starts(scales):
        assert ratio == 1.0  # the level falls later, once there are bristles at all
        v = np.sqrt(2.0 * accelerated * x_s)  # behind the presliding distance
        kicks.append(damping * v / x_s)
    assert len(kicks) == 3 * len(LuGre.quantities["distance"].starts)
    assert min(kicks) == pytest.approx(0.2 * np.sqrt(2.0))
    assert max(kicks) == pytest.approx(3.0 * np.sqrt(2.0))


def test_a_level_that_does_not_fall_has_no_speed_at_which_it_does():
    assert "velocity_rad_per_s" not in LuGre(1.0, ratio=1.0).labelled()
    assert LuGre(1.0, ratio=1.2, velocity=0.3).labelled()["velocity_rad_per_s"] == 0.3
