"""From a diagnosis to the next reference: files, units of the log, clear errors."""

from __future__ import annotations

import json
import shutil

import pandas as pd
import pytest
from click.testing import CliRunner

from whsklearn.cli.design import main
from whsklearn.datasets import make_servo_log
from whsklearn.effects import GravityImbalance
from whsklearn.gap import GapFinder

LIMITS = "position=2,speed=5,drive=2,seconds=8"


@pytest.fixture(scope="module")
def diagnosis(tmp_path_factory):
    folder = tmp_path_factory.mktemp("gap")
    log = make_servo_log([GravityImbalance(0.15)], duration=10.0, sample_rate=250.0, random_state=1)
    GapFinder("servo", max_effects=1).fit(log).report(folder)
    return folder / "gap.json"


def run(*arguments):
    return CliRunner().invoke(main, [str(a) for a in arguments])


@pytest.mark.slow
def test_reference_and_answer(diagnosis, tmp_path):
    result = run(diagnosis, "--limits", LIMITS, "--rivals", "gravity_imbalance", "--out", tmp_path)
    assert result.exit_code == 0, result.output
    answer = json.loads((tmp_path / "design.json").read_text(encoding="utf-8"))
    assert answer["would_be_named"] == {"gravity_imbalance": True}
    assert set(answer) >= {"would_be_named", "limits", "advice"}
    table = pd.read_csv(tmp_path / "reference.csv")
    assert len(table) == 2000
    assert table.iloc[:, 1].abs().max() <= 2.0
    page = (tmp_path / "design.html").read_text(encoding="utf-8")
    assert answer["advice"] in page
    assert page.count("<polyline") == 3


@pytest.mark.parametrize(
    "limits", ["position=1", *(f"position={p},speed=1,drive=1,seconds={s}" for p, s in ((1, "x"), (0, 1), ("nan", 1)))]
)
def test_limits_that_are_none(diagnosis, tmp_path, limits):
    assert run(diagnosis, "--limits", limits, "--out", tmp_path).exit_code == 2


def test_what_is_no_diagnosis_or_no_effect(diagnosis, tmp_path):
    other = tmp_path / "other.json"
    other.write_text("{}", encoding="utf-8")
    assert "is not a gap.json" in run(other, "--limits", LIMITS, "--out", tmp_path).output
    assert "is not an effect" in run(diagnosis, "--limits", LIMITS, "--rivals", "magic", "--out", tmp_path).output


def test_an_effect_of_ones_own_comes_from_its_file(diagnosis, tmp_path):
    data = json.loads(diagnosis.read_text(encoding="utf-8"))
    data["candidates"].insert(0, {"name": "unheard_of", "status": "rejected"})
    (tmp_path / "gap.json").write_text(json.dumps(data), encoding="utf-8")
    shutil.copy(diagnosis.with_name("repaired.json"), tmp_path)
    without = run(tmp_path / "gap.json", "--limits", LIMITS, "--out", tmp_path)
    assert "unheard_of is not an effect" in without.output
    assert "--effects" in without.output
    (tmp_path / "my_effects.py").write_text("x = 1\n", encoding="utf-8")
    empty = run(diagnosis, "--limits", LIMITS, "--effects", tmp_path / "my_effects.py", "--out", tmp_path)
    assert "my_effects.py defines no effect" in empty.output
