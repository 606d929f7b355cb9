"""Whatever holds a model becomes an axis or a chain with its units."""

from __future__ import annotations

import numpy as np
import pytest

from whsklearn import ServoAxis, WienerHammersteinSystem
from whsklearn.effects import QuadraticDrag
from whsklearn.export.model import Exported, as_exported
from whsklearn.models import LinearModel, save_model


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
    assert [e.name for e in out.chain_effects] == ["quadratic_drag"]


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
