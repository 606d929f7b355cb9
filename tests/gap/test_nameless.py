"""What follows the motion has a share above zero, whatever its law; noise has none."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from whsklearn.effects import Scales
from whsklearn.gap import GapFinder
from whsklearn.gap.nameless import generic_basis, nameless, varying_inertia
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


def energy(inertia, angle, speed):
    return 0.5 * inertia(angle) * speed**2


def test_the_power_of_an_inertia_that_varies_is_the_rate_of_its_energy():
    """Torque times speed is d/dt of J(q) v^2 / 2, whatever the motion, as for any conservative load."""
    dt = TIME[1] / 50.0
    t = np.arange(0.0, 5.0, dt)
    q = 1.5 * np.sin(0.9 * t) + 0.4 * np.sin(4.1 * t)
    v = 1.35 * np.cos(0.9 * t) + 1.64 * np.cos(4.1 * t)
    a = -1.215 * np.sin(0.9 * t) - 6.724 * np.sin(4.1 * t)
    motion = SimpleNamespace(position=q, velocity=v, acceleration=a)
    for (order,), columns, _ in varying_inertia(motion, lambda x: x).blocks(None):
        for column, wave in zip(columns[:, 0].T, (np.cos, np.sin), strict=True):
            rate = np.gradient(energy(lambda x, f=wave, k=order: f(k * x), q, v), t)
            np.testing.assert_allclose((column * v)[1:-1], rate[1:-1], atol=1e-4 * np.abs(rate).max())


def crank(order, share, seed):
    """Log of an axis with inertia 0.5 (1 + share cos(order q)) under a PID controller, with exact dry friction."""
    rng, rate, fine = np.random.default_rng(seed), 500.0, 10
    t, h = np.arange(8000) / rate, 1.0 / rate / fine
    f, phase = rng.uniform(0.1, 1.2, 5), rng.uniform(0.0, 2.0 * np.pi, 5)
    path = (2.0 / (1.0 + f) * np.sin(2.0 * np.pi * f * t[:, None] + phase)).sum(axis=1)
    drive, position = np.empty(t.size), np.empty(t.size)
    q = v = integral = 0.0
    for k, goal in enumerate(path - path[0]):
        position[k] = np.round(q * 2**16 / np.pi) * np.pi / 2**16
        drive[k] = 60.0 * (goal - position[k]) - 6.0 * v + 20.0 * integral
        integral += (goal - position[k]) / rate
        for _ in range(fine):
            inertia = 0.5 * (1.0 + share * np.cos(order * q))
            w = v + h * (drive[k] - 0.8 * v + 0.25 * share * order * np.sin(order * q) * v * v) / inertia
            v = np.sign(w) * max(abs(w) - h * 1.5 / inertia, 0.0)
            q += h * v
    return pd.DataFrame({"t": t, "u": drive + 0.01 * rng.standard_normal(t.size), "q": position})


@pytest.mark.slow
@pytest.mark.parametrize(("order", "share", "seed"), [(2, 0.1, 0), (3, 0.05, 1)])
def test_a_crank_is_not_three_waves_of_its_order_with_certainty(order, share, seed):
    finder = GapFinder("servo").fit(crank(order, share, seed), time="t", drive="u", position="q")
    assert finder.verdict_ in ("partial", "unknown")
    assert "torque_ripple" not in [e.name for e in finder.effects_]
