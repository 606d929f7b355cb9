"""Functions written in another language give what they give in Python."""

from __future__ import annotations

import math

import numpy as np
import pytest

from whsklearn.export.languages import C, StructuredText
from whsklearn.export.specialise import Specialiser
from whsklearn.export.statements import Memory, Symbol


def _curve(p, code, x):
    total = 0.0
    for i in range(p.size):
        if code[i] == 0:
            total += p[i] * x
        elif x > 0.5:
            total += p[i]
    return total


def _early(x, limit):
    if x > limit:
        return limit, 1.0
    if x < -limit:
        return -limit, -1.0
    return x, 0.0


def _counted(z, x):
    old = z[0]
    z[0] = old + x
    return old + z[0]


def _python(work, result, **values):
    """Run C code with the few statements that it has, as Python."""
    lines, _ = work.finish(result)
    text = "\n".join(lines).replace(";", "").replace("{", ":").replace("} else :", "else:")
    text = "\n".join(line for line in text.splitlines() if line.strip() != "}")
    names = dict(values)
    exec(text, {"fmin": min, "fmax": max}, names)
    return eval(work.text(result), {}, names)


@pytest.mark.parametrize("x", [-2.0, 0.3, 0.7])
def test_known_numbers_are_worked_out_and_loops_unrolled(x):
    p, code = np.array([2.0, 3.0]), np.array([0, 1])
    work = Specialiser(C())
    result = work.call(_curve, p, code, Symbol("x"))
    assert _python(work, result, x=x) == _curve(p, code, x)
    assert "for" not in "".join(work.finish(result)[0])


@pytest.mark.parametrize("x", [-2.0, 0.3, 2.0])
def test_early_returns_meet(x):
    work = Specialiser(C())
    a, b = work.call(_early, Symbol("x"), 1.0)
    assert (_python(work, a, x=x), _python(work, b, x=x)) == _early(x, 1.0)


def test_a_known_call_is_a_number():
    assert Specialiser(C()).call(_early, 3.0, 1.0) == (1.0, 1.0)


def test_the_state_is_read_before_it_is_written():
    work = Specialiser(C())
    result = work.call(_counted, Memory(lambda i: f"z{i}"), Symbol("x"))
    assert _python(work, result, z0=1.0, x=2.0) == 4.0


def test_what_nobody_needs_is_left_out():
    work = Specialiser(C())
    work.call(_early, Symbol("x"), 1.0)
    assert work.finish() == ([], {})


def test_what_cannot_be_written_is_refused():
    def endless(x):
        while x > 1.0:
            x = x / 2.0
        return x

    with pytest.raises(ValueError, match="cannot be exported"):
        Specialiser(C()).call(endless, Symbol("x"))


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
