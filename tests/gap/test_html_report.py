"""The page: the sentence first, markup of names shown and not run, silence explained."""

from __future__ import annotations

import pytest

from whsklearn.gap import Diagnosis
from whsklearn.gap.diagnosis import VERDICTS
from whsklearn.gap.html_report import COLOURS, SILENCE, render, significant


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
