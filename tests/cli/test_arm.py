"""An arm through the commands: identify, simulate, export, and what a wrong log or option is told."""

from __future__ import annotations

import json
import re

import numpy as np
import pandas as pd
import pytest
from click.testing import CliRunner

from whsklearn.cli.arm import gap_log, keep_gains
from whsklearn.cli.arm_log import gains_of, guessed_columns, joint_columns
from whsklearn.cli.compare import main as compare
from whsklearn.cli.export import main as export
from whsklearn.cli.gap import main as gap
from whsklearn.cli.identify import main as identify
from whsklearn.cli.simulate import main as simulate
from whsklearn.cli.stream import arm_stream
from whsklearn.cli.stream import main as stream
from whsklearn.datasets import default_arm, make_arm_log
from whsklearn.effects import Cogging
from whsklearn.export import export_model
from whsklearn.models import load_model, save_model
from whsklearn.models.arm import ArmModel
from whsklearn.systems import Arm

pytestmark = pytest.mark.usefixtures("library_effects")

pytest.importorskip("mujoco")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    out = tmp_path_factory.mktemp("arm")
    log = make_arm_log(duration=8.0)
    log.to_csv(out / "arm.csv", index=False)
    export_model(default_arm(), to="mjcf", out=out / "arm.xml")
    bare = log.rename(columns=dict(zip(log.columns[1:], "r1 p1 u1 r2 p2 u2".split(), strict=True)))
    bare.to_csv(out / "bare.csv", index=False)
    done = run(identify, out / "arm.csv", "--robot", out / "arm.xml", "--out", out / "model", "--no-track")
    assert done.exit_code == 0, done.output
    return out, done.output


OF_GAP = dict.fromkeys(("time_column", "rate", "joints", "gains", "load", "loaded", "law")) | {"units": ()}


def run(command, *arguments):
    return CliRunner().invoke(command, [str(a) for a in arguments])


def test_identify_writes_base_numbers_beside_the_files_and_errors_by_joint(folder):
    out, said = folder
    found = json.loads((out / "model" / "identify.json").read_text())
    assert found["recommended"] == "arm"
    numbers = {p["name"]: p for p in found["parameters"]}
    pitch = numbers["pitch.mx"]
    assert pitch["nominal"] == pytest.approx(0.18)
    assert abs(pitch["value"] - 0.18) < 5 * pitch["standard_error"] < 0.01
    assert {j["name"] for j in found["joints"]} == {"yaw", "pitch"}
    assert all(j["missing"] < 0.02 < j["one_axis_at_a_time"] for j in found["joints"])
    assert "one axis at a time" in said
    assert max(map(len, said.splitlines())) <= 100
    assert load_model(out / "model" / "model.json").kind == "arm"


def test_simulate_and_export_take_the_model(folder):
    out, _ = folder
    model = out / "model" / "model.json"
    done = run(simulate, model, out / "arm.csv", "--out", out / "run.csv", "--no-track")
    assert done.exit_code == 0, done.output
    table = np.genfromtxt(out / "run.csv", delimiter=",", names=True)
    error = table["pitch_simulated"] - table["pitch_measured"]
    assert error[250:].std() < 0.02 * table["pitch_measured"].std()
    done = run(export, model, "--to", "mjcf", "--out", out / "again.xml")
    assert done.exit_code == 0, done.output
    assert "armature" in (out / "again.xml").read_text()
    done = run(export, model, "--to", "table", "--out", out / "tables")
    assert done.exit_code == 2
    assert "An arm of 2 joints is exported to mjcf, urdf or c, not to table." in done.output


def test_a_law_given_to_identify_is_all_the_friction_of_the_joints(folder):
    out, _ = folder
    robot = "--robot", out / "arm.xml", "--no-track"
    done = run(identify, out / "arm.csv", *robot, "--law", "viscous,coulomb,stribeck", "--out", out / "law")
    assert done.exit_code == 0, done.output
    arm = load_model(out / "law" / "model.json").arm
    assert [e.name for e in arm.effects[1]] == ["viscous", "coulomb", "stribeck", "input_offset"]


