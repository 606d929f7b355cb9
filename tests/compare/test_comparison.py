"""Words and files say what the numbers say."""

from __future__ import annotations

import pytest

from whsklearn.compare import Change, Comparison
from whsklearn.compare.comparison import spoken
from whsklearn.compare.report import render


@pytest.mark.parametrize(
    ("before", "after", "word"),
    [(1.0, 1.3, "rose 30 %"), (1.0, 0.5, "fell 50 %"), (0.01, 0.5, "came"), (0.5, 0.01, "went"), (-1.0, 1.0, "sign")],
)
def test_how_it_moved(before, after, word):
    assert word in str(Change("coulomb", before, after, 0.02, 10.0, "Nm", 1e-4, [], 0.1))


def test_rivals_and_a_turn_are_told():
    change = Change("gravity_imbalance", 1.0, 1.2, 0.02, 10.0, "Nm", 1e-4, ["gain"], 0.1, (0.5, 0.01), ("a", "b"))
    text = str(change)
    assert text.endswith("between a and b, or gain")
    assert "turned by 28.6 ± 0.57 deg" in text
    assert change.as_dict()["between"] == ["a", "b"]


def test_a_joint_is_spelled_as_in_the_robots_file():
    name = "input_offset at wrist_2_joint"
    change = Change(name, 0.0, 0.2, 0.02, 10.0, "Nm", 1e-4, ["cable_spring at wrist_1_joint"], 0.1)
    assert str(change).startswith("input offset at wrist_2_joint came")
    assert str(change).endswith("or cable spring at wrist_1_joint")
    assert spoken({"name": name}) == "input offset at wrist_2_joint"
    page = render(Comparison("moved", "", ["a", "b"], [change], {name: 0.1}))
    assert "wrist 2" not in page


def test_what_is_said_of_the_size_is_the_interval_of_the_file():
    change = Change("coulomb", 0.05, 0.08, 0.002, 10.0, "Nm", 1e-4, [], 0.1)
    low, high = change.interval
    assert f"difference {low:.3g} to {high:.3g} with 95 %" in str(change)
    assert str(Change("mass at wrist", 0.0, 0.5, 0.01, 10.0, "kg", 1e-4, [], 0.1)).endswith("kg with 95 %)")


def test_an_interval_shows_digits_until_its_ends_differ():
    """A payload known to a gram was printed as 2.8 to 2.8 kg."""
    assert "(2.7998 to 2.8002 kg with 95 %)" in str(Change("mass at wrist", 0.0, 2.8, 1e-4, 10.0, "kg", 1e-9, [], 0.1))


def test_the_file_has_the_fields_of_the_contract():
    change = Change("coulomb", 0.05, 0.08, 0.002, 10.0, "Nm", 1e-4, ["viscous"], 0.1)
    data = Comparison("moved", "", ["a", "b"], [change], {"coulomb": 0.01}).as_dict()
    assert set(data) >= {"verdict", "changes", "smallest_seen", "reason"}
    fields = {"name", "from", "to", "change", "standard_error", "unit", "p_value", "rivals"}
    assert set(data["changes"][0]) >= fields
    assert data["changes"][0]["change"] == pytest.approx(0.03)
