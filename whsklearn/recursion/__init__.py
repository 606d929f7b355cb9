"""Compiled steps, state in and state out: the mathematics of the estimators.

Public is what runs many axes at once; the estimators are the way to all the rest.
"""

from whsklearn.recursion.batched import least_squares_of_many

__all__ = ["least_squares_of_many"]