def test_all_segments_of_a_log_with_holes_are_used(folder):
    out, _ = folder
    pieces = [make_arm_log(duration=s, random_state=k) for k, s in enumerate((4.0, 5.0, 1.0))]
    for k, piece in enumerate(pieces):
        piece["time_s"] += 10.0 * k
    pd.concat(pieces).to_csv(out / "pieces.csv", index=False)
    done = run(gap, out / "pieces.csv", "--robot", out / "arm.xml", "--report", out / "pieces", "--no-track")
    assert done.exit_code == 0, done.output
    assert "4500 of 5000 samples are used" in " ".join(done.output.split())
    assert json.loads((out / "pieces" / "gap.json").read_text())["rows"]["used"] == 4500
    done = run(simulate, out / "model" / "model.json", out / "pieces.csv", "--out", out / "run.csv", "--no-track")
    assert done.exit_code == 0, done.output
    table = np.genfromtxt(out / "run.csv", delimiter=",", names=True)
    assert len(table) == 4500
    error = table["pitch_simulated"] - table["pitch_measured"]
    assert np.abs(error[2000:2250]).max() < 0.3  # behind the hole a run starts from the motion there


def test_columns_may_be_named_and_drives_be_currents(folder):
    out, _ = folder
    named = "--joints", "pitch:p2,u2;yaw:p1,u1", "--gains", "yaw:2;pitch:2"
    arguments = "--robot", out / "arm.xml", "--out", out / "twice", "--time", "time_s", "--no-track"
    done = run(identify, out / "bare.csv", *arguments, *named)
    assert done.exit_code == 0, done.output
    once, twice = (load_model(out / f / "model.json").parameters for f in ("model", "twice"))
    assert twice["pitch.mx"] == pytest.approx(2 * once["pitch.mx"], rel=1e-6)


@pytest.mark.parametrize(
    ("log", "more", "said"),
    [
        ("bare.csv", [], "name all joints with --joints"),
        ("arm.csv", ["--joints", "yaw:"], "expected NAME:POSITION,DRIVE"),
        ("arm.csv", ["--joints", "elbow:a,b"], "no joint 'elbow'"),
        ("arm.csv", ["--joints", "yaw:a,b;pitch:a,c"], "gives column 'a' twice"),
        ("arm.csv", ["--gains", "yaw:x"], "NM_PER_AMPERE"),
    ],
)
def test_what_is_wrong_is_told_in_one_sentence(folder, log, more, said):
    out, _ = folder
    done = run(identify, out / log, "--robot", out / "arm.xml", "--out", out / "no", "--no-track", *more)
    assert done.exit_code == 2
    assert said in " ".join(done.output.split())
    assert "Traceback" not in done.output


@pytest.mark.parametrize(
    ("change", "more", "said"),
    [
        (
            {"p1": lambda t: np.rad2deg(t["p1"]), "p2": lambda t: np.rad2deg(t["p2"])},
            [],
            "taken as degrees; give --unit position=deg",
        ),
        ({"u1": lambda t: t["u2"], "u2": lambda t: t["u1"]}, [], "The drives fit far better if the"),
        ({"p2": lambda t: 0.3}, [], "pitch does not move"),
        (
            {"u1": lambda t: 1e3 * t["u1"], "u2": lambda t: 1e3 * t["u2"]},
            [],
            "for currents in mA, give --unit drive=mA and --gains",
        ),
        ({}, ["--gains", "yaw:1;pitch:2"], "times what the masses given require; check gain"),
        ({}, ["--gains", "yaw:-1;pitch:1"], "check gain, unit and sign there"),
        ({"p2": lambda t: 0.5 * t["p1"]}, [], "All joints move along one line"),
        ({"u2": lambda t: 0.0}, [], "The drive of pitch is zero throughout"),
        ({"p1": lambda t: 0.0, "p2": lambda t: 0.0}, [], "No joint moves more than its encoder's noise"),
        ({}, ["--joints", "pitch:p2,u2"], "--joints does not name yaw, which is taken to stand still at zero"),
        (
            {"u2": lambda t: np.where(np.arange(len(t)) < len(t) / 2, t["u2"], 9.0 * t["u1"])},
            [],
            "What one part of the log says of pitch does not hold in another",
        ),
        ({}, ["--joints", "yaw:p1,u1;pitch:p9,u2"], "p9"),
        ({}, ["--joints", "yaw:p1,u1;pitch:p2,u2", "--time", "nowhere"], "nowhere"),
    ],
)
def test_what_is_doubtful_in_a_log_is_told_in_one_sentence(folder, tmp_path, change, more, said):
    out, _ = folder
    table = pd.read_csv(out / "bare.csv")
    table.assign(**{name: new(table) for name, new in change.items()}).to_csv(tmp_path / "log.csv", index=False)
    named = [] if "--joints" in more else ["--joints", "yaw:p1,u1;pitch:p2,u2"]
    named += [] if "--time" in more else ["--time", "time_s"]
    done = run(
        identify, tmp_path / "log.csv", "--robot", out / "arm.xml", "--out", tmp_path, "--no-track", *named, *more
    )
    told = " ".join(done.output.split())
    assert told.count(said) == 1, told
    assert "Traceback" not in done.output


