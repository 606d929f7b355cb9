"""Whatever holds a model becomes an axis or a chain with its units."""

from __future__ import annotations

import json

import numpy as np
import pytest
from click.testing import CliRunner

from whsklearn import ServoAxis, WienerHammersteinSystem
from whsklearn.cli.export import main
from whsklearn.compare.records import spread
from whsklearn.effects import Cogging, InputOffset, QuadraticDrag, TorqueRipple
from whsklearn.export.model import Exported, as_exported, left_out, lost_parts, parts_of, ranges_of, size_of
from whsklearn.gap.report import as_model
from whsklearn.models import LinearModel, save_model
from whsklearn.systems import Drive, Sensor, Transmission


def test_sizes_carry_their_units():
    assert size_of(Cogging(0.05, 12.0)) == "amplitude 0.05 Nm, order 12, phase 0 rad"


def test_what_does_nothing_is_no_loss():
    axis = ServoAxis(effects=[InputOffset(0.0), TorqueRipple(0.02, 6.0)])
    assert [e.name for e in parts_of(axis)] == ["viscous", "coulomb", "torque_ripple"]


def test_only_what_is_not_held_is_lost():
    axis = ServoAxis(effects=[Cogging(0.05, 12.0), TorqueRipple(0.02, 6.0)])
    lost = left_out(axis, lambda e: e.name != "torque_ripple", "no such thing")
    assert [str(x) for x in lost] == ["torque_ripple (amplitude 0.02, order 6, phase 0 rad): no such thing"]


def test_parts_are_lost_where_the_format_lacks_them():
    axis = ServoAxis(
        drive=Drive(delay=0.002, limit=5.0), transmission=Transmission(stiffness=100.0), sensor=Sensor(noise=1e-4)
    )
    names = {x.name for x in lost_parts(axis)}
    assert names == {"drive delay", "drive limit", "transmission", "sensor noise"}
    assert {x.name for x in lost_parts(axis, moving=True, limit=True)} == {"sensor noise"}


def test_an_axis_stays_one_and_a_chain_is_not_taken_for_it():
    axis = ServoAxis()
    assert as_exported(axis).need_axis("URDF") is axis
    chain = as_exported(WienerHammersteinSystem.example())
    with pytest.raises(ValueError, match="URDF describes a mechanical axis"):
        chain.need_axis("URDF")


def test_the_blocks_of_a_chain_answer_a_sample_late_and_lose_no_effect():
    system = WienerHammersteinSystem([1.0, 2.2], [1.0, 0.5], [1.0, 0.2], [0.15, 0.4], effects=[QuadraticDrag(0.1)])
    out = as_exported(system)
    np.testing.assert_array_equal(out.chain.b1, [0.0, 1.0, 2.2])
    np.testing.assert_array_equal(out.chain.f2, [1.0, 0.15, 0.4])
    assert [e.name for e in out.chain.effects] == ["quadratic_drag"]


def test_a_file_is_what_was_saved_and_a_position_is_integrated(tmp_path):
    model = LinearModel([0.0, 0.5], [1.0, -0.5], offset=0.2, logged="position", units={"input": "A", "output": "mm"})
    save_model(model, tmp_path / "model.json")
    out = as_exported(str(tmp_path / "model.json"))
    assert (out.chain.offset, out.chain.integrates, out.logged) == (0.2, True, "position")
    assert out.linear
    assert as_exported(out) is out


@pytest.mark.parametrize(("unit", "linear"), [("rad", False), ("m", True), ("mm/s", True), ("", False)])
def test_a_line_is_told_by_the_unit_of_its_position(unit, linear):
    assert Exported(units={"output": unit} if unit else {}).linear is linear


@pytest.mark.parametrize(("unit", "linear"), [("cm", True), ("inch", True), ("mm/s", True), ("rpm", False)])
def test_an_axis_is_linear_in_whatever_length_it_was_logged(unit, linear):
    assert Exported(units={"input": "N", "output": unit}).linear is linear


def test_a_unit_that_the_format_lacks_is_told_of_the_signal_that_has_it():
    (loss,) = Exported(units={"input": "Nm", "output": "counts"}).foreign()
    assert "right for a position in counts alone" in loss.reason


def test_a_current_of_a_linear_axis_is_scaled_to_a_force():
    (loss,) = Exported(units={"input": "A", "output": "mm"}).foreign()
    assert loss.reason.startswith("the format is in N:")
    assert loss.reason.endswith("by the force constant")


def row(name, values, error=0.001, si=1.0):
    mean, apart, p = spread(np.array(values), np.full(len(values), error**2))
    return {"name": name, "unit": "", "values": list(values), "mean": mean, "spread_between": apart,
            "spread_within": error, "p_value_spread": p, "to_si": si}  # fmt: skip


def test_nearly_all_units_of_a_draw_lie_inside():
    rng = np.random.default_rng(0)
    inside = []
    for _ in range(100):
        found = ranges_of({"numbers": [row("coulomb", rng.normal(0.3, 0.03, 12))]})["frictionloss"]
        inside += list((rng.normal(0.3, 0.03, 20) > found["low"]) & (rng.normal(0.3, 0.03, 20) < found["high"]))
    assert 0.88 < np.mean(inside) < 0.99


def test_units_become_si_and_nothing_is_negative():
    found = ranges_of({"numbers": [row("viscous", [10.0, 200.0, 20.0], si=1e-3), row("cogging", [1.0, 1.1, 0.9])]})
    assert set(found) == {"damping"}
    assert found["damping"]["low"] == 0.0
    assert found["damping"]["high"] < 0.5


def test_no_numbers_are_refused():
    with pytest.raises(ValueError, match=r"compare\.json"):
        ranges_of({"verdict": "cannot_tell"})


def test_the_command_writes_them_beside_the_model(tmp_path):
    save_model(as_model(ServoAxis(inertia=0.05, law="coulomb")), tmp_path / "model.json")
    (tmp_path / "compare.json").write_text(json.dumps({"numbers": [row("inertia", [0.05, 0.06])]}), encoding="utf-8")
    model, spread_file = str(tmp_path / "model.json"), str(tmp_path / "compare.json")
    arguments = [model, "--out", str(tmp_path / "axis.xml"), "--spread", spread_file]
    result = CliRunner().invoke(main, [*arguments, "--to", "mjcf"])
    assert result.exit_code == 0, result.output
    assert "inertia" in json.loads((tmp_path / "axis.ranges.json").read_text(encoding="utf-8"))
    assert CliRunner().invoke(main, [*arguments, "--to", "urdf"]).exit_code == 2


@pytest.mark.parametrize("content", ["time_s,torque_nm\n0,1\n", "[1, 2]", '{"verdict": "cannot_tell"}'])
def test_what_is_no_comparison_is_told_before_anything_is_written(tmp_path, content):
    save_model(as_model(ServoAxis(inertia=0.05, law="coulomb")), tmp_path / "model.json")
    (tmp_path / "spread.json").write_text(content, encoding="utf-8")
    spread_file, out = str(tmp_path / "spread.json"), tmp_path / "axis.xml"
    arguments = [str(tmp_path / "model.json"), "--to", "mjcf", "--out", str(out), "--spread", spread_file]
    result = CliRunner().invoke(main, arguments)
    assert result.exit_code == 1
    assert "compare.json" in result.output
    assert not out.exists()
