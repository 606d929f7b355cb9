"""The files of a report: whole, of one diagnosis, and none left of another."""

from __future__ import annotations

import dataclasses
import html
import json
import sys

import numpy as np
import pytest
from jinja2 import UndefinedError

from tests.gap.plants.test_servo_model import friction, started
from tests.gap.plants.test_servo_model import model as axis_model
from whsklearn import ServoAxis, WienerHammersteinSystem
from whsklearn.datasets import default_arm, make_arm_log, make_servo_log
from whsklearn.effects import Cogging, FlexibleCoupling, InputDelay, InputOffset, as_law
from whsklearn.gap import Diagnosis, GapFinder, NamedEffect
from whsklearn.gap.diagnosis import VERDICTS
from whsklearn.gap.plants.arm import ArmRecord, arm_plant
from whsklearn.gap.plants.arm_terms import JointTerm, Load, candidates
from whsklearn.gap.plants.servo import ServoPlant
from whsklearn.gap.plants.servo_candidates import catalogue
from whsklearn.gap.report import COLOURS, SILENCE, as_model, render, significant, write_report
from whsklearn.models import AxisModel, load_model, save_model
from whsklearn.systems.servo_parts import Drive

FOUND = Diagnosis("named", "Cogging is missing.", effects=[NamedEffect(Cogging(0.1, 12.0), {}, 99.0, 0.9)])
FOUND.pictures = {}


class Xml:
    """A repaired model that is no model of ours."""

    def to_xml(self):
        return "<mujoco/>"


def test_the_page_the_numbers_and_the_repaired_model_stand_side_by_side(tmp_path):
    page = write_report(FOUND, tmp_path / "new" / "report", ServoAxis(effects=[Cogging(0.1, 12.0)]))
    folder = page.parent
    assert sorted(p.name for p in folder.iterdir()) == ["gap.html", "gap.json", "repaired.json", "run.json"]
    assert "Cogging is missing." in page.read_text(encoding="utf-8")
    assert json.loads((folder / "gap.json").read_text())["effects"][0]["name"] == "cogging"
    assert [e.name for e in load_model(folder / "repaired.json").effects] == ["cogging"]


def test_a_horizon_has_the_digits_of_a_reader_not_of_the_clock():
    row = {"horizon": 0.10000000000002035, "before": 0.2, "after": 0.1, "floor": 0.0, "closure": 0.5}
    page = render(dataclasses.replace(FOUND, horizons=[row]))
    assert '<td class="n">0.1</td>' in page
    assert "0.1000000" not in page


def test_a_repair_that_is_no_better_than_no_model_has_closed_nothing_and_says_so():
    row = {"horizon": 1.4, "before": 579.0, "after": 23.5, "floor": 23.5, "closure": 0.0}
    assert "0 %, no better than no model<" in render(dataclasses.replace(FOUND, horizons=[row]))
    assert "no better than no model" not in render(dataclasses.replace(FOUND, horizons=[row | {"closure": 0.9}]))


def test_a_page_that_names_nothing_does_not_explain_a_name():
    assert "is not proof of a mechanism" in render(FOUND)
    assert "is not proof" not in render(Diagnosis("no_gap", "Nothing is missing."))


def test_the_age_of_the_drive_is_explained_where_there_is_one():
    row = {"name": "age of the drive (samples)", "before": 0.1, "after": 0.1, "unit": ""}
    for rows, told in (([row], 2), ([], 0)):
        page = render(Diagnosis("no_gap", "Nothing is missing.", base_parameters=rows))
        assert page.count("age of the drive") == told


def test_nothing_of_an_earlier_model_stays(tmp_path):
    write_report(FOUND, tmp_path, ServoAxis())
    write_report(FOUND, tmp_path, Xml())
    assert not (tmp_path / "repaired.json").exists()
    assert (tmp_path / "repaired.xml").read_text() == "<mujoco/>"
    write_report(FOUND, tmp_path)
    assert not (tmp_path / "repaired.xml").exists()


