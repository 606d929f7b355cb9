"""Currents become torques by a constant that is given, and only then."""

from __future__ import annotations

import numpy as np
import pytest

from tests.logs.rig import TABLE, text
from whsklearn.logs import ColumnError, load_log
from whsklearn.logs.current import torque_constant_of

HEAD = ["time_s", "iq_a", "position_rad"]


def test_a_constant_turns_amperes_into_newton_metres_and_hands_its_deviation_on(tmp_path):
    (tmp_path / "axis.csv").write_text(text(head=HEAD))
    plain = load_log(tmp_path / "axis.csv", time=0, drive=1, position=2)
    assert plain.units["drive"] == "A"
    assert plain.drive_error == 0.0
    assert any("is a current: sizes are in its unit" in n for n in plain.notes)
    log = load_log(tmp_path / "axis.csv", time=0, drive=1, position=2, torque_constant="0.12+-0.01")
    assert log.units["drive"] == "Nm"
    assert np.allclose(log.X[:, 0], 0.12 * TABLE["torque_nm"][:300], atol=1e-9)
    assert log.drive_error == pytest.approx(0.01 / 0.12)


def test_raw_numbers_are_multiples_of_an_ampere(tmp_path):
    (tmp_path / "axis.csv").write_text(text(head=["time_s", "Actual Current (0.01 A)", "position_rad"]))
    log = load_log(tmp_path / "axis.csv", time=0, drive=1, position=2, torque_constant=0.12)
    np.testing.assert_allclose(log.X[:, 0], 0.0012 * TABLE["torque_nm"][:300], atol=1e-9)
    (tmp_path / "axis.csv").write_text(text(head=["time_s", "present_current", "position_rad"]))
    log = load_log(tmp_path / "axis.csv", time=0, drive=1, position=2, torque_constant=0.12)
    assert any("its numbers taken as A; --unit drive=UNIT states another unit" in n for n in log.notes)
    options = {"torque_constant": 0.12, "units": {"drive": "2.69 mA"}}
    log = load_log(tmp_path / "axis.csv", time=0, drive=1, position=2, **options)
    np.testing.assert_allclose(log.X[:, 0], 0.12 * 2.69e-3 * TABLE["torque_nm"][:300], atol=1e-9)


def test_a_constant_for_a_torque_is_refused(tmp_path):
    (tmp_path / "axis.csv").write_text(text())
    with pytest.raises(ColumnError, match="the drive, column 'torque_nm', is in Nm"):
        load_log(tmp_path / "axis.csv", time=0, drive=1, position=2, torque_constant=0.12)


@pytest.mark.parametrize("given", ["0.12±", "-0.1", "0", "0.1+-0.1+-0.1", "Nm", (0.1, -1.0), None, float("nan")])
def test_what_is_no_constant_is_refused(given):
    with pytest.raises(ValueError, match=r"expected Nm per ampere"):
        torque_constant_of(given)


@pytest.mark.parametrize("given", ["0.12+-0.01", "0.12 +/- 0.01", "0.12±0.01", (0.12, 0.01)])
def test_spellings_of_a_constant(given):
    assert torque_constant_of(given) == (0.12, 0.01)
