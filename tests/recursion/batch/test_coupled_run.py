"""The free run of two masses: its sensitivities, its order, and the servo's own simulation of the same axis."""

from __future__ import annotations

import numpy as np
import pytest

from tests.recursion.axis_log import slow_drive
from whsklearn.effects import Coulomb, FrictionLaw, InputOffset, Viscous
from whsklearn.filtering.records import fine_drive
from whsklearn.models import AxisModel
from whsklearn.recursion.batch.axis_free_run import (
    AxisForm,
    AxisLog,
    axis_motion,
    behind_the_spring,
    handed_over,
    sensitivities,
    settled,
)
from whsklearn.recursion.batch.coupled_run import bodies_of, slopes_of

THETA = np.array([0.05, 0.1, 0.1, 0.01, 0.02, 0.05, 8.0, 0.6, 0.05])
SIDES = pytest.mark.parametrize("at_load", [False, True])


def coupled_log(at_load, *, steps=16, of_position=True, n=1500, pieces=2):
    u = slow_drive(n, 2)
    bounds = np.linspace(0, n, pieces + 1).astype(int)
    state = np.tile([0.1, 0.0, 0.01, 0.02], (pieces, 1))
    form = AxisForm(coupled=True, at_load=at_load)
    return AxisLog(fine_drive(u, steps), u, np.ones(n, bool), bounds, state, 0.004, form, of_position)


def test_the_numbers_of_two_masses_have_exact_slopes():
    for i, row in enumerate(slopes_of(THETA)):
        step = np.zeros(9)
        step[i] = 1e-6 * THETA[i]
        difference = (bodies_of(THETA + step) - bodies_of(THETA - step)) / (2.0 * step[i])
        np.testing.assert_allclose(row, difference, rtol=1e-7, atol=1e-9)


@SIDES
@pytest.mark.parametrize("of_position", [False, True])
def test_the_free_run_of_two_masses_has_exact_sensitivities(at_load, of_position):
    log = coupled_log(at_load, of_position=of_position)
    rows = sensitivities(THETA, log)[1]
    for i in range(13):
        step = np.zeros(13)
        step[i] = 1e-7  # with smaller ones the difference is rounding, which grows at every stop
        ends = [axis_motion(THETA + s[:9], log._replace(start=log.states + s[9:])) for s in (step, -step)]
        difference = (ends[0] - ends[1]) / 2e-7
        wrong = np.abs(rows[i] - difference) > 1e-4 * np.abs(difference).max() + 1e-5
        assert np.mean(wrong) < 0.01, i  # a sample at which one of the runs comes to rest a step earlier
    np.testing.assert_array_equal(sensitivities(THETA, log, of_states=True)[1], rows[-4:])


@SIDES
def test_the_servo_s_simulation_of_the_same_axis_agrees(at_load):
    law = FrictionLaw([Viscous(THETA[1]), Coulomb(THETA[2])])
    side = "load" if at_load else "motor"
    axis = AxisModel(THETA[0], law, (InputOffset(THETA[3]), *behind_the_spring(THETA)), side=side, dt=0.004,
                     logged="position")  # fmt: skip
    log = coupled_log(at_load, steps=axis.steps, pieces=1)._replace(start=np.zeros((1, 4)))
    run = axis_motion(THETA, log)
    np.testing.assert_allclose(axis.simulate(log.u[:, 0]), run, atol=1e-4 * np.ptp(run))


@SIDES
@pytest.mark.parametrize(("dry", "off"), [(0.0, 0.1), (1.0, 0.3)])
def test_the_run_converges_with_the_square_of_its_step(at_load, dry, off):
    """With dry friction too, as a step in which a mass stops is divided there."""
    theta = THETA * [1, 1, dry, 1, 1, dry, 1, 1, 1]
    exact = axis_motion(theta, coupled_log(at_load, steps=512))
    errors = [np.sqrt(np.mean((axis_motion(theta, coupled_log(at_load, steps=n)) - exact) ** 2)) for n in (8, 16)]
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=off)


def test_the_twist_is_handed_from_piece_to_piece():
    """From states that know nothing of it, some pieces end in another minimum; handed over, all are found."""
    whole = coupled_log(at_load=True, pieces=1)._replace(start=np.zeros((1, 4)))
    noise = 1e-5 * np.random.default_rng(0).standard_normal(1500)
    q, v = (axis_motion(THETA, whole._replace(of_position=p)) for p in (True, False))
    at = np.arange(0, 1501, 75)
    log = whole._replace(target=q + noise, bounds=at, start=np.column_stack([v, q])[at[:-1]])
    alone = settled(THETA, log)
    errors = [log.target - axis_motion(THETA, x) for x in (alone, handed_over(THETA, alone))]
    assert np.std(errors[1]) < 1.2e-5
    assert np.std(errors[0]) > 2.0 * np.std(errors[1])
