"""Each check finds its fault in a log and nothing in a sound one."""

from __future__ import annotations

import numpy as np
import pytest

from whsklearn.logs import check_log

T = np.arange(4000) / 1000
DRIVE = np.sin(7 * T) + 0.3 * np.sin(31 * T)
POSITION = np.cos(7 * T)


def test_a_sound_log_has_no_finding_worse_than_a_remark():
    assert check_log(T, {"drive": DRIVE, "position": POSITION}).ok


@pytest.mark.parametrize("signal", ["drive", "position"])
def test_a_signal_that_does_not_move_is_found(signal):
    signals = {"drive": DRIVE, "position": POSITION, signal: np.zeros(T.size)}
    assert not check_log(T, signals).ok


def test_the_worst_comes_first():
    report = check_log(T, {"drive": np.zeros(T.size), "position": np.repeat(POSITION[::4], 4)})
    order = {"error": 0, "warning": 1, "info": 2}
    severities = [order[f.severity] for f in report.findings]
    assert severities == sorted(severities)


def test_jitter_is_that_of_the_clock():
    rng = np.random.default_rng(0)
    uneven = T + 1e-4 * rng.uniform(-1, 1, T.size)
    assert (
        check_log(uneven, {"drive": DRIVE, "position": POSITION}).jitter
        > 10 * check_log(T, {"drive": DRIVE, "position": POSITION}).jitter
    )


def test_an_input_of_steps_is_not_clipped():
    t = np.arange(2000) / 1000
    steps = np.random.default_rng(0).choice([-1.5, -0.5, 0.5, 1.5], 40).repeat(50)
    report = check_log(t, {"drive": steps, "position": np.cumsum(steps) / 1000})
    assert "LOG005" not in report.codes
