"""A position servo of which command and position are logged: the command end to end on a servo simulated here."""

from __future__ import annotations

import json

import numpy as np
import pandas as pd
import pytest
from click.testing import CliRunner

from whsklearn.cli.gap import main
from whsklearn.gap.following_error import following_error

RATE, SECONDS = 50.0, 40.0
GAIN, INERTIA, VISCOUS, COULOMB, GRAVITY = 30.0, 0.02, 1.5, 0.4, 3.0


def command_at(t):
    return 0.8 * np.sin(0.9 * t) + 0.5 * np.sin(2.3 * t + 1.0) + 0.15 * np.sin(5.1 * t + 2.0)


def servo(late: float, gravity: float) -> pd.DataFrame:
    """Command and position (12 bits a turn) of gain (c - q) = J a + B v + C s(v) + G cos q, by small explicit steps."""
    n, fine = int(SECONDS * RATE), 200
    h, q, v = 1.0 / RATE / fine, 0.0, 0.0
    out = np.empty(n)
    for i in range(n):
        out[i] = q
        asked = command_at((i + np.arange(fine) / fine) / RATE - late)
        for c in asked:
            torque = GAIN * (c - q) - VISCOUS * v - COULOMB * np.tanh(v / 0.01) - gravity * np.cos(q)
            v += h * torque / INERTIA
            q += h * v
    t = np.arange(n) / RATE
    step = 2 * np.pi / 4096
    return pd.DataFrame({"time_s": t, "command_rad": command_at(t), "position_rad": np.round(out / step) * step})


@pytest.fixture(scope="module")
def hanging():
    return servo(late=0.06, gravity=GRAVITY)


def test_a_late_command_is_found_and_a_prompt_one_is_left(hanging):
    for log, late in ((hanging, 0.06), (servo(0.0, GRAVITY), 0.0)):
        _, found = following_error(log.command_rad.to_numpy(), log.position_rad.to_numpy(), 1.0 / RATE)
        assert found == pytest.approx(late, abs=2.1 / RATE)  # viscous friction takes up a part of a delay


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
