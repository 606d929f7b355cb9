"""All records get the same columns behind the same filter, and only those that stand apart in every one."""

from __future__ import annotations

import numpy as np

from tests.compare.test_records import record
from whsklearn.compare.axis import LAW, axis_rows
from whsklearn.effects import Cogging


def test_one_record_that_needs_a_column_gives_it_to_all():
    rows = axis_rows([record(seed=1), record(Cogging(0.2, 12.0), seed=2)], ["a", "b"], 0.01, np.random.default_rng(0))
    assert rows[0].names == rows[1].names == ("inertia", *LAW, "cogging", "cogging", "delay")
    assert rows[0].step == rows[1].step
    assert rows[0].units == rows[1].units


def test_numbers_times_columns_are_the_drive():
    (rows,) = axis_rows([record(seed=1)], ["a"], 0.01, np.random.default_rng(0))
    fit, *_ = np.linalg.lstsq(rows.columns, rows.target, rcond=None)
    assert np.std(rows.target - rows.columns @ fit) < 0.05 * rows.scale
    assert all(fit[:3] > 0.0)