def test_what_cannot_be_drawn_leaves_the_earlier_report_whole(tmp_path):
    write_report(FOUND, tmp_path, ServoAxis())
    before = {p.name: p.read_bytes() for p in tmp_path.iterdir()}
    broken = Diagnosis("named", "x")
    broken.effects = [object()]
    with pytest.raises(UndefinedError):
        write_report(broken, tmp_path, ServoAxis())
    assert {p.name: p.read_bytes() for p in tmp_path.iterdir()} == before


def test_without_matplotlib_all_is_written_but_the_pictures(tmp_path, monkeypatch):
    drawn = GapFinder("servo").fit(make_servo_log([], duration=6.0, random_state=0))
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.warns(UserWarning, match=r"no pictures.*pip install 'whsklearn\[plot\]'"):
        page = drawn.report(tmp_path)
    assert {"gap.html", "gap.json", "run.json", "repaired.json"} == {p.name for p in tmp_path.iterdir()}
    assert "whsklearn[plot]" in html.unescape(page.read_text(encoding="utf-8"))
    assert "data:image" not in page.read_text(encoding="utf-8")


@pytest.mark.parametrize("verdict", VERDICTS)
def test_every_verdict_has_a_page_in_its_colour_and_silence_its_reason(verdict):
    page = render(Diagnosis(verdict, "One sentence."))
    assert "One sentence." in page
    assert COLOURS.get(verdict, "#5a6773") in page
    assert SILENCE.get(verdict, "One")[:30] in page
    assert 'src="http' not in page  # no file from outside


def test_a_name_that_is_markup_is_text():
    page = render(Diagnosis("no_gap", "<script>alert(1)</script>", file="<b>log</b>", origin="<b>log</b>"))
    assert "<script>alert" not in page
    assert "<b>log</b>" not in page


@pytest.mark.parametrize(
    ("value", "text"), [(0.123456, "0.1235"), (12345.6, "1.235e+04"), ("N/A", "N/A"), (None, "None")]
)
def test_numbers_have_four_digits(value, text):
    assert significant(value) == text


def test_the_first_card_says_how_many_rows_were_used():
    rows = {"used": 6000, "given": 11900, "taken": 1, "segments": 2}
    page = render(Diagnosis("no_gap", "Nothing is missing.", rows=rows))
    cards = page[page.index('class="tile"') :]
    assert cards.index("rows used") < cards.index("before")
    assert "<b>50 %</b>6000 of 11900, in 1 of 2 segments" in cards
    assert "rows used" not in render(Diagnosis("no_gap", "Nothing is missing."))


DRIVE = np.sin(np.arange(400) / 20.0)


def test_an_axis_comes_back_with_its_units(tmp_path):
    axis = ServoAxis(effects=[Cogging(0.1, 12.0)], drive=Drive(delay=0.003), sample_rate=500.0)
    save_model(as_model(axis, ("A", "rad")), tmp_path / "repaired.json")
    model = load_model(tmp_path / "repaired.json")
    assert model.units == {"input": "A", "output": "rad"}
    own = axis.simulate_drive(DRIVE, noise=False).position
    np.testing.assert_allclose(model.simulate(DRIVE), own, atol=1e-3 * np.std(own))  # four fine steps in place of 20


def test_a_drive_as_young_as_its_fit_allows_has_no_delay_in_the_file():
    def delays(age):
        axis = ServoAxis(effects=[InputDelay(0.011)], drive=Drive(delay=age), sample_rate=500.0)
        return [e.delay for e in as_model(axis).effects]

    assert delays(2e-12) == [0.011]
    assert delays(2e-6) == [0.011, 2e-6]


KINDS = [c for c in catalogue() if c.cls.__module__.startswith("whsklearn")]  # other tests define more


@pytest.mark.parametrize("kind", KINDS, ids=lambda c: c.label)
def test_any_candidate_of_an_axis_is_the_same_free_run_from_its_file(kind, tmp_path):
    found = dataclasses.replace(axis_model(*friction(0.1, 0.05), started(kind), timing=0.4), n_base=2)
    axis = ServoPlant.system(None, found)
    assert [e.name for e in axis.effects] == [kind.name]
    save_model(as_model(axis), tmp_path / "repaired.json")
    own = axis.simulate_drive(DRIVE, noise=False).position
    assert np.ptp(own) > 1e-3
    np.testing.assert_allclose(load_model(tmp_path / "repaired.json").simulate(DRIVE), own, rtol=0, atol=1e-9)


