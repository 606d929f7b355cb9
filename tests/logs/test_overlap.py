"""The same samples are found whatever the file is called, and another run of the same reference is another record."""

from __future__ import annotations

import numpy as np
import pytest

from whsklearn.logs.overlap import RUN, shared_run

T = np.arange(8000) / 500
REFERENCE = np.sin(2 * T) + 0.3 * np.sin(7 * T)


def record(seed, noise=1e-3, step=0.0, reference=REFERENCE):
    rng = np.random.default_rng(seed)
    u, q = (x + noise * rng.standard_normal(T.size) for x in (np.gradient(reference, T), reference))
    return np.column_stack([u, step * np.round(q / step) if step else q])


A, B = record(0), record(1)


@pytest.mark.parametrize(
    ("second", "expected"),
    [
        (A, (0, 0, T.size)),
        (A[1234:3000], (1234, 0, 1766)),
        (np.vstack([B[:777], A[:500]]), (0, 777, 500)),
        (np.vstack([A[-700:], B[:2000]]), (T.size - 700, 0, 700)),
        (np.round(A, 5), (0, 0, T.size)),  # printed with fewer digits
    ],
)
def test_samples_of_the_other_record_are_found(second, expected):
    assert shared_run(A, second) == expected


@pytest.mark.parametrize("units", [(1e3, 180 / np.pi), (1e-3, 1e3)])
def test_other_units_make_no_other_record(units):
    printed = np.round(A * units, 6)
    assert shared_run(A, printed / units) == (0, 0, T.size)


@pytest.mark.parametrize("noise", [1e-2, 1e-3, 1e-4])
@pytest.mark.parametrize("step", [0.0, 2 * np.pi / 4096])
def test_another_run_of_the_same_reference_is_another_record(noise, step):
    assert shared_run(record(0, noise, step), record(1, noise, step)) is None


def test_an_axis_at_rest_is_the_same_in_every_record():
    rest = np.zeros((1000, 2))
    rest[:, 1] = 0.25
    assert shared_run(np.vstack([rest, A]), np.vstack([rest, B])) is None
    assert shared_run(rest, rest) is None


def test_a_shared_piece_shorter_than_a_run_says_nothing():
    joined = np.vstack([B[:3000], A[100 : 100 + RUN - 1], B[4000:]])
    assert shared_run(A, joined) is None
    assert shared_run(A[: RUN - 1], A) is None
