"""What moved at which joint of an arm: loads, friction, drives; poor joints are told, short records refused."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from whsklearn.compare import ArmLog, compare_arms
from whsklearn.compare.arm import arm_rows, independent, poor_joints
from whsklearn.compare.estimate import Estimate, Summand, estimate
from whsklearn.compare.hypotheses import at_one_point, between
from whsklearn.datasets import default_arm, make_arm_log
from whsklearn.effects import Cogging, Coulomb
from whsklearn.identification.payload import INERTIAS

ARM = default_arm()  # yaw and pitch: no drive shows what it weighs, only its moment


def record(arm=ARM, seed=0, seconds=20.0, **effects):
    return ArmLog(500.0, *make_arm_log(arm, effects, duration=seconds, random_state=seed, return_arrays=True))


@pytest.fixture(scope="module")
def before():
    return record()


def test_a_load_is_told_by_its_moment_where_no_drive_shows_its_mass(before):
    found = compare_arms([before, record(ARM.with_body("pitch", 0.4, [0.1, 0.05, 0.0]), seed=1)], ARM)
    assert found.changes[0].name == "moment at pitch"
    low, high = found.changes[0].interval
    assert low < 0.4 * np.hypot(0.1, 0.05) < high
    assert "kg m" in found.sentence


def test_a_load_with_an_inertia_of_its_own_is_one_change(before):
    loaded = ARM.with_body("pitch", 0.4, [0.1, 0.05, 0.0], 0.003 * np.eye(3))
    found = compare_arms([before, record(loaded, seed=1)], ARM)
    assert [c.name for c in found.changes] == ["moment at pitch"]


def test_friction_is_told_at_its_joint(before):
    found = compare_arms([before, record(seed=1, yaw=[Coulomb(0.1)])], ARM)
    assert [c.name for c in found.changes] == ["coulomb at yaw"]
    low, high = found.changes[0].interval
    assert low < 0.1 < high


def test_a_drive_that_reads_too_much_is_the_gain_of_its_joint(before):
    other = record(seed=1)
    found = compare_arms([before, other._replace(drive=other.drive * [1.0, 1.25])], ARM)
    assert found.changes[0].name == "gain at pitch"
    assert found.changes[0].after == pytest.approx(0.8, abs=0.02)


def test_a_late_drive_is_the_delay_of_its_joint(before):
    other = record(seed=1)
    late = np.column_stack([other.drive[:, 0], np.roll(other.drive[:, 1], -15)])  # logged 30 ms before it acts
    found = compare_arms([before, other._replace(drive=late)], ARM)
    assert found.changes[0].name == "delay at pitch"
    assert found.changes[0].change == pytest.approx(0.03, abs=0.004)


def test_equal_records_are_named_nothing(before):
    found = compare_arms([before, record(seed=1)], ARM)
    assert (found.verdict, found.changes) == ("nothing", [])
    assert found.smallest_seen["moment at pitch"] < 0.02
    assert any(f" % of the drive of {joint} is in none of these numbers" in found.sentence for joint in ARM.joints)


def test_what_no_number_explains_is_told_of_the_joint_that_lacks_something(before):
    """The rows of that joint weigh little beside those of the others."""
    waved = record(pitch=[Cogging(0.1, order=6.0)])
    yaw, pitch = np.transpose([estimate(r).left for r in arm_rows([before, waved], ARM, "ab")])
    assert yaw[1] == pytest.approx(yaw[0], rel=0.3)
    assert pitch[1] > 3.0 * pitch[0]


def test_a_joint_that_the_arm_does_not_explain_is_told_and_not_asked(before):
    rng = np.random.default_rng(0)
    walk = np.cumsum(rng.normal(size=(len(before.drive), 1)), axis=0) * [0.0, 0.2]
    noisy = [r._replace(drive=r.drive + walk) for r in (before, record(seed=1))]
    rows = arm_rows(noisy, ARM, ["a", "b"])
    assert list(poor_joints(rows, ARM.joints)) == ["pitch"]
    found = compare_arms(noisy, ARM)
    assert not any("pitch" in c.name and "moment" not in c.name for c in found.changes)
    assert "of the drive of pitch unexplained" in found.notes[-1]


def test_a_short_record_is_refused_with_its_name(before):
    short = before._replace(position=before.position[:1000], drive=before.drive[:1000])
    found = compare_arms([before, short], ARM, ["good.csv", "bad.csv"])
    assert found.verdict == "cannot_tell"
    assert found.reason.startswith("bad.csv: Record too short")
    assert not found.usable


def test_a_column_that_others_make_is_not_independent():
    columns = np.array([[1.0, 0.0, 1.0], [0.0, 1.0, 1.0], [0.0, 0.0, 0.0]])
    assert independent(columns, np.ones(3), [0, 1, 2]) == [0, 1]


def test_the_inertia_of_a_load_is_that_of_one_point(before):
    """Along the derivatives at a place, mass and moments say all ten numbers of a body there."""
    mass, place = 0.7, np.array([0.1, -0.05, 0.2])
    inertia = mass * (place @ place * np.eye(3) - np.outer(place, place))
    numbers = np.concatenate([[mass], mass * place, [inertia[i, j] for i, j in INERTIAS]])
    rows = arm_rows([before, before], ARM, ["a", "b"])
    parts = [estimate(r) for r in rows]
    d = between(rows, parts[:1], parts[1:])
    known = (Summand(1e-6 * np.eye(10), 10.0),)
    first, second = Estimate("a", np.zeros(10), known, np.zeros(1), {}), Estimate("b", numbers, known, np.zeros(1), {})
    d = replace(d, names=tuple("0123456789"), first=first, second=second)
    step = np.array([mass, *(mass * place)])
    np.testing.assert_allclose(at_one_point(np.eye(10), d, np.zeros((10, 0))) @ step, numbers, rtol=1e-4, atol=1e-5)
