"""The mathematics of the estimators: compiled steps that take a state and return a state.

Public is what runs many axes at once; the estimators are the way to all the rest.
"""

from whsklearn.recursion.batched import least_squares_of_many

__all__ = ["least_squares_of_many"]
