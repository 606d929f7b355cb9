"""Logs as `load_log` returns them: their units and their holes reach the plant."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from click.testing import CliRunner

from whsklearn.cli.gap import main
from whsklearn.datasets import make_servo_log
from whsklearn.effects import GravityImbalance, as_law
from whsklearn.gap import GapFinder
from whsklearn.gap.plants import Base, make_plant
from whsklearn.gap.plants.from_log import following_error, taken_from
from whsklearn.gap.plants.servo_start import start_of
from whsklearn.gap.record import ServoRecord
from whsklearn.logs import LogWarning, load_log
from whsklearn.logs.check import lattice
from whsklearn.logs.load import Log
from whsklearn.models import AxisModel


@pytest.fixture(scope="module")
def frame():
    return make_servo_log([GravityImbalance(0.5)], duration=12.0, sample_rate=500.0, random_state=0)


def loaded(folder, frame, drive: str, position: str):
    """The log written with columns of these units, and read again."""
    columns = {
        "time_s": frame["time_s"],
        f"torque_{drive}": frame["torque_nm"] * {"nm": 1.0, "mnm": 1e3}[drive],
        f"position_{position}": frame["position_rad"] * {"rad": 1.0, "deg": 180.0 / np.pi}[position],
    }
    path = folder / f"{drive}_{position}.csv"
    type(frame)(columns).to_csv(path, index=False)
    return load_log(path, time="time_s", drive=f"torque_{drive}", position=f"position_{position}")


def test_a_log_in_other_units_gives_the_same_names_and_its_own_numbers(tmp_path, frame):
    found = {k: GapFinder("servo").fit(loaded(tmp_path, frame, *k)) for k in (("nm", "rad"), ("mnm", "deg"))}
    (si,), (other,) = (f.effects_ for f in found.values())
    assert si.name == other.name == "gravity_imbalance"
    assert other.parameters["amplitude_mnm"] == pytest.approx(1e3 * si.parameters["amplitude_nm"], rel=1e-3)


@pytest.mark.parametrize(("motion", "si"), [("as logged", ("Nm", "rad")), ("mm", ("N", "m"))])
def test_a_unit_that_is_not_stated_is_si_as_in_identify(motion, si):
    t = np.arange(400) / 100
    log = Log(time=t, X=np.cos(t)[:, None], y=np.sin(t), reference=None, command=None)
    log |= Log(groups=np.zeros(400, dtype=int), units={"drive": "as logged", "position": motion})
    assert taken_from(log, "servo")[0].units == si
    units = {"input": "as logged", "output": motion}
    assert AxisModel(0.1, as_law("viscous"), dt=0.01, units=units, logged="position").si == si


def test_several_logs_of_other_units_are_joined(tmp_path, frame):
    logs = [loaded(tmp_path, frame, "nm", "rad"), loaded(tmp_path, frame.iloc[:3000], "mnm", "deg")]
    assert GapFinder("servo", max_effects=1).fit(logs).effects_[0].name == "gravity_imbalance"


def test_the_holes_of_a_log_are_kept(tmp_path, frame):
    with pytest.warns(LogWarning, match="hole"):
        log = loaded(tmp_path, frame.drop(range(2500, 3500)), "nm", "rad")
    assert taken_from(log, "servo")[0].starts == (2500,)


def test_the_grid_of_the_readings_is_known_after_resampling(tmp_path, frame):
    """Own records of a coarse encoder without its grid had no trace of it, and presliding friction was seen in it."""
    step, rng = 0.05, np.random.default_rng(0)  # deg
    coarse = frame.iloc[:3000:2].copy()
    coarse["time_s"] += 2e-4 * rng.standard_normal(len(coarse))
    path = np.rad2deg(np.interp(coarse["time_s"], frame["time_s"], frame["position_rad"]))
    coarse["position_rad"] = np.deg2rad(step * np.round(path / step))
    with pytest.warns(LogWarning, match="resampled"):
        record = taken_from(loaded(tmp_path, coarse, "nm", "deg"), "servo")[0]
    assert lattice(record.position) == 0.0
    view, _ = start_of(record, ("viscous", "coulomb"), 0.004)
    assert view.quantum == record.quantum == pytest.approx(np.deg2rad(step), rel=1e-6)
    fine = replace(record, quantum=1e-9)  # decimals of the file are no grid worth knowing
    assert start_of(fine, ("viscous", "coulomb"), 0.004)[0].quantum == 0.0


def test_what_stands_for_a_drive_that_was_not_logged_is_in_the_notes(tmp_path, frame):
    frame = frame.iloc[:3000].assign(command_rad=frame["position_rad"] + 0.2 * frame["torque_nm"])
    frame.to_csv(tmp_path / "servo.csv", index=False)
    log = load_log(tmp_path / "servo.csv", time="time_s", command="command_rad", position="position_rad")
    notes = GapFinder("servo", max_effects=0).fit(log).diagnosis_.notes
    assert any("No drive is logged: command minus position" in text for text in notes)


def test_a_chain_takes_the_units_of_the_log(tmp_path, frame):
    plant = make_plant(
        "wiener-hammerstein", loaded(tmp_path, frame, "mnm", "deg"), None, Base(), tolerance=0.01, columns={}
    )
    assert plant.logged == ("mNm", "deg")
    assert plant.units == ("Nm", "rad")


# --- a position servo of which command and position are logged: the command end to end on a servo simulated here -----
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
