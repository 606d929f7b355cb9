"""Numbers in every spelling that spreadsheets have."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from whsklearn.logs.cells import as_numbers, is_number, is_plain, is_word, no_numbers, plain


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


@pytest.mark.parametrize("cell", ["-nan(ind)", "NaN(snan)", "***", "#WERT!", "--", "?", "N/A"])
def test_what_stands_for_no_value_is_neither_a_number_nor_a_word(cell):
    values = pd.Series(["1.5", cell])
    numbers, _, notes = as_numbers(values, ".")
    assert np.isnan(numbers[1])
    assert not no_numbers(values, numbers).any()
    assert (not is_word(cell), notes) == (True, [])


def test_points_part_thousands_in_all_cells_of_a_column_or_in_none():
    german = pd.Series(["999.999", "1.000.000", "12", "-1.234,5"])  # the first was 999.999 and the last 1,234.5
    assert as_numbers(german, ",")[0].tolist() == [999999.0, 1000000.0, 12.0, -1234.5]
    assert as_numbers(pd.Series(["999.999", "0.5"]), ",")[0].tolist() == [999.999, 0.5]


def test_an_exponent_of_fortran_is_no_unit():
    numbers, unit, _ = as_numbers(pd.Series(["1.2D-3", "-4.D+01"]), ".")
    assert (numbers.tolist(), unit) == ([1.2e-3, -40.0], "")


def test_blanks_quotes_and_a_typographic_minus_go():
    assert plain(" '\u22121.5' ") == "-1.5"
