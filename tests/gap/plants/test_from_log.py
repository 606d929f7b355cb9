"""Logs as `load_log` returns them: their units and their holes reach the plant."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from whsklearn.datasets import make_servo_log
from whsklearn.effects import GravityImbalance, as_law
from whsklearn.gap import GapFinder
from whsklearn.gap.plants import Base, make_plant
from whsklearn.gap.plants.from_log import taken_from
from whsklearn.gap.plants.servo_start import start_of
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