@pytest.mark.parametrize(
    ("inner", "said"),
    [
        ("<equality><joint joint1='pitch' joint2='yaw'/></equality>", "follows joint 'yaw' (mimic)"),
        ("<equality><connect body1='pitch_link' anchor='0.2 0 0'/></equality>", "has a closed loop"),
    ],
)
def test_a_robot_whose_joints_are_bound_is_refused_in_one_sentence(folder, tmp_path, inner, said):
    out, _ = folder
    text = (out / "arm.xml").read_text().replace("</mujoco>", f"{inner}</mujoco>")
    (tmp_path / "bound.xml").write_text(text)
    done = run(identify, out / "arm.csv", "--robot", tmp_path / "bound.xml", "--out", tmp_path, "--no-track")
    assert done.exit_code == 2
    assert " ".join(done.output.split()).count(said) == 1
    assert "Traceback" not in done.output
    assert not (tmp_path / "model.json").exists()


def test_a_name_or_a_number_tells_whose_column_it_is():
    names = ["time_s", "position_1_rad", "torque_1_nm", "position_2_rad", "torque_2_nm"]
    assert guessed_columns(["a", "b"], names)["b"] == ("position_2_rad", "torque_2_nm")
    assert guessed_columns(["a"], ["a_angle_deg", "a_current_a", "b_angle_deg"]) == {
        "a": ("a_angle_deg", "a_current_a")
    }
    assert joint_columns(" a: q , i ;") == {"a": ("q", "i")}
    assert gains_of("a:1.5;b:2+-0.1") == {"a": (1.5, 0.0), "b": (2.0, 0.1)}


@pytest.mark.parametrize(
    ("families", "position", "drive"),
    [
        ("target_q_# actual_q_# actual_qd_# target_moment_# actual_current_#", "actual_q_0", "actual_current_0"),
        ("q# dq# q_d# tau_J# tau_J_d# dtau_J# tau_ext_hat_filtered#", "q0", "tau_J0"),
        ("position[#] velocity[#] effort[#]", "position[0]", "effort[0]"),
        ("/joint_states.position.# /joint_states.effort.#", "/joint_states.position.0", "/joint_states.effort.0"),
        ("arm2_J#_Pos arm2_J#_Vel arm2_J#_Trq", "arm2_J0_Pos", "arm2_J0_Trq"),
        ("pos_# vel_# eff_#", "pos_0", "eff_0"),
        ("enc#_deg cmd#_deg iq#_mA", "enc0_deg", "iq0_mA"),
        ("encoder_# position_# current_#", "position_0", "current_0"),
    ],
)
@pytest.mark.parametrize("first", [0, 1])
def test_columns_of_other_makers_are_taken_in_the_robots_order(families, position, drive, first):
    names = ["time", *(f.replace("#", str(first + k)) for f in families.split() for k in (2, 0, 1))]
    found = guessed_columns(["a_joint", "b_joint", "c_joint"], names)
    for k, joint in enumerate("abc"):
        place = str(first + k)
        assert found[f"{joint}_joint"] == (position.replace("0", place), drive.replace("0", place))


