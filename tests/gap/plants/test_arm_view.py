"""One record of an arm behind the filters: the fit, what it leaves, and the records that the fitted arm makes."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from sklearn.base import clone

from whsklearn import RigidBodyLags
from whsklearn.datasets import default_arm, make_arm_log
from whsklearn.effects import CableSpring, codes
from whsklearn.gap.plants.arm_terms import AtJoint, JointInertia, JointTerm, Load, candidates
from whsklearn.gap.plants.arm_view import LATEST, ArmRecord, ArmState, ArmView, advance, law_of, point, solved
from whsklearn.gap.plants.servo_inverse import later

pytestmark = pytest.mark.usefixtures("library_effects")

ARM = default_arm()


def view_of(effects=None, *, late=0, seed=0):
    q, u = make_arm_log(ARM, effects, duration=12.0, random_state=seed, return_arrays=True)
    u = np.vstack([u[late:], np.repeat(u[-1:], late, axis=0)]) if late else u  # drives that act ``late`` samples on
    lags = RigidBodyLags(ARM, 500.0, law="viscous,coulomb").fit(q, u)
    view = ArmView(lags, ArmRecord(np.arange(len(q)) / 500.0, q, u))
    model = view.fit(ArmState(np.zeros(len(lags.base_.names)), np.zeros(ARM.n_joints)))
    view.weigh(model)
    return view, view.fit(model)


@pytest.fixture(scope="module")
def plain(request):
    return view_of()


def kind_of(name):
    return next(k for k in candidates(ARM, {}, frozen=False, weight=0) if k.name == name)


def test_a_complete_model_leaves_less_than_a_percent_of_every_drive(plain):
    view, model = plain
    assert np.all(view.by_joint(view.left(model)) < 0.01 * view.drive_rms)


def test_what_is_missing_at_a_joint_is_left_there_and_a_term_takes_it():
    view, model = view_of({"yaw": [CableSpring(1.0)]})
    left = view.by_joint(view.left(model)) / view.drive_rms
    assert left[0] > 5 * left[1]
    term = JointTerm(kind_of("cable_spring at yaw"), (1.0, 0.0))
    fitted = view.fit(model.with_term(term))
    assert fitted.terms[0].q[0] == pytest.approx(1.0, rel=0.05)
    assert view.by_joint(view.left(fitted))[0] < 0.2 * view.by_joint(view.left(model))[0]
    assert fitted.without(0).terms == ()


def test_ages_up_to_two_samples_are_bookkeeping_and_more_is_not():
    left = {}
    for late in (0, 1, 6):
        view, model = view_of(late=late)
        assert np.all(model.timing <= LATEST * view.dt + 1e-12)
        left[late] = float((view.by_joint(view.left(model)) / view.drive_rms).max())
    assert left[1] < 1.5 * left[0]
    assert left[6] > 3.0 * left[0]


def test_a_load_is_columns_of_its_link_at_every_joint(plain):
    view, _ = plain
    kind, place = AtJoint(Load, "pitch", (0.0, 1.0)), (0.1, 0.0, 0.05)
    asked = view.columns(kind, place).reshape(view.n_rows, view.n_joints)
    heavy = ARM.with_body("pitch", 1.0, place)
    truth = heavy.inverse_dynamics(*view.moved, effects=False) - ARM.inverse_dynamics(*view.moved, effects=False)
    np.testing.assert_allclose(asked, view.blur(truth), atol=1e-6 * np.abs(truth).max())


def test_inertia_along_two_joints_is_paid_for_by_both(plain):
    view, _ = plain
    term = JointTerm(AtJoint(JointInertia, "yaw+pitch", (1.0, 1.0)), (0.5,))
    along = view.blur(0.5 * view.moved.acceleration.sum(axis=1))
    np.testing.assert_allclose(view.contribution(term), np.column_stack([along, along]))


def test_dry_friction_reverses_in_columns_and_own_records_as_in_the_model(plain):
    view, model = plain
    how = (0.3, 0.02)
    lags = clone(view.lags).set_params(reversals={"pitch": how}, cutoff=view.lags.cutoff_)
    soft = ArmView(lags, view.record)
    v, a = (x[:, 1] for x in (soft.moved.velocity, soft.moved.acceleration))
    sign = np.tanh((v + how[1] * a) / how[0])
    columns = soft.columns(kind_of("coulomb at pitch"), ()).ravel()
    np.testing.assert_allclose(columns, soft.blur(sign[:, None])[:, 0], atol=1e-9)
    size = model.numbers[view.lags.base_.names.index("pitch.coulomb")]
    apart = soft.along(model, soft.moved) - view.along(model, view.moved)
    np.testing.assert_allclose(apart[:, 1], size * (sign - np.sign(v)), atol=1e-6 * size)
    np.testing.assert_allclose(apart[:, 0], 0.0, atol=1e-12)


def test_a_play_frees_nothing_where_numbers_give_a_joint_no_inertia():
    view, _ = view_of()
    kind = kind_of("backlash at pitch")
    shape = kind.catalogued.starts(view.scene(kind))[0]
    for sign in (1.0, -1.0):
        view.model_arm, view._last = dataclasses.replace(ARM, inertial=sign * ARM.inertial, armature=None), None
        freed = view.freed(kind, shape)
        assert np.isfinite(freed).all()
        assert np.any(freed) == (sign > 0.0)


def test_own_records_of_a_complete_model_are_as_large_as_what_it_leaves(plain):
    view, model = plain
    own = view.own(model, np.random.default_rng(0))
    null = np.sqrt(np.mean([view.by_joint(x) ** 2 for x in own.null], axis=0))
    left = view.by_joint(view.left(model) - np.where(view.keep, own.mean, 0.0))
    assert np.all((null > 0.5 * left) & (null < 2.0 * left))
    assert np.all((own.counts > 2.0) & (own.counts < view.n_rows))


def test_drives_by_chance_are_as_large_as_what_a_model_leaves():
    view, model = view_of({"yaw": [CableSpring(1.0)]})
    by_chance = view.by_joint(view.blur(view.unexplained(model, np.random.default_rng(0))))
    left = view.by_joint(view.left(model))
    assert np.all((by_chance > 0.6 * left) & (by_chance < 1.5 * left))


def test_the_encoders_read_on_their_grid(plain):
    q, u = (plain[0].position, plain[0].drive)
    step = 2 * np.pi / 4096
    view = ArmView(plain[0].lags, ArmRecord(np.arange(len(q)) / 500.0, np.round(q / step) * step, u))
    read = view.read(view.moved.position, np.random.default_rng(0))
    for x, grid in zip(read.T, view.grid, strict=True):
        assert grid == pytest.approx(step)
        np.testing.assert_allclose(x / grid, np.round(x / grid), atol=1e-6)


def test_least_squares_weighs_rows_and_shares_among_equal_columns():
    rng = np.random.default_rng(0)
    x = rng.standard_normal((50, 2))
    y = x @ [2.0, -1.0]
    y[:10] = 100.0
    weight = np.where(np.arange(50) < 10, 0.0, rng.uniform(0.5, 2.0, 50))
    np.testing.assert_allclose(solved(x, y, weight), [2.0, -1.0])
    np.testing.assert_allclose(solved(np.column_stack([x[:, 0], x[:, 0]]), 2 * x[:, 0], np.ones(50)), [1.0, 1.0])


def test_a_body_of_a_kilogram_has_its_moment_at_its_place():
    np.testing.assert_allclose(point((0.1, 0.2, 0.3))[:4], [1.0, 0.1, 0.2, 0.3])
    assert law_of({"yaw": (0, (CableSpring(1.0),))}) == {"yaw": ("cable_spring",)}


@pytest.mark.parametrize("code", [codes.INPUT_DELAY, codes.ACTUATOR_LAG])
def test_a_drive_made_earlier_arrives_as_the_torque(code):
    dt, age = 0.0005, 0.02
    t = np.arange(20_000) * dt
    torque = np.sin(5.0 * t) + 0.3 * np.cos(11.0 * t)
    arrived = later(code, torque + advance(code, torque, age, dt), age, dt)
    late = later(code, torque, age, dt)
    assert np.std((arrived - torque)[2000:-2000]) < 0.02 * np.std((late - torque)[2000:-2000])
