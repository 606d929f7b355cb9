"""Numbers and operators of C and of Structured Text."""

from __future__ import annotations

import math

import pytest

from tests.export.small_functions import _counted, _early, _python
from whsklearn import ServoAxis
from whsklearn.effects import Cogging, Stribeck
from whsklearn.export import export_model
from whsklearn.export.languages import C, StateArray, StructuredText, Symbol
from whsklearn.export.specialise import Specialiser


@pytest.mark.parametrize("x", [-2.0, 0.3, 2.0])
def test_early_returns_meet(x):
    work = Specialiser(C())
    a, b = work.call(_early, Symbol("x"), 1.0)
    assert (_python(work, a, x=x), _python(work, b, x=x)) == _early(x, 1.0)


def test_the_state_is_read_before_it_is_written():
    work = Specialiser(C())
    result = work.call(_counted, StateArray(lambda i: f"z{i}"), Symbol("x"))
    assert _python(work, result, z0=1.0, x=2.0) == 4.0


def test_what_nobody_needs_is_left_out():
    work = Specialiser(C())
    work.call(_early, Symbol("x"), 1.0)
    assert work.finish() == ([], {})


def test_structured_text_is_balanced_and_names_what_it_uses(tmp_path):
    axis = ServoAxis(effects=[Cogging(0.1, 12.0), Stribeck(0.1)])
    text = export_model(axis, to="st", out=tmp_path).paths[0].read_text()
    body = text[text.index("FUNCTION_BLOCK model") :]
    assert body.count("IF ") == body.count("END_IF;") > 3
    assert "COS(" in body
    assert "EXP(" in body
    for word in ("&&", "==", "{", "fabs"):
        assert word not in body


@pytest.mark.parametrize("value", [0.1, -1e-9, 1.0, 1e22, math.pi])
def test_numbers_read_back(value):
    assert float(C().number(value).strip("()")) == value
    assert float(StructuredText().number(value).strip("()")) == value


def test_structured_text_writes_its_own_operators():
    work = Specialiser(StructuredText())
    a, _ = work.call(_early, Symbol("x"), 1.0)
    text = "\n".join(work.finish(a)[0])
    assert "IF (x > 1.0) THEN" in text
    assert ":=" in text
    assert text.count("IF (") == text.count("END_IF;")


def test_a_number_of_the_state_is_a_field_or_an_entry_of_one():
    assert [C().state("lag"), C().state("lag", 1)] == ["s->lag", "s->lag[1]"]
    assert [StructuredText().state("lag"), StructuredText().state("lag", 0)] == ["lag", "lag[0]"]