@pytest.mark.parametrize("names", ["motor_pos_0 motor_pos_1 link_pos_0 link_pos_1 tau_0 tau_1", "q_1 q_3 tau_1 tau_3"])
def test_columns_that_may_be_of_several_kinds_or_joints_are_not_guessed(names):
    with pytest.raises(ValueError, match="name all joints with --joints"):
        guessed_columns(["a", "b"], names.split())


def test_identify_uses_every_trajectory_of_a_log_with_pauses(folder, tmp_path):
    out, _ = folder
    parts = [make_arm_log(duration=6.0, random_state=k) for k in (3, 4)]
    parts[1]["time_s"] += 20.0
    pd.concat(parts).to_csv(tmp_path / "two.csv", index=False)
    done = run(identify, tmp_path / "two.csv", "--robot", out / "arm.xml", "--out", tmp_path, "--no-track")
    assert done.exit_code == 0, done.output
    both, once = (load_model(f / "model.json") for f in (tmp_path, out / "model"))
    assert both.standard_errors["pitch.mx"] < 2.0 * once.standard_errors["pitch.mx"]
    assert abs(both.parameters["pitch.mx"] - 0.18) < 5 * both.standard_errors["pitch.mx"]
    assert all(j["missing"] < 0.02 for j in json.loads((tmp_path / "identify.json").read_text())["joints"])


def test_gap_names_what_a_joint_lacks(folder):
    out, _ = folder
    make_arm_log(effects={"pitch": [Cogging(0.1, order=7.0)]}, duration=8.0).to_csv(out / "hidden.csv", index=False)
    done = run(gap, out / "hidden.csv", "--robot", out / "arm.xml", "--report", out / "gap", "--no-track")
    assert done.exit_code == 0, done.output
    written = json.loads((out / "gap" / "gap.json").read_text())
    assert [(e["name"], e["joint"]) for e in written["effects"]] == [("cogging", "pitch")]
    assert "cogging at pitch" in " ".join(done.output.split())
    assert load_model(out / "gap" / "repaired.json").kind == "arm"


def test_gap_tests_the_repaired_arm_on_a_second_log_and_refuses_the_first(folder):
    out, _ = folder
    hidden = {"pitch": [Cogging(0.1, order=7.0)]}
    for name, seed in (("one", 1), ("two", 2)):
        make_arm_log(effects=hidden, duration=8.0, random_state=seed).to_csv(out / f"{name}.csv", index=False)
    options = ["--robot", out / "arm.xml", "--report", out / "tested", "--no-track"]
    done = run(gap, out / "one.csv", *options, "--test", out / "two.csv")
    assert done.exit_code == 0, done.output
    rows = json.loads((out / "tested" / "gap.json").read_text())["test"]
    assert rows
    assert all(r["after"] < 0.5 * r["before"] for r in rows)
    done = run(gap, out / "one.csv", *options, "--test", out / "one.csv")
    assert done.exit_code != 0
    assert "the test would use data of the fit" in " ".join(done.output.split())


