"""Records of an arm behind the filters: more columns at their rows are those that a fit with them would have."""

from __future__ import annotations

import numpy as np
import pytest

from tests.lags.test_rigid_body import ARM, RATE, smooth_log
from whsklearn import RigidBodyLags
from whsklearn.effects import Coulomb, Viscous
from whsklearn.lags.arm_rows import records_of, turning

SLOW = {"j1": (0.3, 0.01)}


@pytest.fixture(scope="module")
def pair():
    """Two records, one after the other, and each alone."""
    logs = [smooth_log(ARM, seconds=8.0, seed=seed) for seed in (0, 1)]
    q, torque = (np.concatenate(x) for x in zip(*logs, strict=True))
    groups = np.repeat([0, 1], len(logs[0][0]))
    lags = RigidBodyLags(ARM, RATE, cutoff=20.0, reversals=SLOW)
    return records_of(lags, q, torque, groups), [
        records_of(RigidBodyLags(ARM, RATE, cutoff=20.0), *log) for log in logs
    ]


def test_columns_along_an_axis_are_those_of_the_fit(pair):
    rows, _ = pair
    names = rows.lags.base_.names
    at = [names.index("j1.viscous"), names.index("j1.coulomb")]
    np.testing.assert_allclose(rows.axis_columns("j1", (Viscous(), Coulomb())), rows.phi[:, 1, at], atol=1e-9)
    other = rows.axis_columns("j1", (Coulomb(),), reversal=(0.01, 0.0))
    assert np.abs(other[:, 0] - rows.phi[:, 1, at[1]]).max() > 0.1


def test_filters_begin_anew_at_each_record(pair):
    rows, alone = pair
    x = np.random.default_rng(0).standard_normal(rows.position.shape)
    half = len(x) // 2
    both = [r.blur(part) for r, part in zip(alone, (x[:half], x[half:]), strict=True)]
    np.testing.assert_allclose(rows.blur(x), np.concatenate(both))


def test_the_drives_of_true_weights_are_those_of_the_log_and_age_by_their_slope(pair):
    rows, _ = pair
    theta = rows.lags.weights_of(ARM)
    needed = rows.predicted(theta)
    assert np.std(needed - rows.drive) < 0.1 * np.std(rows.drive)
    later = rows.blur(np.roll(needed, -1, axis=0)) - rows.blur(needed)
    middle = slice(40, len(rows.kept) // 2 - 40)
    np.testing.assert_allclose(rows.per_age(theta)[middle] / RATE, later[middle], atol=0.05 * np.abs(later).max())


def test_friction_reverses_at_once_where_nothing_else_is_told(pair):
    rows, _ = pair
    assert turning(None, ["j1"], rows.moved) is None
    along = type(rows.moved)(*(x[:, 1] for x in rows.moved))
    np.testing.assert_allclose(np.tanh(turning(SLOW, ["j0"], along)), np.sign(along.velocity), atol=1e-9)
