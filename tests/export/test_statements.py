"""Statements that were gathered: in their order, met after early returns, and none that nobody needs."""

from __future__ import annotations

import pytest

from tests.export.small_functions import _counted, _early, _python
from whsklearn.export.languages import C
from whsklearn.export.specialise import Specialiser
from whsklearn.export.statements import StateArray, Symbol


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