@pytest.mark.slow
def test_gap_finds_gains_by_a_load_and_a_load_by_an_identified_model(folder):
    out, _ = folder
    one = ["--max-effects", "1", "--no-track"]
    place = (0.1, 0.0, 0.05)
    heavy = default_arm().with_body("pitch", 0.8, place)
    for name, arm in (("empty", default_arm()), ("loaded", heavy)):
        log = make_arm_log(arm, duration=8.0)
        amperes = log.rename(columns=lambda c: c.replace("torque_nm", "current_a"))
        amperes[[c for c in amperes if c.endswith("_a")]] /= 5.0
        amperes.to_csv(out / f"{name}_a.csv", index=False)
        log.to_csv(out / f"{name}.csv", index=False)
    known = ["--load", "0.8:0.1,0,0.05", "--loaded", out / "loaded_a.csv"]
    done = run(gap, out / "empty_a.csv", "--robot", out / "arm.xml", *known, "--report", out / "by_load", *one)
    assert done.exit_code == 0, done.output
    gains = gains_of(re.search(r"known load: (\S+)", done.output)[1])
    assert gains["pitch"][0] == pytest.approx(5.0, rel=0.03)
    model = out / "model" / "model.json"
    done = run(gap, out / "loaded.csv", "--robot", model, "--report", out / "load", *one)
    assert done.exit_code == 0, done.output
    found = json.loads((out / "load" / "gap.json").read_text())["effects"][0]
    assert (found["name"], found["joint"]) == ("payload", "pitch")
    assert abs(found["parameters"]["mass_kg"] - 0.8) < 3 * found["standard_errors"]["mass_kg"] < 0.05
    unknown = ["--loaded", out / "loaded.csv", "--report", out / "pair", *one]
    done = run(gap, out / "empty.csv", "--robot", out / "arm.xml", *unknown)
    assert done.exit_code == 0, done.output
    pair = json.loads((out / "pair" / "gap.json").read_text())["effects"][0]
    assert (pair["name"], pair["joint"]) == ("payload", "pitch")
    assert abs(pair["parameters"]["mass_kg"] - 0.8) < 3 * pair["standard_errors"]["mass_kg"] < 0.05


def test_compare_finds_a_load_and_writes_its_page(folder, tmp_path):
    out, _ = folder
    log = make_arm_log(default_arm().with_body("pitch", 0.8, (0.1, 0.0, 0.05)), duration=8.0, random_state=1)
    log.to_csv(tmp_path / "loaded.csv", index=False)
    logs = out / "arm.csv", tmp_path / "loaded.csv"
    done = run(compare, *logs, "--robot", out / "arm.xml", "--out", tmp_path / "moved", "--no-track")
    assert done.exit_code == 0, done.output
    (found,) = json.loads((tmp_path / "moved" / "compare.json").read_text())["changes"]
    assert found["name"] == "moment at pitch"  # two axes do not tell the mass from where it is
    page = (tmp_path / "moved" / "compare.html").read_text(encoding="utf-8")
    assert "loaded.csv: yaw from &#39;yaw_position_rad&#39; and &#39;yaw_torque_nm&#39;" in page


def test_gap_refuses_columns_in_another_order_and_tells_the_right_one(folder):
    out, _ = folder
    log = make_arm_log(duration=5.0)
    swapped = {"yaw_torque_nm": "pitch_torque_nm", "pitch_torque_nm": "yaw_torque_nm"}
    log.rename(columns=swapped).to_csv(out / "swapped.csv", index=False)
    done = run(gap, out / "swapped.csv", "--robot", out / "arm.xml", "--report", out / "s", "--no-track")
    assert done.exit_code != 0
    assert "the drives given for yaw, pitch are those of pitch, yaw" in " ".join(done.output.split())
    written = json.loads((out / "s" / "gap.json").read_text())
    assert (written["verdict"], written["effects"]) == ("data_problem", [])


def test_gap_refuses_half_a_load_in_a_sentence(folder):
    out, _ = folder
    done = run(gap, out / "arm.csv", "--robot", out / "arm.xml", "--load", "2.8", "--report", out / "g", "--no-track")
    assert done.exit_code == 2
    assert "give the log with it as --loaded" in " ".join(done.output.split())
    done = run(
        gap, out / "arm.csv", "--robot", out / "arm.xml", "--gains", "hip:1", "--report", out / "g", "--no-track"
    )
    assert "names 'hip'" in " ".join(done.output.split())
    for load in ("-2", "nan", "2.8:0,0"):
        pair = ["--load", load, "--loaded", out / "arm.csv"]
        done = run(gap, out / "arm.csv", "--robot", out / "arm.xml", *pair, "--report", out / "g", "--no-track")
        assert done.exit_code == 2
        assert "expected KG or KG:X,Y,Z" in " ".join(done.output.split())


