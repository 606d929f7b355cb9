"""A position servo of which command and position are logged: the command end to end on a servo simulated here."""

from __future__ import annotations

import json

import numpy as np
import pandas as pd
import pytest
from click.testing import CliRunner

from whsklearn.cli.gap import main
from whsklearn.gap.following_error import following_error
from whsklearn.gap.record import ServoRecord

RATE, SECONDS = 50.0, 40.0
GAIN, INERTIA, VISCOUS, COULOMB, GRAVITY = 30.0, 0.02, 1.5, 0.4, 3.0


def command_at(t):
    return 0.8 * np.sin(0.9 * t) + 0.5 * np.sin(2.3 * t + 1.0) + 0.15 * np.sin(5.1 * t + 2.0)


def servo(late: float, gravity: float, derivative: float = 0.0, integral: float = 0.0) -> pd.DataFrame:
    """Command and position (12 bits a turn) of gain u(c - q) = J a + B v + C s(v) + G cos q, by small steps."""
    n, fine = int(SECONDS * RATE), 200
    h, q, v, area = 1.0 / RATE / fine, 0.0, 0.0, 0.0
    out = np.empty(n)
    for i in range(n):
        out[i] = q
        asked = command_at((i + np.arange(fine) / fine) / RATE - late)
        for c, rate in zip(asked, np.gradient(asked, h), strict=True):
            area += h * (c - q)
            asks = c - q + derivative * (rate - v) + integral * area
            torque = GAIN * asks - VISCOUS * v - COULOMB * np.tanh(v / 0.01) - gravity * np.cos(q)
            v += h * torque / INERTIA
            q += h * v
    t = np.arange(n) / RATE
    step = 2 * np.pi / 4096
    return pd.DataFrame({"time_s": t, "command_rad": command_at(t), "position_rad": np.round(out / step) * step})


def record_of(log: pd.DataFrame, starts: tuple[int, ...] = ()) -> ServoRecord:
    time, command, position = (log[c].to_numpy() for c in ("time_s", "command_rad", "position_rad"))
    return ServoRecord(time, np.zeros_like(time), position, command, ("rad", "rad"), starts=starts)


@pytest.fixture(scope="module")
def hanging():
    return servo(late=0.06, gravity=GRAVITY)


def test_a_late_command_is_found_and_a_prompt_one_is_left(hanging):
    for log, late in ((hanging, 0.06), (servo(0.0, GRAVITY), 0.0)):
        _, found = following_error(record_of(log))
        assert (found.derivative, found.integral) == (0.0, 0.0)
        assert found.delay == pytest.approx(late, abs=2.1 / RATE)  # viscous friction takes up a part of a delay


@pytest.mark.parametrize(("derivative", "integral"), [(0.08, 0.0), (0.08, 1.5)])
def test_what_the_loop_does_of_the_error_beside_its_gain_is_found(derivative, integral):
    """A derivative passed for a late command and a friction that drives the axis."""
    _, found = following_error(record_of(servo(0.0, GRAVITY, derivative, integral)))
    assert found.delay == 0.0
    assert found.derivative == pytest.approx(derivative, rel=0.15)
    assert found.integral == pytest.approx(integral, rel=0.15)


def test_no_command_from_before_a_hole_acts_behind_it(hanging):
    # behind the hole the axis is a turn further: a command of the first segment there would be an error of 6 rad
    turn = 2.0 * np.pi
    far = hanging.assign(command_rad=hanging.command_rad + turn, position_rad=hanging.position_rad + turn)
    first, second = hanging.iloc[:1000], far.iloc[1150:]
    error, (delay, *_) = following_error(record_of(pd.concat([first, second]), starts=(1000,)))
    assert delay == pytest.approx(0.06, abs=2.1 / RATE)
    late = round(delay * RATE)
    for part, found in ((first, error[:1000]), (second, error[1000:])):
        command, position = part.command_rad.to_numpy(), part.position_rad.to_numpy()
        np.testing.assert_allclose(found[late:], command[:-late] - position[late:], atol=1e-12)
        np.testing.assert_allclose(found[:late], command[0] - position[:late], atol=1e-12)


def test_gravity_is_named_per_unit_of_the_loops_gain(hanging, tmp_path):
    hanging.to_csv(tmp_path / "servo.csv", index=False)
    arguments = [
        "--command",
        "command_rad",
        "--position",
        "position_rad",
        "--no-track",
        "--report",
        str(tmp_path / "r"),
    ]
    result = CliRunner().invoke(main, [str(tmp_path / "servo.csv"), *arguments])
    assert result.exit_code == 0, result.output
    assert "gain" in result.output
    data = json.loads((tmp_path / "r" / "gap.json").read_text(encoding="utf-8"))
    first = data["effects"][0]
    assert first["name"] == "gravity_imbalance"
    assert first["parameters"]["amplitude_rad"] == pytest.approx(GRAVITY / GAIN, rel=0.15)
    assert data["missing"]["after"] < 0.35 * data["missing"]["before"]
