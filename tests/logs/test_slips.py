"""Slips are found on an axis that has one, and on no axis that has none."""

from __future__ import annotations

import numpy as np
import pytest
from sklearn.utils import Bunch

from whsklearn.datasets import make_servo_log
from whsklearn.effects import CableSpring, Cogging, GravityImbalance, InputOffset
from whsklearn.logs import load_log
from whsklearn.logs.slips import slips_in, time_slips


def log(effects=(), seed=0, **changes):
    frame = make_servo_log(list(effects), duration=12.0, random_state=seed)
    u, y, t = (frame[c].to_numpy() for c in ("torque_nm", "position_rad", "time_s"))
    made = Bunch(time=t, X=u[:, None], y=y, units={"time": "s", "position": "rad"}, command=None)
    made.update(changes)
    return made


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize(
    "effects", [(), (Cogging(0.3, 12.0),), (GravityImbalance(1.5),)], ids=["plain", "cogging", "pendulum"]
)
def test_a_sound_log_has_none(effects, seed):
    assert slips_in(log(effects, seed)) == []


@pytest.mark.parametrize("seed", range(4))
def test_each_slip_is_named_with_the_option_that_mends_it(seed):
    good = log(seed=seed)
    dt = good.time[1] - good.time[0]
    for changes, option in (
        ({"X": -good.X}, "--invert-drive"),
        ({"y": np.gradient(good.y, dt)}, "--velocity"),
        ({"X": good.y[:, None], "y": good.X[:, 0]}, "the other way round"),
        ({"y": np.degrees(good.y)}, "position=deg"),
        ({"time": 1e3 * good.time}, "time=ms"),
        ({"time": 1e-6 * good.time, "units": {"time": "us", "position": "rad"}}, "time=s"),
        ({"time": 1e-6 * good.time}, "--rate"),  # the unit is s already: that it were s would be no advice
        ({"units": {"position": "rad/s"}}, "--velocity"),
    ):
        found = slips_in(log(seed=seed, **changes))
        assert found, option
        assert option in found[0].option
        assert str(found[0]).count(".") >= 1


@pytest.mark.parametrize("rate", [1000, 250, 50])
def test_seconds_in_a_column_called_ms_are_told(tmp_path, rate):
    """The header's unit is asked: the time of the log is in seconds whatever it was."""
    good = log()
    rows = zip(np.arange(good.y.size) / rate, good.X[:, 0], good.y, strict=True)
    path = tmp_path / "a.csv"
    path.write_text("time_ms,torque_nm,position_rad\n" + "\n".join(f"{t:.4f},{u},{q}" for t, u, q in rows))
    assert [s.option for s in slips_in(load_log(path))] == ["--unit time=s"]


def test_a_long_log_of_20_khz_is_in_ms():
    time = np.arange(80_000) * 5e-5
    assert time_slips(time, "ms") == []


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("effects", [(), (Cogging(0.3, 12.0),), (CableSpring(2.0, 0.3),)])
def test_a_magnitude_lacks_its_sign(effects, seed):
    good = log(effects, seed)
    assert "magnitude" in slips_in(log(effects, seed, X=np.abs(good.X)))[0].sentence


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("effects", [(), (Cogging(0.3, 12.0),), (GravityImbalance(1.5),), (CableSpring(2.0, 0.3),)])
def test_a_lift_is_driven_one_way_and_moves_both_ways(effects, seed):
    held = log([*effects, InputOffset(30.0)], seed)
    late = held.time > 1.0  # once the controller holds the load
    held.time, held.X, held.y = held.time[late], held.X[late], held.y[late]
    assert held.X.min() > 0.0
    assert slips_in(held) == []


def test_a_velocity_that_was_summed_up_turns_for_as_long_as_it_likes():
    good = log()
    spun = {"y": 10.0 * np.sin(good.time) + 3.0 * good.y}
    assert "position=deg" in slips_in(log(**spun))[0].option
    assert slips_in(log(**spun, columns={"velocity": "omega", "drive": "u"})) == []


def test_milliseconds_are_asked_about_from_a_twentieth_of_a_second_on_unless_the_column_states_its_unit():
    """10 kHz in ms without a unit is a sample every 0.1 s; a column named time_ms was read by its name."""
    good = log()
    slow = {"time": 0.1 * np.arange(good.time.size)}
    assert "time=ms" in slips_in(log(**slow, columns={"time": "t"}))[0].option
    assert slips_in(log(**slow, columns={"time": "time_ms"})) == []
    much = {"time": 0.25 * np.arange(good.time.size)}  # what is called s may still be ms
    assert "time=ms" in slips_in(log(**much, columns={"time": "time_s"}))[0].option


def test_at_one_speed_nothing_is_said_about_the_sign_of_the_drive():
    t = np.arange(6000) / 500
    drive = 0.4 + 0.01 * np.random.default_rng(0).normal(size=t.size)
    assert slips_in(Bunch(time=t, X=drive[:, None], y=t, units={}, command=None)) == []
