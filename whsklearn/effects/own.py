"""User-defined effects, compiled: functions of a record's signals that kernels call by address."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numba
import numpy as np
from numba import types
from numba.core.errors import NumbaError

from whsklearn._numba import njit
from whsklearn.effects.codes import N_NUMBERS

_settings: Any = numba.config  # its attributes are created at run time
WHICH = N_NUMBERS - 1  # the entry of a row that selects its function
SIGNATURE = types.float64(
    types.int64, types.float64[::1], types.float64, types.float64, types.float64, types.float64
)  # index, numbers, time, position, velocity, drive


@lru_cache(maxsize=128)
def compiled(cls: Any) -> Any:
    """The compiled ``evaluate`` of a subclass of `Effect`, to be called by Numba.

    Raises ValueError if the class has none, or if it is not written with numbers and the math module only.
    """
    if cls.evaluate is None:
        raise ValueError(
            f"{cls.__name__} cannot be simulated; give it a static method evaluate(p, time, position, velocity, drive)."
        )
    if _settings.DISABLE_JIT:
        return cls.evaluate
    function = numba.njit(cls.evaluate, error_model="numpy")
    try:
        function.compile(SIGNATURE.args[1:])
    except NumbaError as error:
        raise ValueError(
            f"{cls.__name__}.evaluate cannot be compiled; write it with numbers and the math module only. ({error})"
        ) from error
    return function


@lru_cache(maxsize=128)
def address_of(classes: tuple[Any, ...]) -> Any:
    """One function for several classes; None for no class.

    It is called as ``f(which, p, time, position, velocity, drive)``. Its type does not depend on what it calls, so no
    kernel is compiled again for another class. For None a kernel leaves its calls out. Numba finds out the type of such
    a function in Python at every call of a kernel, which was a quarter of the diagnosis of a chain.
    """
    if not classes:
        return None
    function = _dispatched(tuple(compiled(c) for c in classes))
    if _settings.DISABLE_JIT:
        return function
    return numba.cfunc(SIGNATURE, error_model="numpy")(function)


def _dispatched(functions: tuple[Any, ...]) -> Any:
    """A function that calls the ``which``-th of several."""
    first = functions[0]
    if len(functions) == 1:

        def only(_which, p, time, position, velocity, drive):
            return first(p, time, position, velocity, drive)

        return only
    rest = numba.njit(_dispatched(functions[1:]), error_model="numpy")

    def either(which, p, time, position, velocity, drive):
        if which == 0:
            return first(p, time, position, velocity, drive)
        return rest(which - 1, p, time, position, velocity, drive)

    return either


@njit(nogil=True, error_model="numpy")
def own_values_along(function, p, time, position, velocity, drive):
    """A user-defined effect along a record; ``p`` of shape (n_numbers,), every signal of shape (n,)."""
    out = np.empty(position.size)
    for k in range(position.size):
        out[k] = function(0, p, time[k], position[k], velocity[k], drive[k])
    return out
