"""The rigid-body loops agree with Pinocchio on drawn trees, and with each other."""

from __future__ import annotations

import numpy as np
import pytest

from tests.systems.drawn_arms import drawn_arm

ARMS = [(n, seed) for seed, n in enumerate([1, 2, 3, 5, 6, 7, 8])]


def with_pinocchio(pin, arm):
    """The same arm for Pinocchio, and where each joint stands in its vectors."""
    model = pin.Model()
    ids = []
    for k, name in enumerate(arm.joints):
        kind = pin.JointModelPrismaticUnaligned if arm.slides[k] else pin.JointModelRevoluteUnaligned
        parent = 0 if arm.parents[k] < 0 else ids[arm.parents[k]]
        ids.append(model.addJoint(parent, kind(arm.axes[k]), pin.SE3(arm.rotations[k], arm.places[k]), name))
        model.appendBodyToJoint(ids[-1], pin.Inertia.FromDynamicParameters(arm.inertial[k]), pin.SE3.Identity())
    model.gravity.linear = arm.gravity
    return model, np.array([model.idx_vs[i] for i in ids]), np.array(ids)


@pytest.mark.parametrize(("n", "seed"), ARMS)
def test_regressor_and_torque_are_pinocchios(n, seed):
    pin = pytest.importorskip("pinocchio")
    arm = drawn_arm(n, seed)
    model, at, ids = with_pinocchio(pin, arm)
    data = model.createData()
    columns = np.concatenate([np.arange(10) + 10 * (i - 1) for i in ids])
    motion = arm.drawn_motion(5, seed)
    regressor, torque = arm.regressor(*motion), arm.inverse_dynamics(*motion)
    for t in range(5):
        q, v, a = (np.zeros(n) for _ in range(3))
        q[at], v[at], a[at] = (m[t] for m in motion)
        theirs = np.atleast_2d(pin.computeJointTorqueRegressor(model, data, q, v, a))
        np.testing.assert_allclose(regressor[t], theirs[at][:, columns], rtol=0, atol=1e-10)
        np.testing.assert_allclose(torque[t], pin.rnea(model, data, q, v, a)[at], rtol=0, atol=1e-10)


@pytest.mark.parametrize(("n", "seed"), ARMS)
def test_regressor_times_numbers_is_the_torque_and_the_mass_matrix_its_slope(n, seed):
    arm = drawn_arm(n, seed)
    q, v, a = arm.drawn_motion(4, seed)
    rest = np.zeros_like(q)
    np.testing.assert_allclose(
        arm.regressor(q, v, a) @ arm.inertial.ravel(), arm.inverse_dynamics(q, v, a), rtol=0, atol=1e-10
    )
    held, mass = arm.inverse_dynamics(q, rest, rest), arm.mass_matrix(q)
    for i in range(n):
        unit = rest + np.eye(n)[i]
        np.testing.assert_allclose(arm.inverse_dynamics(q, rest, unit) - held, mass[:, :, i], rtol=0, atol=1e-10)


@pytest.mark.parametrize(("n", "seed"), ARMS)
def test_power_of_the_drives_is_the_rate_of_the_energy(n, seed):
    """Whatever the signs of a convention: tau . v = d/dt (v' M v / 2 + potential), with gravity off for brevity."""
    arm = drawn_arm(n, seed, gravity=(0, 0, 0))
    q, v, a = arm.drawn_motion(3, seed)
    h = 1e-5

    def energy(s):
        qs, vs = q + s * v + 0.5 * s * s * a, v + s * a
        return 0.5 * np.einsum("ti,tij,tj->t", vs, arm.mass_matrix(qs), vs)

    power = np.einsum("ti,ti->t", arm.inverse_dynamics(q, v, a), v)
    np.testing.assert_allclose(power, (energy(h) - energy(-h)) / (2 * h), rtol=1e-6)
