"""Real numbers from whatever a user gives, or a sentence on why not."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray


def real_array(values: Any, name: str) -> NDArray[np.float64]:
    """A float array of any shape; complex numbers, dates and text are refused, not converted.

    Raises
    ------
    ValueError
        If ``values`` are no real numbers or rows have different lengths.
    """
    try:
        array = np.asarray(values)
        if array.dtype.kind == "O":
            array = array.astype(np.float64)
    except (TypeError, ValueError):
        array = np.array("")
    if array.dtype.kind not in "biuf":
        raise ValueError(f"{name} holds values that are no numbers; expected real numbers, rows of one length.")
    return array.astype(np.float64, copy=False)
