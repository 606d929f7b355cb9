"""What follows the motion has a share above zero, whatever its law; noise has none."""

from __future__ import annotations

import numpy as np
import pytest

from whsklearn.effects import Scales
from whsklearn.gap.nameless import generic_basis, nameless
from whsklearn.gap.tangent import Family, Tangent

N = 3000
TIME = np.arange(N) / 60.0
ANGLE = 1.5 * np.sin(0.9 * TIME) + 0.4 * np.sin(4.1 * TIME)
SPEED = np.gradient(ANGLE, TIME)


def share(gap):
    """The largest share of the power of held-out samples that one block of nameless functions predicts."""
    held = np.arange(N) * 10 // N % 5 >= 3
    drive = np.random.default_rng(100).normal(size=N)
    best = 0.0
    for _, block in generic_basis(Scales(reach=1.9, speed=1.5), ANGLE, SPEED, drive):
        x = np.column_stack([block, np.ones(N)])
        weights = np.linalg.lstsq(x[~held], gap[~held], rcond=1e-6)[0]
        best = max(best, 1.0 - np.sum((gap - x @ weights)[held] ** 2) / np.sum(gap[held] ** 2))
    return best


@pytest.mark.parametrize("width", [0.02, 0.06, 0.2])
@pytest.mark.parametrize("angle", [-0.9, 0.35])
def test_a_bump_at_one_angle_follows_the_motion(width, angle):
    rng = np.random.default_rng(0)
    bump = np.exp(-0.5 * ((ANGLE - angle) / width) ** 2)
    assert share(bump + 0.02 * rng.normal(size=N)) > 0.5


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("colour", [0.0, 0.6])
def test_noise_does_not(seed, colour):
    white = np.random.default_rng(seed).normal(size=N)
    gap = np.zeros(N)
    for i in range(1, N):
        gap[i] = colour * gap[i - 1] + white[i]
    assert share(gap) < 0.04


@pytest.mark.parametrize("angle", [-0.9, 0.35])
def test_one_bump_explains_more_of_a_bump_than_any_wave_with_as_many_numbers(angle):
    rng = np.random.default_rng(0)
    gap = np.exp(-0.5 * ((ANGLE - angle) / 0.08) ** 2) + 0.02 * rng.normal(size=N)
    tangent = Tangent(gap, rng.normal(size=(5, N)), np.ones((N, 1)), N)
    families = nameless(Scales(reach=1.9, speed=1.5), ANGLE, SPEED, rng.normal(size=N))
    most = max(look.size for f in families if f.n_numbers == 3 and (look := tangent.look(f)))
    orders = np.arange(0.5, 60.0, 0.25)
    waves = np.stack([np.cos(orders * ANGLE[:, None]), np.sin(orders * ANGLE[:, None])], axis=2)
    wave = tangent.look(Family("wave", lambda _: [(list(orders), waves, 1.0)], lambda *_: None, 3))
    assert most > 1.2 * wave.size
