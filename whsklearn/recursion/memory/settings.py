"""The settings that stay constant during a stream of the default method."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from whsklearn.recursion.rows.predictor import parameter_count

State = dict[str, Any]

# Samples of the first re-run, on which a stream tries all of its starts.  On 64 samples of Example 5.1 one start in 23
# ends in the right minimum, on 128 one in 6.  With 64, 12 of 5,000 streams were in a wrong minimum at row 1,000; with
# 128 none is (benchmarks/accuracy.py --section minima --first-seed 1000).
FIRST_RERUN = 128


@dataclass(frozen=True)
class Settings:
    """The settings that stay constant during a stream."""

    dims: NDArray[np.int64]  # (5,): n_a, n_b, n_c, n_d and the number of weights of the law
    codes: NDArray[np.int64]  # codes, shapes: terms of the law
    shapes: NDArray[np.float64]
    p: int  # innovation length
    p0: float  # initial variance of the parameters, relative to the noise variance
    forgetting: float  # final forgetting factor
    n_starts: int  # n_starts, memory: number of parallel starts; number of samples kept
    memory: int
    frozen: bool  # True for the block update of (7)-(9), False for sub-innovations
    seed: int  # seed of all random starts
    n_inputs: int = 1  # columns of u
    theta0: NDArray[np.float64] | None = None  # (n,): a given start, in addition to the random ones

    # computed once: a row needs them a dozen times, and a NumPy number takes ten times as long as a Python number
    @cached_property
    def size(self) -> int:
        """Number of parameters."""
        return int(parameter_count(self.dims))

    @cached_property
    def history(self) -> int:
        """Number of samples that must be known before a window."""
        return int(max(self.dims[0] // self.n_inputs, self.dims[3], 1))

    @cached_property
    def first_rerun(self) -> int:
        """Number of samples before the first re-run of the memory."""
        return min(max(FIRST_RERUN, 4 * self.size), self.memory)

    @cached_property
    def page_end(self) -> int:
        """Number of samples in memory at which a re-run page is turned: half a page after it was full."""
        return self.memory + max(self.memory // 2, 1)

    @cached_property
    def law(self) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float64]]:
        """dims, codes and shapes, in the form that the kernels take."""
        return self.dims, self.codes, self.shapes
