"""Functions written in another language give what they give in Python."""

from __future__ import annotations

import numpy as np
import pytest

from tests.export.small_functions import _curve, _early, _python
from whsklearn.export.languages import C, Symbol
from whsklearn.export.specialise import Specialiser


@pytest.mark.parametrize("x", [-2.0, 0.3, 0.7])
def test_known_numbers_are_worked_out_and_loops_unrolled(x):
    p, code = np.array([2.0, 3.0]), np.array([0, 1])
    work = Specialiser(C())
    result = work.call(_curve, p, code, Symbol("x"))
    assert _python(work, result, x=x) == _curve(p, code, x)
    assert "for" not in "".join(work.finish(result)[0])


def test_a_known_call_is_a_number():
    assert Specialiser(C()).call(_early, 3.0, 1.0) == (1.0, 1.0)


def test_what_cannot_be_written_is_refused():
    def endless(x):
        while x > 1.0:
            x = x / 2.0
        return x

    with pytest.raises(ValueError, match="cannot be exported"):
        Specialiser(C()).call(endless, Symbol("x"))
