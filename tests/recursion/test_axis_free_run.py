"""The free run of an axis and its sensitivities."""

from __future__ import annotations

import numpy as np
import pytest

from tests.recursion.axis_log import TRUTH, axis_log, slow_drive
from whsklearn.recursion.axis_free_run import free_run, sensitivities


@pytest.mark.parametrize("of_position", [False, True])
def test_the_free_run_of_an_axis_has_exact_sensitivities(of_position):
    theta = np.array([0.05, 0.12, 0.1, 0.01, 0.05, 0.02, 0.1])
    log = axis_log(slow_drive(400, 2), 0.01, (0.3,))._replace(of_position=of_position, v0=np.array([0.1]))
    rows = sensitivities(theta, log)[1]
    for i in range(theta.size):
        step = np.zeros(theta.size)
        step[i] = 1e-6
        differences = (free_run(theta + step, log) - free_run(theta - step, log)) / 2e-6
        np.testing.assert_allclose(rows[i], differences, atol=1e-5 * np.abs(differences).max())


def test_below_its_dry_friction_an_axis_stands():
    assert not free_run(TRUTH, axis_log(np.full(200, 0.25))).any()
    assert free_run(TRUTH, axis_log(np.full(200, 0.35)))[-1] > 0
