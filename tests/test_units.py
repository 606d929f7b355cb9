"""Units travel with a model: the consumers of `benchmarks.units`, without the search and with it once."""

from __future__ import annotations

import pytest

from benchmarks import units
from whsklearn import ServoAxis
from whsklearn.datasets import make_servo_log
from whsklearn.effects import Cogging
from whsklearn.gap import GapFinder, ServoRecord
from whsklearn.gap.report import as_model
from whsklearn.logs import load_log
from whsklearn.logs.units import factor_of
from whsklearn.models import save_model


@pytest.fixture(scope="module")
def logs(tmp_path_factory):
    return units.logs(tmp_path_factory.mktemp("logs"))


@pytest.mark.parametrize(
    ("here", "there"),
    [
        (("rad", "Nm", "s"), ("deg", "mNm", "ms")),
        (("deg", "mNm", "ms"), ("rad", "Nm", "s")),
        (("deg", "A", "s"), ("rad", "mNm", "s")),
    ],
)
def test_a_model_is_the_same_axis_to_whoever_reads_its_file(here, there, logs, tmp_path):
    by = units.CONSTANT if here[1] == "A" else 1.0
    t = {k: v / by for k, v in units.TRUTH.items()}
    axis = ServoAxis(t["inertia"], effects=[Cogging(t["cogging"], 12.0)])
    axis = axis.with_parameters(viscous=t["viscous"], coulomb=t["coulomb"]) if by != 1.0 else axis
    save_model(as_model(axis, (here[1], here[0])), tmp_path / "repaired.json")
    log = load_log(logs[0][here], **units.columns_of(here))
    checks = [
        *units.loaded(tmp_path / "repaired.json", log, here),
        *units.simulated(tmp_path, logs[1][there], here, there),
        *units.exported(tmp_path / "repaired.json", tmp_path, log, here),
    ]
    assert [c for c in checks if not c[1]] == []
    assert len(checks) >= 10


@pytest.mark.slow
def test_every_consumer_is_right_in_degrees_and_milliseconds(logs):
    here, there = ("deg", "mNm", "ms"), ("rad", "Nm", "s")
    assert [c for c in units.check(logs[0][here], logs[1][there], here, there) if not c[1]] == []


@pytest.mark.parametrize("effect", [Cogging(units.TRUTH["cogging"], 12.0), None])
def test_a_diagnosis_is_the_same_in_every_unit(effect):
    """Verdict, names and shares do not depend on units; nor on the scale of a drive in A, whose constant is unknown."""
    frame = make_servo_log([effect] if effect else [], duration=8.0, sample_rate=250.0, amplitude=1.0, random_state=0)
    found = []
    for angle, drive, by in (("rad", "Nm", 1.0), ("deg", "mA", 1.0 / units.CONSTANT)):
        turn, torque = factor_of(angle)[0], factor_of(drive)[0]
        signals = frame["torque_nm"] * by / torque, frame["position_rad"] / turn
        record = ServoRecord(frame["time_s"].to_numpy(), *(s.to_numpy() for s in signals), units=(drive, angle))
        found.append(GapFinder("servo").fit(record).diagnosis_)
    first, d = found
    assert d.verdict == first.verdict
    assert [e.name for e in d.effects] == [e.name for e in first.effects]
    assert d.closure == pytest.approx(first.closure, abs=1e-3)
    told = {c.name: (c.status, c.p_value) for c in first.candidates}
    assert {c.name for c in d.candidates} == set(told)
    for c in d.candidates:
        assert (c.status, c.p_value) == (told[c.name][0], pytest.approx(told[c.name][1], rel=0.01, abs=1e-6))
