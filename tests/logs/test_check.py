"""Each check finds its fault in a log and nothing in a sound one."""

from __future__ import annotations

import numpy as np
import pytest

from whsklearn.logs import check_log
from whsklearn.logs.check import lattice

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


# --- the grid of the readings: found where there is one, to the digits that a file keeps, and not invented
RNG = np.random.default_rng(0)
PATH = np.sin(2 * np.arange(20_000) / 1000) + 0.3 * np.sin(7 * np.arange(20_000) / 1000)


@pytest.mark.parametrize("lines", [1000, 8192])
def test_the_step_of_an_encoder_is_found(lines):
    step = 2 * np.pi / lines
    assert lattice(step * np.round(PATH / step)) == pytest.approx(step, rel=1e-9)


def test_digits_cut_off_in_a_file_do_not_spoil_the_step():
    step = 2 * np.pi / 1000
    assert lattice(np.round(step * np.round(PATH / step), 5)) == pytest.approx(step, rel=1e-5)


def test_no_grid_is_invented():
    assert lattice(PATH + 1e-4 * RNG.normal(size=PATH.size)) == 0.0
    assert lattice(np.cumsum(RNG.standard_normal(5000))) == 0.0
    assert lattice(np.zeros(100)) == 0.0
    path = RNG.standard_normal(5000)
    assert (
        lattice(np.append(path, path[0] + 1e-10), distinct=1.0) == 0.0
    )  # the smallest difference is no step of others
