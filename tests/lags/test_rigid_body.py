"""An arm's log as rows: what is fitted from them is the arm, in batch and sample by sample."""

from __future__ import annotations

import tracemalloc

import numpy as np
import pytest
from sklearn.base import clone
from sklearn.model_selection import GridSearchCV, TimeSeriesSplit

from tests.systems.drawn_arms import drawn_arm
from whsklearn import Arm, RigidBodyLags, RLSRegressor
from whsklearn.datasets import default_arm, make_arm_log
from whsklearn.effects import Coulomb, GravityImbalance, LoadFriction, Viscous
from whsklearn.filtering import motion
from whsklearn.filtering.records import motion_cutoff
from whsklearn.lags import InverseDynamicsLags
from whsklearn.lags.rigid_body import axes_of
from whsklearn.systems.arm import direction_of

RATE = 500.0
FRICTION = {"j0": (Viscous(0.8), Coulomb(0.5)), "j1": (Viscous(0.4), Coulomb(0.9)), "j2": (Viscous(0.2), Coulomb(0.3))}
ARM = drawn_arm(3, 7, slides=0.0, branch=0.0, gravity=(0, 0, -9.81)).with_effects(FRICTION)


def smooth_log(arm, seconds=20.0, seed=0, noise=0.0):
    """Positions and drives of an arm whose joints follow sums of sines, as its own inverse dynamics has them."""
    rng = np.random.default_rng(seed)
    t = np.arange(int(seconds * RATE))[:, None, None] / RATE
    w = rng.uniform(1.0, 7.0, (arm.n_joints, 5))
    size, phase = rng.uniform(0.1, 0.5, (2, arm.n_joints, 5))
    angle = w * t + 10 * phase
    q = (size * np.sin(angle)).sum(2)
    v, a = (size * w * np.cos(angle)).sum(2), -(size * w**2 * np.sin(angle)).sum(2)
    return q, arm.inverse_dynamics(q, v, a) + noise * rng.normal(size=q.shape)


def truth(lags, arm):
    """Base numbers of an arm by name: links as they are, friction of its effects."""
    full = np.zeros(lags.base_.mapping.shape[1])
    full[: 10 * arm.n_joints] = arm.inertial.ravel()
    values = dict(zip(lags.base_.names, lags.base_.mapping @ full, strict=True))
    return values | {f"{j}.{e.name}": e.magnitude for j, row in zip(arm.joints, arm.effects, strict=True) for e in row}


def test_a_physical_arm_has_no_friction_that_drives_it():
    q, torque = smooth_log(ARM, noise=0.05)
    viscous = next(e.magnitude for e in ARM.effects[0] if e.name == "viscous")
    torque[:, 0] -= (viscous + 0.2) * np.gradient(q[:, 0], 1.0 / RATE)
    lags = RigidBodyLags(ARM, sample_rate=RATE, cutoff=20.0)
    phi, target, keep = lags.joint_rows(q, torque)
    theta, *_ = np.linalg.lstsq(phi[keep], target[keep], rcond=None)
    exact, arm = lags.interpret(theta, physical=False), lags.interpret(theta, np.linalg.pinv(phi[keep].T @ phi[keep]))
    assert exact.effects[0][0].magnitude == pytest.approx(-0.2, abs=0.02)
    assert arm.effects[0][0].magnitude == 0.0
    clipped = np.where(np.array(lags.base_.names) == f"{ARM.joints[0]}.viscous", 0.0, theta)
    beside, beyond = (np.sum((target - phi @ x)[keep] ** 2) for x in (lags.weights_of(arm), clipped))
    assert beside < 0.9 * beyond  # what is beside it makes up for what it can


def test_a_fit_finds_base_numbers_and_friction_of_every_joint_within_their_errors():
    q, torque = smooth_log(ARM, noise=0.05)
    model = RLSRegressor(RigidBodyLags(ARM, sample_rate=RATE, cutoff=20.0)).fit(q, torque)
    expected, errors = truth(model.lags_, ARM), model.parameter_standard_errors_
    away = np.array([(model.parameters_[k] - expected[k]) / errors[k] for k in expected])
    assert len(away) > 20
    assert np.sqrt(np.mean(away**2)) < 2.0
    held_out = smooth_log(ARM, seed=5)
    left = model.predict(held_out[0]) - held_out[1]
    assert (left[200:-200].std(axis=0) < 0.06 * held_out[1].std(axis=0)).all()


