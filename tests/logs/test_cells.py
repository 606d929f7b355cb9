"""Numbers in every spelling that spreadsheets have."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from whsklearn.logs.cells import is_number, is_plain, plain


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_what_a_program_writes_is_a_plain_number(value):
    assert is_plain(repr(value))
    assert is_number(repr(value))
    assert is_plain(repr(value).replace(".", ","), ",")


@pytest.mark.parametrize("cell", ["1,234.5", "0x1F", "1.5 Nm", "1.2D-3"])
def test_other_spellings_are_numbers(cell):
    assert is_number(cell)


@pytest.mark.parametrize("cell", ["off", "axis 3", "12:30", "1.2.3"])
def test_text_is_none(cell):
    assert not is_number(cell)
    assert not is_plain(cell)


def test_blanks_quotes_and_a_typographic_minus_go():
    assert plain(" '\u22121.5' ") == "-1.5"
