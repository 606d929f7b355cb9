"""The free run of an axis and its sensitivities."""

from __future__ import annotations

import numpy as np
import pytest

from tests.recursion.axis_log import TRUTH, axis_log, slow_drive
from whsklearn.recursion.batch.axis_free_run import (
    HANGS,
    axis_motion,
    covariance_of,
    fit_pieces,
    fit_state,
    sensitivities,
)


@pytest.mark.parametrize(
    ("form", "more"),
    [
        ({"orders": HANGS}, [0.05, 0.02]),
        ({"powers": 3}, [0.05, 0.02, 0.03]),
        ({"orders": HANGS, "powers": 2}, [0.05, 0.02, 0.03, 0.02]),
        ({"loaded": True}, [0.05]),
        ({"early": True}, [0.02, 0.8]),
        ({"early": True, "orders": np.array([1.0, 7.0]), "loaded": True}, [0.05, 0.02, 3e-3, -4e-3, 0.05, 0.02, 0.8]),
    ],
    ids=str,
)
@pytest.mark.parametrize("of_position", [False, True])
def test_the_free_run_of_an_axis_has_exact_sensitivities(of_position, form, more):
    log = axis_log(slow_drive(400, 2), 0.01, (0.3,), **form)._replace(
        of_position=of_position, start=np.array([[0.1, 0.0]])
    )
    theta = np.r_[0.05, 0.12, 0.1, 0.01, more, 0.1]
    rows = sensitivities(theta, log)[1]
    for i in range(theta.size):
        step = np.zeros(theta.size)
        step[i] = 1e-6
        differences = (axis_motion(theta + step, log) - axis_motion(theta - step, log)) / 2e-6
        np.testing.assert_allclose(rows[i], differences, atol=1e-5 * np.abs(differences).max())
    np.testing.assert_array_equal(sensitivities(theta, log, of_states=True)[1], rows[-2:])


@pytest.mark.parametrize("seed", [2, 3])
def test_a_reversal_is_as_exact_as_the_rest_of_the_run(seed):
    """The drive is held, so that all that four steps a sample leave out lies where the axis stops and turns."""
    log = axis_log(slow_drive(1000, seed), 0.01)._replace(of_position=True)
    coarse, fine = (axis_motion(TRUTH, log._replace(u=np.repeat(log.u[:, :1], n, axis=1))) for n in (4, 256))
    v = np.diff(fine)
    assert np.sum(v[1:] * v[:-1] < 0.0) + np.sum((v[1:] == 0.0) & (v[:-1] != 0.0)) > 10
    assert np.abs(coarse - fine).max() < 2e-5 * np.ptp(fine)  # 6e-4 and more where a step that crosses rest ends there


def test_pieces_are_fitted_to_their_least_squares_from_numbers_that_are_far_off():
    """States that stayed where they were before a step had it refused, at up to sixty times the least."""
    log = axis_log(slow_drive(4000, 4), 0.005)._replace(of_position=True)
    q, v = axis_motion(TRUTH, log), axis_motion(TRUTH, log._replace(of_position=False))
    noisy = q + 1e-4 * np.random.default_rng(0).standard_normal(q.size)
    begins = np.arange(0, 4001, 50)
    log = log._replace(target=noisy, bounds=begins, start=np.column_stack([v, q])[begins[:-1]])
    least = fit_pieces(TRUTH, log)
    for factors in ([1.03, 1.3, 0.97, 1.1], [0.9, 0.5, 1.2, 0.5]):
        assert fit_pieces(TRUTH * factors, log).cost == pytest.approx(least.cost, rel=1e-3)


def test_a_pendulum_keeps_its_energy():
    """J v^2 / 2 - k1 cos q of a free swing of 1 rad, by the symplectic steps of the run."""
    theta = np.array([0.05, 0.0, 0.0, 0.0, 2.0, 0.0])
    log = axis_log(np.zeros(4000), 0.001, orders=HANGS)._replace(start=np.array([[0.0, 1.0]]))
    v, q = axis_motion(theta, log), axis_motion(theta, log._replace(of_position=True))
    energy = 0.5 * theta[0] * v**2 - theta[4] * np.cos(q)
    assert np.ptp(q) == pytest.approx(2.0, rel=1e-3)
    np.testing.assert_allclose(energy, energy[0], atol=5e-3 * theta[4])