def test_a_torque_has_no_gain_and_options_of_an_arm_need_its_file(folder):
    out, _ = folder
    make_arm_log(duration=5.0).to_csv(out / "stated.csv", index=False)
    pair = ["--load", "2", "--loaded", out / "stated.csv"]
    done = run(gap, out / "stated.csv", "--robot", out / "arm.xml", *pair, "--report", out / "g", "--no-track")
    assert done.exit_code == 2
    assert "is in Nm, so no gain in Nm per A applies" in " ".join(done.output.split())
    of_arms = (gap, "--loaded", out / "arm.csv"), (gap, "--joints", "a:b,c"), (identify, "--gains", "a:1")
    for command, *more in of_arms:
        done = run(command, out / "arm.csv", *more, "--no-track")
        assert done.exit_code == 2
        assert "is for arms; give the robot's file with --robot" in " ".join(done.output.split())


def records(path, kind):
    return [r for r in map(json.loads, path.read_text().splitlines()) if r["kind"] == kind]


def test_a_stream_learns_the_joints_and_goes_on_where_it_stopped(folder):
    out, _ = folder
    log = make_arm_log(duration=12.0, random_state=5)
    in_units = log.rename(columns={"pitch_position_rad": "pitch_position_deg", "yaw_torque_nm": "yaw_torque_mnm"})
    in_units["pitch_position_deg"] = np.rad2deg(in_units["pitch_position_deg"])
    in_units["yaw_torque_mnm"] *= 1e3
    options = ["--robot", out / "model" / "model.json", "--time", "time_s", "--every", "1000", "--no-track"]
    for name, table in (("whole", log), ("half", in_units[:3000])):
        table.to_csv(out / f"{name}.csv", index=False)
        done = run(stream, out / f"{name}.csv", *options, "--out", out / f"{name}.jsonl")
        assert done.exit_code == 0, done.output
    in_units.to_csv(out / "half.csv", index=False)
    done = run(stream, out / "half.csv", *options, "--out", out / "half.jsonl")
    assert done.exit_code == 0, done.output
    assert "Resuming after row 3000" in done.output
    whole, halves = (records(out / f"{name}.jsonl", "estimate") for name in ("whole", "half"))
    assert len(whole) == len(halves) == 6
    for name, value in whole[-1]["parameters"].items():
        assert halves[-1]["parameters"][name] == pytest.approx(value, rel=1e-4, abs=1e-5)
    found, errors = whole[-1]["parameters"], whole[-1]["standard_errors"]
    for name, truth in (("pitch.coulomb", 0.2), ("yaw.coulomb", 0.3), ("pitch.viscous", 0.1)):
        assert abs(found[name] - truth) < min(4.0 * errors[name] + 0.005, 0.2 * truth)
    assert set(whole[-1]["innovation_rmse"]) == {"yaw", "pitch"}
    assert not records(out / "whole.jsonl", "alarm")


def test_wrapped_positions_and_wrong_readings_of_a_joint_change_no_estimate_of_a_stream(folder, tmp_path):
    out, _ = folder
    sound = make_arm_log(duration=6.0, random_state=5).rename(columns={"yaw_position_rad": "yaw_position_deg"})
    sound["yaw_position_deg"] = np.rad2deg(sound["yaw_position_deg"]) + 180.0
    drive = sound["yaw_torque_nm"].to_numpy()
    sound.loc[2000, "yaw_torque_nm"] = 0.5 * (drive[1999] + drive[2001])  # its noise cannot come back
    spoilt = sound.copy()
    spoilt["yaw_position_deg"] = (sound["yaw_position_deg"] + 180.0) % 360.0 - 180.0
    spoilt.loc[1500, "pitch_position_rad"] = spoilt.loc[2000, "yaw_torque_nm"] = 1e9
    last = {}
    for name, table in (("sound", sound), ("spoilt", spoilt)):
        table.to_csv(tmp_path / f"{name}.csv", index=False)
        options = ["--robot", out / "model" / "model.json", "--time", "time_s", "--no-track"]
        done = run(stream, tmp_path / f"{name}.csv", *options, "--out", tmp_path / f"{name}.jsonl")
        assert done.exit_code == 0, done.output
        last[name] = records(tmp_path / f"{name}.jsonl", "estimate")[-1]
    told = {(r["cause"], r["line"], r["reason"].partition(":")[0]) for r in records(tmp_path / "spoilt.jsonl", "alarm")}
    assert {("jump", 1502, "pitch"), ("jump", 2002, "yaw")} < told
    assert {(cause, joint) for cause, _, joint in told} == {("wrap", "yaw"), ("jump", "pitch"), ("jump", "yaw")}
    assert f"{len(told)} alarms" in " ".join(done.output.split())
    assert not records(tmp_path / "sound.jsonl", "alarm")
    for joint, value in last["sound"]["parameters"].items():
        error = last["sound"]["standard_errors"][joint]
        assert last["spoilt"]["parameters"][joint] == pytest.approx(value, abs=0.01 * error), joint


