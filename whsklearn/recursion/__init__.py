"""The mathematics of the estimators: compiled steps that take a state and return a state.

Only the function that runs many axes at once is public; everything else is reached through the estimators.
"""

from whsklearn.recursion.batched import least_squares_of_many

__all__ = ["least_squares_of_many"]
