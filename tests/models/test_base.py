"""What all models share."""

from __future__ import annotations

import numpy as np
import pytest

from whsklearn.models.base import IdentifiedModel, as_input, numbered


def test_an_input_is_a_finite_contiguous_vector():
    given = np.arange(6.0).reshape(6, 1)[::2]
    assert as_input(given).flags.c_contiguous
    np.testing.assert_array_equal(as_input(given), [0.0, 2.0, 4.0])
    with pytest.raises(ValueError, match="NaN or infinity"):
        as_input([np.inf])


def test_coefficients_are_numbered_from_where_they_begin():
    assert numbered("f", np.array([0.5, 0.1]), 1) == {"f1": 0.5, "f2": 0.1}


@pytest.mark.parametrize(("name", "wrong"), [("dt", -1.0), ("dt", np.nan), ("logged", "speed")])
def test_what_cannot_be_is_refused(name, wrong):
    with pytest.raises(ValueError, match=f"{name} is"):
        IdentifiedModel(**{name: wrong})