def test_a_frozen_encoder_of_a_joint_is_an_alarm_of_a_stream_and_changes_no_estimate(folder, tmp_path):
    out, _ = folder
    log = make_arm_log(duration=4.0, random_state=5)
    q = log["pitch_position_rad"].to_numpy().copy()
    first = 1000 + int(np.abs(np.diff(q))[1000:1300].argmax())
    q[first : first + 60] = q[first]
    q[1800:] = q[1800]
    log.assign(pitch_position_rad=q).to_csv(tmp_path / "frozen.csv", index=False)
    options = ["--robot", out / "model" / "model.json", "--time", "time_s", "--every", "500", "--no-track"]
    done = run(stream, tmp_path / "frozen.csv", *options, "--out", tmp_path / "frozen.jsonl")
    assert done.exit_code == 0, done.output
    [told] = records(tmp_path / "frozen.jsonl", "alarm")
    assert (told["cause"], told["reason"].partition(" for ")[0]) == ("held_rows", "pitch: the position repeats")
    assert "199 rows that repeat the position of pitch are still waiting" in " ".join(done.output.split())
    last = records(tmp_path / "frozen.jsonl", "estimate")[-1]
    assert last["row"] > first + 60
    for name, truth in (("pitch.coulomb", 0.2), ("yaw.coulomb", 0.3), ("pitch.viscous", 0.1)):
        assert abs(last["parameters"][name] - truth) < 4.0 * last["standard_errors"][name] + 0.005


def test_a_joint_whose_drive_counts_in_the_opposite_direction_is_an_alarm_of_a_stream(folder, tmp_path):
    out, _ = folder
    log = make_arm_log(duration=8.0, random_state=5)
    log["pitch_torque_nm"] *= -1.0
    log.to_csv(tmp_path / "inverted.csv", index=False)
    options = ["--robot", out / "model" / "model.json", "--time", "time_s", "--no-track"]
    done = run(stream, tmp_path / "inverted.csv", *options, "--out", tmp_path / "inverted.jsonl")
    assert done.exit_code == 0, done.output
    [told] = [r for r in records(tmp_path / "inverted.jsonl", "alarm") if r["cause"] == "negative_friction"]
    assert "friction drives pitch where it should brake (pitch.viscous is -" in told["reason"]


@pytest.mark.parametrize(
    ("log", "more", "said"),
    [
        ("arm.csv", ["--orders", "1,1,1,1"], "to which orders does not apply"),
        ("arm.csv", ["--joints", "yaw:a,b"], "does not name 'pitch'"),
        ("-", [], "give them with --joints"),
        ("sheet.xlsx", [], "is not text in UTF-8, which a stream reads as it is written; export the log as CSV"),
    ],
)
def test_what_a_stream_of_an_arm_cannot_take_is_told(folder, log, more, said):
    out, _ = folder
    (out / "sheet.xlsx").write_bytes(b"PK\x03\x04\x14\x00\x00\nxl")
    log = log if log == "-" else out / log
    done = run(stream, log, "--robot", out / "model" / "model.json", "--no-track", *more)
    assert done.exit_code != 0
    assert said in " ".join(done.output.split())
    assert "Traceback" not in done.output


