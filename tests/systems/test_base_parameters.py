"""Base parameters: what they keep explains all, what they merge cannot be told apart."""

from __future__ import annotations

import numpy as np
import pytest

from tests.systems.drawn_arms import drawn_arm
from whsklearn import Arm
from whsklearn.systems import base_parameters


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
