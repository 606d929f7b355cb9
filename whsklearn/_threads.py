"""Linear algebra on one thread, for searches over narrow matrices."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import ParamSpec, TypeVar

from threadpoolctl import threadpool_limits

P = ParamSpec("P")
R = TypeVar("R")


def one_blas_thread(function: Callable[P, R]) -> Callable[P, R]:
    """The function, during which BLAS keeps to one thread.

    On matrices of some ten columns a second thread takes two to three times the CPU and ends no sooner, later where
    another process works; and it sums in another order, so that a search ends in other digits on another machine.
    """

    @functools.wraps(function)
    def call(*args: P.args, **kwargs: P.kwargs) -> R:
        # looked up at each call, which takes 3 ms: libraries that are loaded later have threads of their own
        with threadpool_limits(1, user_api="blas"):
            return function(*args, **kwargs)

    return call