@pytest.fixture(scope="module")
def arm():
    """An arm's plant with its base model, on a record that is just long enough."""
    q, u = make_arm_log(default_arm(), duration=6.0, return_arrays=True)
    plant = arm_plant(default_arm(), ArmRecord(np.arange(len(q)) / 500.0, q, u), law=None, tolerance=0.004)
    assert not any(p.fatal for p in plant.check())
    return plant, plant.base(np.random.default_rng(0))


JOINT = [
    k for k in candidates(default_arm(), {}, frozen=True, weight=0)
    if k.joint == "pitch" and k.cls.__module__.startswith("whsklearn")
]  # fmt: skip


@pytest.mark.parametrize("kind", JOINT, ids=lambda k: k.catalogued.label if k.catalogued else k.name)
def test_any_candidate_of_an_arm_is_the_same_free_run_from_its_file(kind, arm, tmp_path):
    plant, base = arm
    if kind.catalogued is not None:
        scene = plant.view.scene(kind)
        size = 0.1 * kind.catalogued.size_unit(scene)
        numbers = (*(size,) * kind.linear, *kind.catalogued.starts(scene)[0])
    else:
        numbers = (0.05, 0.1, 0.0, 0.0) if kind.cls is Load else (0.01,)
    term = JointTerm(kind, numbers)
    model, without = plant.system(base.with_term(term)), plant.system(base)
    drive, position = plant.record.drive[:400], plant.record.position[:400]

    def run(arm):
        return arm.simulate_drive(drive, sample_rate=500.0, position=position).position

    wanted = run(model.arm)
    is_there = term.effect in model.arm.effects[1] if kind.catalogued else np.ptp(wanted - run(without.arm)) > 1e-6
    assert is_there, "what is named is in the repaired model"
    save_model(as_model(model), tmp_path / "repaired.json")
    np.testing.assert_allclose(run(load_model(tmp_path / "repaired.json").arm), wanted, rtol=0, atol=1e-9)


def test_a_slow_log_of_a_coupling_is_simulated_in_steps_that_it_needs():
    slow = AxisModel(0.05, as_law("viscous"), (FlexibleCoupling(2e-3),), dt=0.01, logged="position")
    finer = slow.system(substeps=16 * slow.system().substeps)
    drive = np.repeat(np.random.default_rng(0).normal(size=40), 10)
    run, fine = (axis.simulate_drive(drive, noise=False).position for axis in (slow.system(), finer))
    np.testing.assert_allclose(run, fine, rtol=0, atol=1e-4 * np.std(fine))


@pytest.mark.parametrize("direct", [0, 1, 2])
@pytest.mark.parametrize("effects", [(), (InputOffset(0.2),)])
def test_a_chain_comes_back_with_its_effects_and_direct_paths(effects, direct, tmp_path):
    system = WienerHammersteinSystem([1.0, 0.5], [-0.5], [1.0], [-0.2], effects=effects, dt=0.01, direct=direct)
    save_model(as_model(system, ("V", "")), tmp_path / "repaired.json")
    model = load_model(tmp_path / "repaired.json")
    np.testing.assert_allclose(model.simulate(DRIVE), system.simulate(DRIVE), atol=1e-12)
    assert model.units == {"input": "V"}


def test_a_simulator_that_writes_itself_is_written(tmp_path, monkeypatch):
    class Model:
        def to_xml(self):
            return "<mujoco/>"

    monkeypatch.setattr("whsklearn.gap.report.render", lambda d: "")
    write_report(Diagnosis("no_gap", ""), tmp_path, Model())
    assert (tmp_path / "repaired.xml").read_text() == "<mujoco/>"
    assert not (tmp_path / "repaired.json").exists()