def test_one_joint_has_the_columns_of_an_axis():
    arm = Arm(["axis"], [-1], [False], [np.eye(3)], [[0, 0, 0]], [[0, 0, 1]], gravity=(0, 0, 0))
    q, torque = smooth_log(Arm(["axis"], [-1], [False], [np.eye(3)], [[0, 0, 0]], [[0, 0, 1]], [[0.0] * 9 + [0.05]]))
    lags = RigidBodyLags(arm, sample_rate=RATE, cutoff=20.0)
    phi = lags.fit(q).transform(q)
    axis = InverseDynamicsLags(sample_rate=RATE, cutoff=50.0)
    assert list(lags.get_feature_names_out()) == ["axis.Izz", "axis.viscous", "axis.coulomb", "axis.input_offset"]
    acceleration = motion(q[:, 0], RATE, 100.0).acceleration  # the fine filter, then the coarse one
    inner = slice(100, -100)
    np.testing.assert_allclose(phi[inner, 0, 0], acceleration[inner], atol=0.02 * np.abs(acceleration).max())
    theirs = RLSRegressor(axis).fit(q, torque[:, 0]).parameters_["inertia"]
    assert RLSRegressor(lags).fit(q, torque).parameters_["axis.Izz"] == pytest.approx(theirs, rel=0.01)


def test_any_cutting_of_a_stream_gives_the_same_fit():
    q, torque = smooth_log(ARM, 4.0)
    lags = RigidBodyLags(ARM, sample_rate=RATE, causal=True)
    whole = RLSRegressor(lags).fit(q, torque)
    pieces = RLSRegressor(lags)
    for piece in np.array_split(np.arange(len(q)), 37):
        pieces.partial_fit(q[piece], torque[piece])
    np.testing.assert_allclose(pieces.theta_, whole.theta_, rtol=1e-9, atol=1e-9)


def test_row_by_row_it_learns_the_arm_and_goes_on_from_its_file(tmp_path):
    q, torque = smooth_log(ARM, 6.0)
    half = len(q) // 2
    model = RLSRegressor(RigidBodyLags(ARM, sample_rate=RATE, causal=True)).partial_fit(q[:half], torque[:half])
    model.save(tmp_path / "arm.whs")
    other = RLSRegressor.load(tmp_path / "arm.whs")
    for t in range(half, len(q)):
        model.partial_fit(q[t : t + 1], torque[t : t + 1])
    other.partial_fit(q[half:], torque[half:])
    np.testing.assert_allclose(other.theta_, model.theta_, rtol=1e-9, atol=1e-9)
    expected = truth(model.lags_, ARM)
    for name in ("j0.viscous", "j2.coulomb", "j2.mx"):
        assert model.parameters_[name] == pytest.approx(expected[name], rel=0.05, abs=0.02)


def test_the_noise_of_its_encoders_does_not_drown_the_inertias_of_a_fast_stream():
    arm = default_arm()
    q, drive = make_arm_log(arm, duration=8.0, sample_rate=1000.0, random_state=0, return_arrays=True)
    model = RLSRegressor(RigidBodyLags.of_arm(arm, 1000.0, causal=True)).partial_fit(q, drive)
    expected = dict(zip(model.lags_.base_.names, model.lags_.weights_of(arm), strict=True))
    # 0.0415 for 0.0530 while rows were single instants
    assert model.parameters_["pitch.Izz"] == pytest.approx(expected["pitch.Izz"], rel=0.06)
    assert model.parameters_["pitch.mx"] == pytest.approx(expected["pitch.mx"], rel=0.02)


def test_a_joint_that_rests_or_turns_teaches_a_stream_nothing():
    q, torque = smooth_log(ARM, 4.0)
    still = q.copy()
    still[:, 1] = 0.2 + 1e-6 * np.random.default_rng(0).normal(size=len(q))
    lags = RigidBodyLags(ARM, sample_rate=RATE, causal=True)
    phi, target = (x.reshape(-1, 3, *x.shape[1:]) for x in lags.partial_rows(still, torque))
    assert not phi[:, 1].any()
    assert not target[:, 1].any()
    taught = phi[:, [0, 2]].any(axis=2)
    assert 0.5 < taught.mean() < 1.0  # all but the windows in which they turn


def test_grid_search_reaches_the_filter():
    q, torque = smooth_log(ARM, 8.0, noise=0.5)
    search = GridSearchCV(
        RLSRegressor(RigidBodyLags(ARM, sample_rate=RATE)), {"lags__cutoff": [0.5, 10.0]}, cv=TimeSeriesSplit(2)
    ).fit(q, torque)
    assert search.best_params_ == {"lags__cutoff": 10.0}
    assert search.best_score_ > 0.9


