"""The statements of the report that are cheap to compute, against what mathematics says of them."""

from __future__ import annotations

import re

import numpy as np
import pytest

from pipelines import _claims as claims
from pipelines.reproduce import in_markdown, in_terminal


def number(text: str) -> float:
    return float(re.search(r"[-+]?\d*\.?\d+(?:e[-+]?\d+)?", text)[0])


def test_rows_of_table_1_imply_two_variances():
    assert number(claims.table_is_one_record().here.removeprefix("a ratio of ")) == pytest.approx(10.5, rel=0.02)


def test_one_flipped_sign_costs_what_divides_the_rows():
    assert 2e-3 < number(claims.flipped_sign(0, trials=60).here) < 8e-3


def test_block_and_sub_innovations_agree_on_given_rows():
    assert number(claims.blocks_equal_sub_innovations(0, trials=5).here) < 1e-9


@pytest.mark.parametrize("p", [2, 5])
def test_overlapping_windows_shrink_the_variance_by_p(p):
    assert number(claims.windows_count_twice(0, p=p).here) == pytest.approx(p, rel=0.05)


def test_published_turntable_hardly_moves():
    assert number(claims.published_turntable().here) < 0.01


def test_second_block_is_the_systems_own():
    system = claims.WienerHammersteinSystem.example()
    s = system.signals(np.random.default_rng(0).normal(size=200))
    np.testing.assert_allclose(claims._second_block(system, s.v), s.y, atol=1e-12)


def test_rows_from_true_signals_are_those_of_6():
    _, y, truth = claims.make_wiener_hammerstein(300, None, 0, return_truth=True)
    np.testing.assert_allclose(claims._true_rows(truth, y)[3:] @ truth.theta, y[3:], atol=1e-10)


def test_report_fits_the_terminal_and_the_page():
    found = [claims.Claim("A title", "words " * 40, "figures " * 30, "meaning " * 40)]
    rows = [["RMILS, default", 0.01, 0.001, 0.02, None]]
    assert max(map(len, in_terminal(rows, found).splitlines())) <= 100
    assert "| RMILS, default | 0.01 | 0.001 | 0.02 | - |" in in_markdown(rows, found, 0, 5, 12)
