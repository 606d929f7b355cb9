"""The settings that stay constant along a stream of the default method."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

from whsklearn.recursion.predictor import parameter_count

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

State = dict[str, Any]

# Samples of the first re-run, on which a stream tries all of its starts: on 64 samples of Example 5.1 one start in 23
# ends in the right minimum, on 128 one in 6, and 12 of 5,000 streams stood in a wrong one at row 1,000 where now none
# does (benchmarks/accuracy.py --section minima --first-seed 1000).
FIRST_RERUN = 128


@dataclass(frozen=True)
class Reading:
    """The settings that stay constant along a stream.

    Parameters
    ----------
    dims : ndarray of shape (5,)
        n_a, n_b, n_c, n_d and the number of weights of the law.
    codes, shapes : ndarrays
        The law's terms.
    p : int
        Innovation length.
    p0 : float
        Initial variance of the parameters, relative to the noise variance.
    forgetting : float
        Final forgetting factor.
    n_starts, memory : int
        Starts side by side; samples kept.
    frozen : bool
        True for the block update of (7)-(9), False for sub-innovations.
    seed : int
        Seed of all random starts.
    n_inputs : int
        Columns of u.
    theta0 : ndarray of shape (n,), optional
        One start that is not random.
    """

    dims: NDArray[np.int64]
    codes: NDArray[np.int64]
    shapes: NDArray[np.float64]
    p: int
    p0: float
    forgetting: float
    n_starts: int
    memory: int
    frozen: bool
    seed: int
    n_inputs: int = 1
    theta0: NDArray[np.float64] | None = None

    # worked out once: a row asks for them a dozen times, and a number of NumPy's takes ten times as long as Python's
    @cached_property
    def size(self) -> int:
        """Number of parameters."""
        return int(parameter_count(self.dims))

    @cached_property
    def history(self) -> int:
        """Samples that must be known before a window."""
        return int(max(self.dims[0] // self.n_inputs, self.dims[3], 1))

    @cached_property
    def first_rerun(self) -> int:
        """Samples before the first re-run of the memory."""
        return min(max(FIRST_RERUN, 4 * self.size), self.memory)

    @cached_property
    def page_end(self) -> int:
        """Samples in memory at which a re-run page is turned: half a page after it was full."""
        return self.memory + max(self.memory // 2, 1)

    @cached_property
    def law(self) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float64]]:
        """Dims, codes and shapes, as the kernels take them."""
        return self.dims, self.codes, self.shapes
