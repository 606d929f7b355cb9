"""Shapes, numbers, experiments of a record."""

from __future__ import annotations

import numpy as np
import pytest

from whsklearn._inputs import check_lengths, check_whole, in_one_sentence, starts


def test_an_experiment_begins_where_the_label_changes():
    assert starts([1, 1, 2, 2, 1], 5, first=True).tolist() == [True, False, True, False, True]
    assert starts(None, 3, first=False).tolist() == [False] * 3
    assert starts(None, 3, first=True).tolist() == [True, False, False]
    assert starts(None, 0, first=True).size == 0


def test_a_stream_remembers_its_last_group():
    assert not starts(["a", "a"], 2, first=False, last="a").any()
    assert starts(["b", "b"], 2, first=False, last="a").tolist() == [True, False]
    assert starts([7], 1, first=False, last="7").tolist() == [False]


def test_groups_need_a_label_a_row():
    with pytest.raises(ValueError, match=r"groups has shape \(2,\), expected \(3,\)"):
        starts([1, 1], 3, first=True)


def test_lengths_and_sizes():
    check_lengths(np.ones((2, 1)), np.ones(2))
    with pytest.raises(ValueError, match="X has 2 rows and y has 3"):
        check_lengths(np.ones((2, 1)), np.ones(3))
    with pytest.raises(ValueError, match="y holds 1e"):
        check_lengths(np.ones((2, 1)), np.array([0.0, -1e31]))


def test_messages_become_one_sentence_and_others_stay():
    X = np.ones((5, 1))
    X[3] = np.nan
    with pytest.raises(
        ValueError, match=r"^X contains NaN, first in row 3, expected finite numbers; cut such samples out\.$"
    ):
        with in_one_sentence(X):
            raise ValueError("Input X contains NaN.\nDo this and that.")
    with pytest.raises(ValueError, match=r"^something else$"), in_one_sentence(X):
        raise ValueError("something else")
    with pytest.raises(TypeError), in_one_sentence(X):
        raise TypeError("not mine")


@pytest.mark.parametrize("value", [True, 0, 1.0, "2", None])
def test_what_is_no_whole_number_is_refused(value):
    with pytest.raises(ValueError, match=r"p is .*, expected a whole number of 1 or more, the innovation length\."):
        check_whole("p", value, 1, ", the innovation length")


def test_a_whole_number_of_numpy_s_is_one():
    check_whole("p", np.int64(1), 1)