def test_joints_are_weighted_by_what_their_own_rows_leave():
    q, torque = smooth_log(ARM)
    noisy = torque + np.random.default_rng(0).normal(size=torque.shape) * [0.1, 1.0, 10.0]
    lags = RigidBodyLags(ARM, sample_rate=RATE, cutoff=20.0)
    lags.rows(q, noisy)
    ratios = lags.weights_[0] / lags.weights_
    np.testing.assert_allclose(ratios, [1.0, 10.0, 100.0], rtol=0.5)


def test_slow_samples_of_a_joint_take_out_its_own_rows_alone():
    q, torque = smooth_log(ARM)
    q = np.column_stack([q[:, :2], np.where(np.arange(len(q)) < len(q) // 2, q[:, 2], q[len(q) // 2, 2])])
    _, _, keep = RigidBodyLags(ARM, sample_rate=RATE, cutoff=20.0).joint_rows(q, torque)
    second_half = keep[len(keep) // 2 + 10 :]
    assert not second_half[:, 2].any()
    assert second_half[:, 0].mean() > 0.5


def test_a_cutoff_leaves_enough_rows_of_fast_joints():
    rate, step = 100.0, 2 * np.pi / 1024  # a coarse encoder asks for a low cut-off, which widens every reversal
    q, torque = (x[:: round(RATE / rate)] for x in smooth_log(ARM, 60.0))
    lags = RigidBodyLags(ARM, sample_rate=rate)
    keep = lags.joint_rows(np.round(q / step) * step, torque)[2]
    assert np.median(keep.sum(axis=0)) > 3.5 * len(lags.base_.names) / ARM.n_joints  # four were asked for
    assert lags.cutoff_ > 1.2 * np.median([motion_cutoff(x, rate) for x in np.round(q / step).T * step])
    fine = RigidBodyLags(ARM, sample_rate=rate)
    fine.joint_rows(q, torque)
    assert fine.cutoff_ == pytest.approx(np.median([motion_cutoff(x, rate) for x in q.T]))  # there are enough


def test_friction_along_a_sum_of_joints_is_paid_for_by_both():
    lags = RigidBodyLags(ARM, sample_rate=RATE, cutoff=20.0, effects={"j1+j2": "coulomb"}).fit(np.zeros((9, 3)))
    q, torque = smooth_log(ARM)
    v = np.column_stack([motion(x, RATE, 100.0).velocity for x in q.T])
    paid = 0.7 * np.sign(v[:, 1] + v[:, 2])
    model = RLSRegressor(lags).fit(q, torque + np.column_stack([0 * paid, paid, paid]))
    assert model.parameters_["j1+j2.coulomb"] == pytest.approx(0.7, rel=0.02)
    assert "j1+j2.armature" in model.parameters_


def test_load_dependent_friction_is_a_column_of_its_joint():
    q, torque = smooth_log(ARM)
    v = np.column_stack([motion(x, RATE, 100.0).velocity for x in q.T])
    torque[:, 1] /= 1.0 - 0.1 * np.sign(v[:, 1]) * np.sign(torque[:, 1])
    lags = RigidBodyLags(ARM, sample_rate=RATE, cutoff=20.0, effects={"j1": [LoadFriction()]})
    found = RLSRegressor(lags).fit(np.hstack([q, torque]), torque).parameters_["j1.load_friction"]
    assert found == pytest.approx(0.1, rel=0.1)


def test_dry_friction_reverses_over_a_speed_and_ahead_of_it():
    q, torque = smooth_log(ARM)
    v, a = (np.column_stack([getattr(motion(x, RATE, 100.0), k) for x in q.T]) for k in ("velocity", "acceleration"))
    torque[:, 1] += 0.7 * np.tanh((v[:, 1] + 0.01 * a[:, 1]) / 0.2)
    told = {}
    for reversals in (None, {"j1": (0.2, 0.01)}):
        lags = RigidBodyLags(ARM, sample_rate=RATE, cutoff=20.0, slow=0.0, reversals=reversals)
        lags.set_params(effects={"j1": "load_friction"})  # as dry as Coulomb friction
        phi, _, keep = lags.joint_rows(np.hstack([q, 0.0 * q]), torque)
        told[reversals is None] = np.where(keep, phi[:, :, lags.base_.names.index("j1.coulomb")], 0.0)
    np.testing.assert_allclose(told[True][:, [0, 2]], told[False][:, [0, 2]])
    seen = lags._filtered(np.tanh((v[:, 1] + 0.01 * a[:, 1]) / 0.2))[lags.samples_of(len(q))]
    np.testing.assert_allclose(told[False][:, 1], np.where(keep[:, 1], seen, 0.0), atol=1e-9)
    assert np.abs(told[True] - told[False])[:, 1].max() > 0.1


def test_weights_become_an_arm_again():
    q, torque = smooth_log(ARM)
    model = RLSRegressor(RigidBodyLags(ARM, sample_rate=RATE, cutoff=20.0)).fit(q, torque)
    arm = model.lags_.interpret(model.theta_, model.covariance_)
    assert (arm.inertial[:, 0] > 0).all()
    moved = ARM.drawn_motion(20)
    wanted = ARM.inverse_dynamics(*moved)
    assert np.abs(arm.inverse_dynamics(*moved) - wanted).max() < 0.05 * np.abs(wanted).max()


def test_gravity_along_one_joint_is_merged_where_a_link_says_it_already():
    table = Arm(["hinge"], [-1], [False], [np.eye(3)], [[0, 0, 0]], [[0, 1, 0]])
    lags = RigidBodyLags(table, effects=[GravityImbalance(0.1)]).fit(np.zeros((9, 1)))
    assert not any("gravity" in n for n in lags.base_.names)


@pytest.mark.parametrize(
    ("settings", "X", "y", "said"),
    [
        ({}, np.zeros((100, 4)), np.zeros((100, 3)), "expected a position for each of j0, j1, j2"),
        ({}, np.zeros((100, 3)), np.zeros((100, 2)), r"expected \(100, 3\)"),
        ({}, np.random.default_rng(0).normal(size=(100, 3)), np.zeros((100, 3)), "drive of j0 is zero throughout"),
        ({}, np.zeros((100, 3)), np.ones((100, 3)), "No joint moves"),
        ({"weights": [1.0]}, np.zeros((100, 3)), np.ones((100, 3)), "one per joint"),
        (
            {"effects": {"j1*j2": "coulomb"}},
            np.zeros((100, 3)),
            np.ones((100, 3)),
            "neither a joint nor a sum",
        ),
        ({"effects": [LoadFriction()]}, np.zeros((100, 3)), None, "add the drives to X"),
        ({"robot": None}, np.zeros((100, 3)), np.ones((100, 3)), "expected an Arm"),
        ({"robot": "nowhere.urdf"}, np.zeros((100, 3)), np.ones((100, 3)), "There is no robot file"),
    ],
)
def test_what_cannot_be_is_told_in_one_sentence(settings, X, y, said):
    lags = RigidBodyLags(**{"robot": ARM, **settings})
    with pytest.raises(ValueError, match=said):
        lags.rows(X, y) if y is not None else lags.fit(X).transform(X)


def test_a_joint_that_does_not_move_is_told_and_left_out():
    q, torque = smooth_log(ARM)
    q[:, 1] = 0.3
    with pytest.warns(UserWarning, match="j1 does not move"):
        _, _, keep = RigidBodyLags(ARM, sample_rate=RATE, cutoff=20.0).joint_rows(q, torque)
    assert not keep[:, 1].any()


def test_a_record_is_no_stream_and_its_state_no_others():
    lags = RigidBodyLags(ARM)
    with pytest.raises(ValueError, match="causal=True"):
        lags.partial_rows(np.zeros((2, 3)), np.zeros((2, 3)))
    with pytest.raises(ValueError, match="not a state"):
        lags.set_state({})
    assert clone(lags).robot is not None


def test_axes_are_joints_and_sums_of_them():
    assert direction_of(ARM.joints, "j0-j2").tolist() == [1.0, 0.0, -1.0]
    axes = axes_of(ARM, "viscous", {"j0": "cogging", "j0+j1": "coulomb"})
    assert {name: [t.name for t in terms] for name, (_, terms) in axes.items()} == {
        "j0": ["viscous", "cogging"], "j1": ["viscous"], "j2": ["viscous"], "j0+j1": ["coulomb"],
    }  # fmt: skip


def test_an_arm_of_many_joints_is_filtered_by_parts():
    arm = Arm.from_dh([(0.1, (-1) ** k * np.pi / 2, 0.05, 0) for k in range(10)])
    q = smooth_log(arm, seconds=8.0)[0]
    drive = np.random.default_rng(0).normal(size=q.shape)
    lags = RigidBodyLags(arm, RATE, cutoff=10.0).fit(q)
    moved = lags._columns_along(q, drive)[1]
    blocks = lags.arm_.regressor(*moved), *lags._axis_columns(moved, drive, np.arange(len(q)) / RATE)
    whole = lags._filtered(np.concatenate(blocks, axis=2)[:, :, lags.base_.kept])
    tracemalloc.start()
    try:
        phi = lags.joint_rows(q, drive)[0]
        most = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    np.testing.assert_allclose(phi, whole[lags.samples_of(len(q))], rtol=0.0, atol=1e-12 * np.abs(whole).max())
    assert most < 3.0 * whole.nbytes  # 5 if each step holds all columns of all samples