def test_a_model_keeps_the_gains_that_it_was_identified_with(folder, tmp_path):
    """What comes after `identify --gains` takes the same currents without asking again, and torques as they are."""
    out, _ = folder
    log = pd.read_csv(out / "arm.csv")
    currents = log.rename(columns=lambda c: c.replace("torque_nm", "current_ma"))
    for joint, gain in (("yaw", 11.0), ("pitch", 8.0)):
        currents[f"{joint}_current_ma"] *= 1e3 / gain
    currents.to_csv(tmp_path / "currents.csv", index=False)
    gains = ["--gains", "yaw:11+-0.2;pitch:8", "--no-track"]
    done = run(identify, tmp_path / "currents.csv", "--robot", out / "arm.xml", "--out", tmp_path / "m", *gains)
    assert done.exit_code == 0, done.output
    model = tmp_path / "m" / "model.json"
    simulated = []
    for table in (tmp_path / "currents.csv", out / "arm.csv"):
        done = run(simulate, model, table, "--out", tmp_path / "simulated.csv")
        assert done.exit_code == 0, done.output
        assert ("yaw:11+-0.2; pitch:8" in done.output) == (table.parent == tmp_path)
        simulated.append(pd.read_csv(tmp_path / "simulated.csv"))
    np.testing.assert_allclose(simulated[0], simulated[1], atol=1e-6)
    options = {"robot": str(model), "source": str(tmp_path / "currents.csv"), "time_column": "time_s"}
    found = arm_stream({**options, "joints": None, "gains": None, "forgetting": 1.0, "alarm_interval": 1e6})
    assert found.rows["factors"] == pytest.approx([1.0, 1.0, 1.0, 0.011, 0.008])
    (tmp_path / "repaired.json").write_text((out / "model" / "model.json").read_text())
    keep_gains(tmp_path, gap_log(OF_GAP | {"log_file": str(tmp_path / "currents.csv"), "robot": str(model)}))
    assert load_model(tmp_path / "repaired.json").gains == load_model(model).gains


def test_currents_without_gains_ask_for_them(folder, tmp_path):
    """A column called a current is one, in A, whether or not its name has a unit."""
    out, _ = folder
    log = pd.read_csv(out / "arm.csv").rename(columns=lambda c: c.replace("torque_nm", "current"))
    log.to_csv(tmp_path / "currents.csv", index=False)
    done = run(identify, tmp_path / "currents.csv", "--robot", out / "arm.xml", "--out", tmp_path / "m", "--no-track")
    assert done.exit_code == 2
    assert 'is a current in A; give the Nm per A of every joint, --gains "yaw:' in " ".join(done.output.split())
    assert not (tmp_path / "m").exists()


def test_numbers_of_what_may_be_currents_have_no_unit(folder, tmp_path):
    """A column called `i` may be in amperes or not, so nothing is refused, and nothing is in Nm."""
    out, _ = folder
    log = pd.read_csv(out / "arm.csv").rename(columns=lambda c: c.replace("torque_nm", "i"))
    log.to_csv(tmp_path / "currents.csv", index=False)
    done = run(identify, tmp_path / "currents.csv", "--robot", out / "arm.xml", "--out", tmp_path / "m", "--no-track")
    assert "share fit none of them" in " ".join(done.output.split())
    numbers = json.loads((tmp_path / "m" / "identify.json").read_text())["parameters"]
    assert all(p["unit"] == "" and p["nominal"] is None for p in numbers)


def test_the_columns_of_a_stream_are_found_behind_semicolons_and_decimal_commas(tmp_path):
    save_model(ArmModel(Arm.from_dh([(0, 0, 0, 0)], inertial=[[0.0] * 9 + [0.05]]), {}, dt=0.01), tmp_path / "m.json")
    rows = "\n".join(f"{2 * k};0,{k % 10};1,5" for k in range(20))
    (tmp_path / "a.csv").write_text(f"Zeit [ms];joint1 Lage [deg];joint1 Drehmoment [Nm]\n{rows}\n")
    options = {"robot": str(tmp_path / "m.json"), "source": str(tmp_path / "a.csv"), "time_column": "Zeit [ms]"}
    found = arm_stream({**options, "joints": None, "gains": None, "forgetting": 1.0,
                        "alarm_interval": 1e6})  # fmt: skip
    assert found.columns == ["Zeit [ms]", "joint1 Lage [deg]", "joint1 Drehmoment [Nm]"]
    assert found.rows["max_step"] == pytest.approx(5.0)  # ms, two and a half samples
