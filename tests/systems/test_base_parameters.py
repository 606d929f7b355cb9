"""Base parameters: what they keep explains all, what they merge cannot be told apart."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from tests.systems.drawn_arms import drawn_arm
from whsklearn import Arm, RigidBodyLags
from whsklearn.systems import base_parameters
from whsklearn.systems.arm_files import pseudo_inertia
from whsklearn.systems.base_parameters import from_log_cholesky, log_cholesky


@pytest.mark.parametrize("seed", range(6))
def test_base_numbers_give_the_torques_of_the_full_set_on_other_motion(seed):
    arm = drawn_arm(2 + seed, seed)
    base = arm.base()
    motion = arm.drawn_motion(50, random_state=99)
    kept = arm.regressor(*motion)[:, :, base.kept]
    np.testing.assert_allclose(
        kept @ (base.mapping @ arm.inertial.ravel()), arm.inverse_dynamics(*motion), rtol=1e-8, atol=1e-8
    )
    stacked = kept.reshape(-1, base.kept.size)
    assert np.linalg.cond(stacked / np.linalg.norm(stacked, axis=0)) < 1e6, "nothing is kept twice"


def test_the_first_joint_of_a_turntable_shows_one_number():
    arm = Arm(["table"], [-1], [False], [np.eye(3)], [[0, 0, 0]], [[0, 0, 1]])
    assert arm.base().names == ("table.Izz",)
    assert "table.m" in arm.base().unseen


def test_the_elbow_of_two_parallel_axes_adds_its_mass_to_the_shoulder():
    """Khalil and Dombre 2002, ch. 9: I1 + m2 l^2 and m1 x1 + m2 l of a planar arm of two links."""
    arm = Arm.from_dh([(0.5, 0, 0, 0), (0.4, 0, 0, 0)], gravity=(0, -9.81, 0), joints=("one", "two"))
    base = arm.base()
    # the upper arm's own offset and the elbow's mass times its length turn alike
    assert set(base.names) == {"one.mx", "one.my", "one.Izz", "two.mx", "two.my", "two.Izz"}
    assert base.merged["one.mx"]["two.m"] == pytest.approx(0.5)
    assert base.merged["one.Izz"]["two.m"] == pytest.approx(0.25)


def test_order_decides_which_name_stands_for_a_sum():
    a, b = np.random.default_rng(0).normal(size=(2, 30))
    assert base_parameters(np.column_stack([a, b, a + b]), "xyz").names == ("x", "y")
    assert base_parameters(np.column_stack([a + b, b, a]), "zyx").names == ("z", "y")


@pytest.mark.parametrize("n", [7, 20])
def test_the_count_of_a_chain_of_hinges_is_the_published_one(n):
    """7 n - 4, where the first axis is not along gravity: Mayeda, Yoshida, Osuka 1990, IEEE Trans. Rob. Aut. 6(3)."""
    arm = drawn_arm(n, 1, slides=0.0, branch=0.0)
    assert len(arm.base().names) == 7 * n - 4


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


@pytest.mark.parametrize("scale", [0.05, 1.0, 5.0])  # a gripper of 50 g and an excavator of 50 t
def test_numbers_of_an_arm_without_masses_become_bodies_that_have_them(scale):
    arm = drawn_arm(4, 6, slides=0.0)
    sizes = scale ** np.array([3, *[4] * 3, *[5] * 6])
    arm = dataclasses.replace(arm, inertial=sizes * arm.inertial, places=scale * arm.places)
    base = arm.base()
    measured = base.mapping @ arm.inertial.ravel()
    errors = 1e-4 * np.abs(measured) + 1e-6 * np.abs(measured).max()
    found = dataclasses.replace(arm, inertial=None).consistent(base, measured, np.diag(errors**2))
    assert all(is_body(row) for row in found.inertial)
    assert np.abs((base.mapping @ found.inertial.ravel() - measured) / errors).max() < 3.0


def test_numbers_that_no_body_has_become_the_nearest_that_one_has():
    arm = drawn_arm(2, 3, slides=0.0)
    base = arm.base()
    measured = base.mapping @ arm.inertial.ravel()
    measured[base.names.index("j1.Izz" if "j1.Izz" in base.names else base.names[-1])] *= -1.0
    assert all(is_body(row) for row in arm.consistent(base, measured).inertial)


def test_numbers_that_a_log_knows_to_rounding_along_one_direction_become_bodies():
    """As of joints that moved one after the other: no Cholesky factor exists of their covariance."""
    arm = drawn_arm(4, 1)
    base = RigidBodyLags(arm, 500.0).fit(np.random.default_rng(0).normal(size=(50, 4))).base_
    numbers = base.mapping[:, : 10 * 4] @ arm.inertial.ravel()
    p = numbers.size
    along = np.ones(p) / p**0.5
    spread = 1e-6 * (np.outer(along, along) - 1e-14 * np.eye(p))  # negative by rounding but along one
    found = arm.consistent(base, numbers, spread)
    np.testing.assert_allclose(base.mapping[:, : 10 * 4] @ found.inertial.ravel(), numbers, atol=1e-3)


@pytest.mark.parametrize("seed", [3, 6])
def test_numbers_that_a_log_does_not_tell_do_not_spoil_those_that_it_does(seed):
    """As of joints that moved one after the other: products of inertia of 40 +- 100 beside a moment of 1 +- 0.001."""
    arm = drawn_arm(4, seed, slides=0.0, branch=0.0)
    base = arm.base()
    true = base.mapping @ arm.inertial.ravel()
    told = np.array([name.endswith((".mx", ".my", ".mz", ".Izz")) for name in base.names])
    errors = np.where(told, 1e-3, 1e3) * np.abs(true).max()
    measured = true + np.where(told, 0.0, np.random.default_rng(0).normal(size=true.size)) * errors
    found = dataclasses.replace(arm, inertial=None).consistent(base, measured, np.diag(errors**2))
    assert np.abs((base.mapping @ found.inertial.ravel() - measured) / errors)[told].max() < 2.0


def test_values_of_another_number_are_refused():
    arm = drawn_arm(1, 0)
    with pytest.raises(ValueError, match="one per base parameter"):
        arm.consistent(arm.base(), np.ones(99))
