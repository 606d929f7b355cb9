"""Links that are physical and move the drives as measured."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from tests.systems.drawn_arms import drawn_arm
from whsklearn import RigidBodyLags
from whsklearn.systems.consistent_inertias import from_log_cholesky, log_cholesky, pseudo_inertia


def is_body(numbers):
    return bool(np.linalg.eigvalsh(pseudo_inertia(numbers)).min() > 0)


def test_any_ten_numbers_are_a_body_and_every_body_has_its_ten_numbers():
    rng = np.random.default_rng(0)
    for _ in range(20):
        x = rng.normal(size=10)
        assert is_body(from_log_cholesky(x))
        np.testing.assert_allclose(log_cholesky(from_log_cholesky(x)), x, atol=1e-8)


def test_a_link_without_mass_begins_as_a_small_body():
    assert is_body(from_log_cholesky(log_cholesky(np.zeros(10))))


@pytest.mark.parametrize("seed", [0, 1])
def test_torques_are_kept_and_all_links_are_bodies(seed):
    arm = drawn_arm(3, seed)
    base = arm.base()
    measured = base.mapping @ arm.inertial.ravel()
    nominal = dataclasses.replace(arm, inertial=1.3 * arm.inertial)
    found = nominal.consistent(base, measured, np.diag((1e-3 * np.abs(measured) + 1e-6) ** 2))
    assert all(is_body(row) for row in found.inertial)
    motion = arm.drawn_motion(30, random_state=5)
    wanted = arm.inverse_dynamics(*motion)
    assert np.abs(found.inverse_dynamics(*motion) - wanted).max() < 5e-3 * np.abs(wanted).max()
    assert np.abs(nominal.inverse_dynamics(*motion) - wanted).max() > 0.1 * np.abs(wanted).max()


@pytest.mark.parametrize("ratio", [0.5, 2.0, 1e3])  # a wrist's motor behind its gear has 1,000 times its link's inertia
def test_a_motor_that_the_file_does_not_name_is_found(ratio):
    arm = drawn_arm(3, 4, slides=0.0, branch=0.0)
    inertia = np.diagonal(arm.mass_matrix(np.zeros((1, 3)))[0])
    geared = dataclasses.replace(arm, armature=[0.0, 0.5 * inertia[1], ratio * inertia[2]])
    lags = RigidBodyLags(arm).fit(np.zeros((9, 3)))
    theta = lags.weights_of(geared)
    found = lags.interpret(theta, np.diag((0.03 * np.abs(theta) + 1e-6) ** 2))
    at = np.random.default_rng(0).uniform(-2.0, 2.0, (5, 3))
    np.testing.assert_allclose(found.mass_matrix(at), geared.mass_matrix(at), rtol=0.05, atol=0.01 * inertia.min())
    assert found.armature[2] == pytest.approx(ratio * inertia[2], rel=0.05)


def test_numbers_that_no_body_has_become_the_nearest_that_one_has():
    arm = drawn_arm(2, 3, slides=0.0)
    base = arm.base()
    measured = base.mapping @ arm.inertial.ravel()
    measured[base.names.index("j1.Izz" if "j1.Izz" in base.names else base.names[-1])] *= -1.0
    assert all(is_body(row) for row in arm.consistent(base, measured).inertial)


def test_values_of_another_number_are_refused():
    arm = drawn_arm(1, 0)
    with pytest.raises(ValueError, match="one per base parameter"):
        arm.consistent(arm.base(), np.ones(99))
