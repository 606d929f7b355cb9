"""What is encoded comes back the same, and nothing else is let in."""

from __future__ import annotations

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from whsklearn.effects import Cogging
from whsklearn.state.encoding import decode, encode

keys = st.text(min_size=1, max_size=4).filter(lambda key: key != "$")  # which marks what is no plain value
plain = st.recursive(
    st.none() | st.booleans() | st.integers(-(2**53), 2**53) | st.floats(allow_nan=False) | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(keys, inner, max_size=3),
    max_leaves=8,
)


def back(value):
    arrays = []
    text = json.dumps(encode(value, arrays))
    return decode(json.loads(text), arrays)


@given(plain)
def test_plain_values_come_back(value):
    assert back(value) == value


@pytest.mark.parametrize("dtype", [np.float64, np.int64, np.bool_, np.float32])
@pytest.mark.parametrize("shape", [(), (0,), (3,), (2, 3)])
def test_arrays_keep_dtype_and_shape(dtype, shape):
    array = np.ones(shape, dtype=dtype)
    again = back({"x": array})["x"]
    assert (again.dtype, again.shape) == (array.dtype, array.shape)
    np.testing.assert_array_equal(again, array)


def test_a_generator_goes_on_where_it_stood():
    rng = np.random.default_rng(3)
    rng.normal(size=7)
    again = back(rng)
    np.testing.assert_array_equal(again.normal(size=5), rng.normal(size=5))


def test_an_effect_comes_back_as_itself():
    assert back(Cogging(0.1, 12.0, 0.3)) == Cogging(0.1, 12.0, 0.3)


def test_code_and_objects_are_refused_by_place():
    for bad in (lambda: 0, object(), np.array([object()])):
        with pytest.raises(ValueError, match=r"value\.x"):
            encode({"x": bad}, [])