def test_a_start_that_runs_away_has_no_fit_and_says_nothing():
    """A spring that pushes: e^(20 t) in the position, whose sensitivities have squares that are no numbers."""
    log = axis_log(slow_drive(6000, 2), 0.01, powers=1)._replace(of_position=True)
    fitted = fit_pieces(np.array([0.05, 0.1, 0.0, 0.0, -20.0]), log)
    assert fitted.cost == np.inf


def test_an_axis_that_turns_one_way_shows_only_the_sum_of_friction_and_offset():
    log = axis_log(1.0 + 0.3 * np.sign(slow_drive(3000, 3)))._replace(start=np.array([[1.0, 0.0]]))
    noise = 1e-3 * np.random.default_rng(0).standard_normal(3000)
    fitted = fit_pieces(np.array([0.05, 0.1, 0.2, 0.12]), log._replace(target=axis_motion(TRUTH, log) + noise))
    assert fitted.theta[2:].sum() == pytest.approx(0.32, rel=0.01)
    deviation = np.sqrt(np.diag(fitted.covariance))
    assert (np.abs(fitted.theta - TRUTH) < 2.0 * deviation).all()
    assert deviation[2] > 0.1  # of a sum of 0.32
    assert np.sqrt(fitted.covariance[2:, 2:].sum()) < 0.005


@pytest.mark.parametrize("size", [0.0, 1e-158])
def test_a_number_that_next_to_nothing_shows_may_be_off_by_all_of_itself(size):
    """Its variance was 1 / 1e-314, which is infinite, with a warning of NumPy's."""
    rng = np.random.default_rng(0)
    rows = np.vstack([rng.standard_normal(200), np.full(200, size)])
    covariance = covariance_of(rows, rng.standard_normal(200), np.array([1.0, 0.4]), np.array([0, 200]))
    assert covariance[1, 1] == pytest.approx(0.4**2)
    assert covariance[0, 0] == pytest.approx(1.0 / 200, rel=0.5)


def test_below_its_dry_friction_an_axis_stands():
    assert not axis_motion(TRUTH, axis_log(np.full(200, 0.25))).any()
    assert axis_motion(TRUTH, axis_log(np.full(200, 0.35)))[-1] > 0


def test_the_state_before_a_window_is_found_from_the_wrong_side_of_standstill_too():
    """And is never worse than the one that it began with: steps that are too long are shortened."""
    u, theta = slow_drive(6000, 5), TRUTH
    whole = axis_log(u)._replace(of_position=True)
    q, v = axis_motion(theta, whole), axis_motion(theta, whole._replace(of_position=False))
    at = np.arange(0, 6001, 60)
    rng = np.random.default_rng(0)
    off = np.column_stack([0.5 * rng.standard_normal(100), np.full(100, 0.1)])
    log = whole._replace(target=q, bounds=at, start=np.column_stack([v, q])[at[:-1]] + off)

    def errors(states):
        return np.add.reduceat((q - axis_motion(theta, log._replace(start=states))) ** 2, at[:-1])

    before, after = errors(log.start), errors(fit_state(theta, log))
    assert (after <= before).all()
    assert np.mean(after < 1e-9) > 0.95


@pytest.mark.parametrize("form", [{}, {"early": True}, {"coupled": True}], ids=str)
def test_only_the_states_of_chosen_pieces_are_fitted_and_each_as_if_it_were_alone(form):
    u, more = slow_drive(1000, 5), {"early": [0.01, 0.9], "coupled": [0.05, 0.1, 8.0, 0.4, 0.05]}
    theta = np.r_[TRUTH, *(more[k] for k in form)]
    whole = axis_log(u, **form)._replace(of_position=True)
    q, v = axis_motion(theta, whole), axis_motion(theta, whole._replace(of_position=False))
    at = np.arange(0, 1001, 50)
    log = whole._replace(target=q, bounds=at, start=np.column_stack([v, q])[at[:-1]] + 0.1)
    chosen = np.arange(at.size - 1) % 3 == 1
    every, some = fit_state(theta, log), fit_state(theta, log, chosen=chosen)
    np.testing.assert_array_equal(some[chosen], every[chosen])
    np.testing.assert_array_equal(some[~chosen], log.states[~chosen])
    assert not axis_motion(theta, log, chosen)[np.repeat(~chosen, 50)].any()
