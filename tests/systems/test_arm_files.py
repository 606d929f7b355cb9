"""Robot files as MuJoCo means them, DH rows as the books do, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest

from tests.systems.drawn_arms import drawn_arm, drawn_body, drawn_mjcf
from whsklearn import Arm
from whsklearn.systems.arm_files import body_numbers, moved_numbers, rotation_about

mujoco = pytest.importorskip("mujoco")

LINK = '<link name="{}"><inertial><origin xyz="0.1 0 0.2" rpy="0.3 0 0"/><mass value="{}"/>{}</inertial>{}</link>'
INERTIA = '<inertia ixx="0.02" ixy="0.001" ixz="0" iyy="0.03" iyz="0" izz="0.04"/>'
MESH = '<visual><geometry><mesh filename="package://not/there.stl"/></geometry></visual>'

BALL = '<mujoco><worldbody><body><joint type="ball"/><geom size="0.1"/></body></worldbody></mujoco>'


def urdf(*joints, links=("base", "one", "two", "three"), mass=1.5):
    bodies = "".join(LINK.format(name, mass, INERTIA, MESH) for name in links)
    return f'<robot name="r">{bodies}{"".join(joints)}</robot>'


def joint(name, parent, child, kind="revolute", inner="", axis="0 1 0"):
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="0.3 0 0.1" rpy="0.2 -0.4 0.6"/><axis xyz="{axis}"/>'
        f'<limit lower="-1" upper="1" effort="9" velocity="9"/>{inner}</joint>'
    )


@pytest.mark.parametrize("seed", range(8))
def test_torques_are_those_of_mujocos_inverse_dynamics(seed):
    text = drawn_mjcf(2 + seed, seed)
    arm, model = Arm.from_file(text), mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    q, v, a = arm.drawn_motion(5, seed)
    ours, free = arm.inverse_dynamics(q, v, a), arm.forward_dynamics(q, v, a)
    assert arm.n_joints == model.nv
    for t in range(5):
        data.qpos[:], data.qvel[:], data.qacc[:] = q[t], v[t], a[t]
        mujoco.mj_inverse(model, data)
        np.testing.assert_allclose(ours[t], data.qfrc_inverse, rtol=0, atol=1e-10)
        data.qfrc_applied[:] = a[t]  # any torque
        mujoco.mj_forward(model, data)
        np.testing.assert_allclose(free[t], data.qacc, rtol=1e-8, atol=1e-8)


def test_a_urdf_is_read_without_its_meshes_with_damping_and_friction_as_effects():
    moving = '<dynamics damping="0.4" friction="0.2"/>'
    text = urdf(
        joint("a", "base", "one", inner=moving),
        joint("b", "one", "two", "prismatic"),
        joint("c", "two", "three", "fixed"),
    )
    arm = Arm.from_file(text)
    assert arm.joints == ("a", "b")
    assert [e.name for e in arm.effects[0]] == ["viscous", "coulomb"]
    assert arm.slides.tolist() == [False, True]
    assert arm.inertial[:, 0].tolist() == [1.5, 3.0]  # what is fixed is lumped


def test_a_urdf_without_masses_gives_its_kinematics():
    joints = joint("a", "base", "one"), joint("b", "one", "two"), joint("c", "two", "three")
    heavy, empty = (Arm.from_file(urdf(*joints, mass=m)) for m in (1.5, 0.0))
    np.testing.assert_array_equal(heavy.rotations, empty.rotations)
    assert not empty.inertial[:, 0].any()
    assert len(empty.base().names) == len(heavy.base().names)


def test_joints_that_are_not_named_are_locked():
    joints = joint("a", "base", "one"), joint("b", "one", "two"), joint("c", "two", "three")
    whole, part = Arm.from_file(urdf(*joints)), Arm.from_file(urdf(*joints), joints=["a", "c"])
    q, v, a = part.drawn_motion(4)
    held = [np.insert(x, 1, 0.0, axis=1) for x in (q, v, a)]
    np.testing.assert_allclose(part.inverse_dynamics(q, v, a), whole.inverse_dynamics(*held)[:, [0, 2]], atol=1e-12)


def test_gravity_may_be_another():
    text = urdf(joint("a", "base", "one"))
    still = Arm.from_file(text, gravity=(0, 0, 0))
    assert Arm.from_file(text).inverse_dynamics([[0.3]], [[0.0]], [[0.0]])[0, 0] != 0.0
    assert still.inverse_dynamics([[0.3]], [[0.0]], [[0.0]])[0, 0] == 0.0


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (
            urdf(joint("a", "base", "one"), joint("b", "one", "two", inner='<mimic joint="a"/>')),
            "follows joint 'a'",
        ),
        (urdf(joint("a", "base", "one"), joint("a", "one", "two")), "2 joints named 'a', expected a name for each"),
        (urdf(joint("a", "base", "one", "fixed")), "no joint"),
        (BALL, "ball or a free joint"),
        ("<robot><link", "cannot be read"),
        (urdf('<link name="a"><inertial><mass value="${m}"/></inertial></link>'), "xacro robot.urdf.xacro > robot"),
        ('<mujoco><worldbody><body><joint type="spin"/></body></worldbody></mujoco>', "cannot be read"),
    ],
)
def test_what_is_no_tree_of_hinges_and_slides_is_refused_in_one_sentence(text, said):
    with pytest.raises(ValueError, match=said) as error:
        Arm.from_file(text)
    assert "\n" not in str(error.value)


def test_a_joint_that_leads_another_is_refused_and_those_that_may_be_named_are_told():
    text = urdf(
        joint("a", "base", "one"), joint("b", "one", "two"), joint("c", "two", "three", inner='<mimic joint="b"/>')
    )
    with pytest.raises(ValueError, match=r"Joint 'c' follows joint 'b' .* name the others alone, --joints .a.\."):
        Arm.from_file(text, joints=["a", "b"])
    assert Arm.from_file(text, joints=["a"]).joints == ("a",)


def test_a_joint_that_is_not_there_is_told_with_those_that_are():
    with pytest.raises(ValueError, match="no joint 'x'; it has a"):
        Arm.from_file(urdf(joint("a", "base", "one")), joints=["x"])


@pytest.mark.parametrize("bound", ["connect", "weld"])
def test_a_closed_chain_is_refused_and_may_be_left_out(bound):
    body = '<body name="{}" pos="0.1 0 0"><joint name="{}" axis="0 1 0"/><geom size="0.1" pos="0.2 0 0"/>{}</body>'
    bodies = body.format("b1", "one", body.format("b2", "two", ""))
    anchor = 'anchor="0 0 0"' if bound == "connect" else ""
    text = f'<mujoco><worldbody>{bodies}</worldbody><equality><{bound} body1="b2" {anchor}/></equality></mujoco>'
    with pytest.raises(ValueError, match="closed loop"):
        Arm.from_file(text)


@pytest.mark.parametrize("modified", [False, True])
def test_dh_rows_put_the_joints_where_the_product_of_their_matrices_does(modified):
    rng = np.random.default_rng(1)
    rows = [(*rng.normal(size=4), "prismatic") if i == 1 else tuple(rng.normal(size=4)) for i in range(4)]
    arm = Arm.from_dh(rows, modified=modified)
    q = rng.normal(size=4)

    def screw(axis, angle, along):
        out = np.eye(4)
        out[:3, :3], out[:3, 3] = rotation_about(axis, angle), np.asarray(axis) * along
        return out

    book, ours = np.eye(4), np.eye(4)
    for k, (a, alpha, d, theta, *kind) in enumerate(rows):
        about_z = screw([0, 0, 1], theta + (0 if kind else q[k]), d + (q[k] if kind else 0))
        own = np.eye(4)
        own[:3, :3], own[:3, 3] = arm.rotations[k], arm.places[k]
        ours = ours @ own @ screw([0, 0, 1], *((0.0, q[k]) if kind else (q[k], 0.0)))
        if modified:
            book = book @ screw([1, 0, 0], alpha, a) @ about_z
            np.testing.assert_allclose(ours, book, atol=1e-12)
        else:  # the joint's frame stands before the constant part of its row
            constant = screw([0, 0, 1], 0.0, 0.0 if kind else d) @ screw([1, 0, 0], alpha, a)
            if kind:
                constant = screw([0, 0, 1], 0.0, d) @ screw([1, 0, 0], alpha, a)
            book = book @ about_z @ screw([1, 0, 0], alpha, a)
            np.testing.assert_allclose(ours @ constant, book, atol=1e-12)


def test_a_body_moved_to_another_frame_is_the_same_body():
    rng = np.random.default_rng(0)
    mass, centre, inertia = drawn_body(rng)
    turn, place = rotation_about([0.6, 0.0, 0.8], 0.7), rng.normal(size=3)
    moved = body_numbers(mass, turn @ centre + place, turn @ inertia @ turn.T)
    np.testing.assert_allclose(moved_numbers(body_numbers(mass, centre, inertia), turn, place), moved, atol=1e-12)


def test_an_arm_knows_its_drawing():
    arm = drawn_arm(3, 0)
    assert len(arm.number_names) == 30
    assert arm.number_names[11] == "j1.mx"
