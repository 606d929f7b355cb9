"""An MJCF model behind the three methods, and its repair."""

from __future__ import annotations

import numpy as np
import pytest

from tests.simulators.axis_xml import XML
from whsklearn.effects import HardeningSpring, InputDelay, LuGre, PreslidingHysteresis
from whsklearn.gap import GapFinder
from whsklearn.gap.record import ServoRecord
from whsklearn.simulators import MuJoCoSimulator

mujoco = pytest.importorskip("mujoco", reason="mujoco is not installed (extra mujoco)")


def test_it_replays_its_own_log(record):
    y = MuJoCoSimulator(XML.format(joint=""), joint="axis").simulate(record)
    assert np.std(record.position - y) < 1e-3 * np.std(record.position)


def test_refit_finds_a_wrong_damping(record):
    wrong = MuJoCoSimulator(XML.format(joint="").replace('damping="0.1"', 'damping="0.15"'), joint="axis")
    found = wrong.refit(record, np.ones(len(record), dtype=bool))
    assert found.parameters["damping"] == pytest.approx(0.1, rel=0.05)


def test_a_replay_begins_anew_after_a_hole(record):
    n = len(record)
    logged = np.r_[0 : n // 3, n // 2 : n]
    torn = ServoRecord(
        record.time[logged], record.drive[logged], record.position[logged] + np.where(logged < n // 2, 0.0, 0.01),
        starts=(n // 3,),
    )  # fmt: skip
    exact = MuJoCoSimulator(XML.format(joint=""), joint="axis")
    error = torn.position - exact.simulate(torn)
    assert np.std(error) < 3e-3 * np.std(torn.position)
    wrong = MuJoCoSimulator(XML.format(joint="").replace('damping="0.1"', 'damping="0.15"'), joint="axis")
    found = wrong.refit(torn, np.ones(len(torn), dtype=bool))
    assert found.parameters["damping"] == pytest.approx(0.1, rel=0.05)
    assert found.numbers.size == len(found.parameters) + 2  # a velocity for each segment


def test_a_joint_that_is_not_there_is_named():
    with pytest.raises(ValueError, match="no joint 'elbow'"):
        MuJoCoSimulator(XML.format(joint=""), joint="elbow", actuator="motor")


def test_a_joint_without_an_actuator_and_one_with_two_are_told_apart():
    free = XML.format(joint="").replace("<actuator>", "<actuator/><!--").replace("</actuator>", "-->")
    with pytest.raises(ValueError, match=r"No actuator drives the joint 'axis'.*none here"):
        MuJoCoSimulator(free, joint="axis")
    twice = XML.format(joint="").replace("</actuator>", '<position name="servo" joint="axis"/></actuator>')
    with pytest.raises(ValueError, match="motor, servo; say whose control was logged with --actuator"):
        MuJoCoSimulator(twice, joint="axis")
    assert MuJoCoSimulator(twice, joint="axis", actuator="servo").actuator == "servo"


def test_an_exact_model_has_no_gap_where_an_axis_at_rest_gets_a_hard_jump():
    """Mean velocity of the first samples is not velocity at the first: a start there missed by 100 encoder steps."""
    light = XML.format(joint="").replace('damping="0.1"', 'damping="0.15"').replace("0.05 0.05 0.05", "0.005 " * 3)
    model = mujoco.MjModel.from_xml_string(light)
    data, t = mujoco.MjData(model), np.arange(2000) / 500.0
    drive = 0.8 * np.cos(np.pi * t) + 0.3 * np.sin(2 * np.pi * 2.3 * t)
    y = np.empty(t.size)
    for i, u in enumerate(drive):
        y[i], data.ctrl[0] = data.qpos[0], u
        mujoco.mj_step(model, data, 2)
    log = ServoRecord(t, drive, STEP * np.round(y / STEP))
    exact = MuJoCoSimulator(light, joint="axis")
    assert np.max(np.abs(log.position - exact.simulate(log))) < STEP
    finder = GapFinder(exact).fit(log)
    assert finder.verdict_ == "no_gap"
    assert finder.model_.parameters["damping"] == pytest.approx(0.15, rel=1e-3)


def test_a_delay_is_held_between_two_steps(record):
    a, b, c = (
        MuJoCoSimulator(XML.format(joint=""), joint="axis").with_effect(InputDelay(t)).simulate(record)
        for t in (0.008, 0.0083, 0.009)
    )
    assert np.std(b - a) == pytest.approx(0.3 * np.std(c - a), rel=0.02)


def test_an_unstable_trial_says_nothing_and_writes_nothing(record, tmp_path, monkeypatch, capfd):
    monkeypatch.chdir(tmp_path)
    wild = MuJoCoSimulator(XML.format(joint=""), joint="axis").with_effect(HardeningSpring(-1e9))
    assert np.isnan(wild.simulate(record)[-1])
    assert list(tmp_path.iterdir()) == []
    assert "".join(capfd.readouterr()) == ""


def test_a_bristle_that_pushes_is_refused():
    with pytest.raises(ValueError, match="bristle"):
        MuJoCoSimulator(XML.format(joint=""), joint="axis").with_effect(PreslidingHysteresis(-0.1, 0.01))


STEP = 1e-4  # rad, of an encoder
RUBBING = XML.format(joint='frictionloss="0.15" solreffriction=".002 1"')


def read_by_an_encoder(simulator, record):
    """A log of a simulator, quantised; as long as the record."""
    still = ServoRecord(record.time, record.drive, 1e-12 * record.time)
    y = simulator.replay(still, 1e3, restart="smoothed")
    return ServoRecord(record.time, record.drive, STEP * np.round(y / STEP))


def test_a_replay_of_the_true_model_leaves_the_encoders_noise(record):
    log = read_by_an_encoder(MuJoCoSimulator(RUBBING, joint="axis"), record)
    truth, wrong = (MuJoCoSimulator(RUBBING.replace("0.15", x), joint="axis") for x in ("0.15", "0.18"))

    def left(simulator, restart):
        return np.sqrt(np.mean((log.position - simulator.replay(log, 0.5, restart=restart)) ** 2)) / (
            STEP / np.sqrt(12)
        )

    assert left(truth, "fitted") < 1.1
    assert left(truth, "smoothed") > 5.0  # velocity is blurred where friction turns
    assert left(wrong, "fitted") > 5.0  # and what is wrong in a model stays to be seen


def test_a_replay_begins_as_it_is_told(record):
    with pytest.raises(ValueError, match="fitted or smoothed"):
        MuJoCoSimulator(XML.format(joint=""), joint="axis").replay(record, 0.5, restart="guessed")


@pytest.mark.slow
def test_bristles_with_damping_in_place_of_dry_friction_are_named(record):
    true = LuGre(0.25, 0.05, ratio=1.0, damping=0.1)
    log = read_by_an_encoder(MuJoCoSimulator(XML.format(joint=""), joint="axis").with_effect(true), record)
    finder = GapFinder(MuJoCoSimulator(RUBBING, joint="axis")).fit(log)
    assert [e.name for e in finder.effects_] == ["presliding_hysteresis"]
    found = finder.effects_[0].effect
    assert (found.torque, found.distance, found.damping) == pytest.approx((0.25, 0.05, 0.1), rel=0.05)


@pytest.mark.slow
def test_a_range_struck_at_both_ends_is_named_and_written(record, tmp_path):
    """The ends stand about no special place: a spring about zero has no such stop."""
    low, high = -0.3, 0.9
    limited = XML.format(joint=f'limited="true" range="{low:.4f} {high:.4f}" solreflimit="0.02 1"')
    log = read_by_an_encoder(MuJoCoSimulator(limited, joint="axis"), record)
    finder = GapFinder(MuJoCoSimulator(XML.format(joint=""), joint="axis"), max_effects=1).fit(log)
    assert finder.effects_[0].name == "end_stop"
    assert finder.effects_[0].effect.ends == pytest.approx((low, high), abs=0.01 * np.ptp(log.position))
    assert "range=" in finder.model_.write(tmp_path / "repaired.xml").read_text()
