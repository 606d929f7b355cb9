"""Properties of the parts: filter, split, noise level, lattice, bounded least squares, closure, p-values."""

from __future__ import annotations

import numpy as np
import pytest

from whsklearn.gap.filters import autoregression, gaussian_derivatives, residual_filter, whiten
from whsklearn.gap.least_squares import least_squares
from whsklearn.gap.localisation import locate
from whsklearn.gap.plants.servo_sensors import unfold
from whsklearn.gap.proof import closure
from whsklearn.gap.record import blocks, lattice, noise_level

RNG = np.random.default_rng(0)


def test_filter_turns_a_lag_of_position_into_the_torque_behind_it():
    dt, inertia = 1e-3, 0.05
    seen_through = residual_filter(dt, inertia, 1e-6, 1.0, tracking=2.0)
    t = np.arange(8000) * dt
    l1, l2 = seen_through.gains[0] / dt, seen_through.gains[1] / dt
    w = 2 * np.pi * 1.5
    torque = 0.1 * np.sin(w * t)
    response = 1.0 / (-(w**2) + 1j * w * l1 + l2)  # (p^2 + l1 p + l2)^-1
    e = 0.1 / inertia * np.imag(response * np.exp(1j * w * t))
    seen = seen_through.torque(e)[50:-50]
    assert seen == pytest.approx(seen_through.blur(torque)[50:-50], abs=2e-3)


def test_decimation_keeps_samples_in_place():
    seen_through = residual_filter(1e-3, 0.05, 1e-3, 1.0, tracking=2.0)
    ramp = np.arange(6000.0)
    middle = slice(20, -20)
    assert seen_through.blur(ramp)[middle] == pytest.approx(seen_through.pick(ramp)[middle], abs=1e-6)


def test_noise_gain_is_that_of_white_noise():
    seen_through = residual_filter(1e-3, 0.05, 1e-4, 1.0, tracking=2.0)
    d = seen_through.torque(1e-4 * RNG.standard_normal(100_000))
    assert d[50:-50].std() == pytest.approx(1e-4 * seen_through.noise_gain, rel=0.1)


def test_blocks_leave_two_fifths_out_in_five_stretches():
    held, train = blocks(10_000)
    assert train.mean() == pytest.approx(0.6, abs=0.01)
    assert sorted(set(held[held >= 0])) == [0, 1, 2, 3, 4]
    assert not np.any(train & (held >= 0))


@pytest.mark.parametrize("sigma", [1e-5, 1e-3])
def test_noise_level_sees_through_motion(sigma):
    t = np.arange(20_000) * 1e-3
    assert noise_level(np.sin(3 * t) + sigma * RNG.standard_normal(t.size)) == pytest.approx(sigma, rel=0.15)


def test_lattice_is_found_and_not_invented():
    x = np.cumsum(RNG.standard_normal(5000)) * 0.01
    assert lattice(np.round(x / 0.004) * 0.004) == pytest.approx(0.004, rel=1e-6)
    assert lattice(x) == 0.0


def test_bounds_hold_and_the_minimum_is_found():
    target = np.array([1.0, 5.0])
    fit = least_squares(
        lambda x: np.concatenate([x - target, 0.1 * x]),
        np.zeros(2),
        np.full(2, 1e-4),
        (np.full(2, -3.0), np.full(2, 3.0)),
    )
    assert fit.x == pytest.approx([1 / 1.01, 3.0], abs=1e-3)


def test_whitening_whitens():
    x = np.zeros(20_000)
    w = RNG.standard_normal(x.size)
    for i in range(1, x.size):
        x[i] = 0.9 * x[i - 1] + w[i]
    e = whiten(x, autoregression(x, 12, 0.0))
    assert abs(e[1:] @ e[:-1] / (e @ e)) < 0.03


@pytest.mark.parametrize(
    ("before", "after", "floor", "share"), [(2, 1, 1, 1.0), (2, 2, 1, 0.0), (2, 3, 1, -1.0), (1, 1, 1, 0.0)]
)
def test_closure(before, after, floor, share):
    assert closure(before, after, floor) == pytest.approx(share)


def test_beside_a_base_that_diverges_a_repair_counts_from_no_model_at_all():
    assert closure(1e6, 2.0, 1.0, spread=3.0) == pytest.approx(closure(3.0, 2.0, 1.0))
    assert closure(1e6, 5.0, 1.0, spread=3.0) == 0.0  # better than the base, and no better than none
    assert closure(1e6, 2e6, 1.0, spread=3.0) < 0.0
    assert closure(2.0, 1.5, 1.0, spread=3.0) == pytest.approx(0.5)


def test_p_values_are_level_for_dependent_samples_and_small_for_a_gap_that_follows():
    rng = np.random.default_rng(1)
    n, hits = 1500, 0
    x = np.sin(np.arange(n) * 0.05) + 0.2 * np.cumsum(rng.standard_normal(n)) / np.sqrt(n)
    for _ in range(60):
        gap = np.convolve(rng.standard_normal(n + 20), np.ones(21), mode="valid")
        hits += locate({"position": (x, "rad")}, gap, rng)[0].p_value <= 0.05
    assert hits <= 9
    assert locate({"position": (x, "rad")}, np.cos(3 * x) + 0.3 * rng.standard_normal(n), rng)[0].p_value < 0.02


def test_folded_reading_is_unfolded_and_a_straight_one_left_alone():
    t = np.arange(8000) * 1e-3
    q = 2 * np.sin(2 * t)
    straight = unfold(np.abs(q), 1e-3)
    assert straight is not None
    assert min(np.abs(straight - q).max(), np.abs(straight + q).max()) < 0.02
    assert unfold(q, 1e-3) is None
    assert unfold(1 + np.cos(2 * t), 1e-3) is None  # touches zero at rest


def test_numbers_of_a_linear_axis_are_in_newtons_and_metres():
    from whsklearn.effects import Cogging, QuadraticDrag
    from whsklearn.gap.diagnosis import NamedEffect

    units = ("N", "m")
    drag = NamedEffect(QuadraticDrag(2.0), {"coefficient_nm_s2_per_rad2": 0.1}, 50.0, 0.9, 1.0, units=units)
    assert drag.parameters == {"coefficient_n_s2_per_m2": 2.0}
    assert drag.errors == {"coefficient_n_s2_per_m2": 0.1}
    assert NamedEffect(Cogging(0.3, 12.0), {}, 50.0, 0.9, 1.0, units=units).parameters == {
        "amplitude_n": 0.3, "order": 12.0, "phase_rad": 0.0
    }  # fmt: skip


def test_what_still_follows_the_motion_keeps_a_name_from_being_confident():
    from whsklearn.gap.verdict import verdict_of

    assert verdict_of(["stribeck"], 0.97, [[]], quiet=False, follows=0.7, left=1.1, still=0.0) == "named"
    assert verdict_of(["stribeck"], 0.97, [[]], quiet=False, follows=0.7, left=1.1, still=0.08) == "partial"


@pytest.mark.parametrize("dt", [1e-4, 1e-3, 5e-3, 0.02])
@pytest.mark.parametrize("width", [0.7, 1.0, 4.4, 20.0])
def test_derivative_kernels_are_exact_on_polynomials_at_every_rate_and_width(dt, width):
    t = np.arange(400) * dt
    for kernel, order in zip(gaussian_derivatives(width * dt, dt), range(3), strict=True):
        assert np.convolve(np.full(400, 100.0), kernel, mode="valid") * dt**order == pytest.approx(
            100.0 if order == 0 else 0.0, abs=1e-8
        )
        for power in range(1, 3):
            seen = np.convolve(t**power, kernel, mode="valid")
            half = kernel.size // 2
            inner = t[half : t.size - half]
            wanted = {(1, 1): 1.0, (1, 2): 0.0, (2, 1): 2 * inner, (2, 2): 2.0}.get((power, order))
            if wanted is not None:
                assert seen == pytest.approx(wanted, abs=1e-6 * t[-1] / dt**order)
