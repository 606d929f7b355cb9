"""The mathematics of the estimators: compiled steps that take a state and return a state.

Three ways from rows to parameters, each in a folder of its own:

``rows``
    One row at a time: RLS, MILS and RMILS, the factorised covariance, the predictor and its gradient.
``memory``
    The default for a stream: the last samples are kept and re-run from several starts while new rows arrive.
``batch``
    A whole record at once: a search over linear models gives the starts, and Gauss-Newton minimises the free-run error.

Where to find each equation of the paper:

================  =======================================================================================
(1), (2)          `rows.predictor`, sample by sample; `memory.blocks`, x along a record
(3), (4)          `whsklearn.effects.equations`, the terms of a law
(6)               `rows.pseudolinear`
(7) to (9)        `rows.least_squares.block_update`, to the letter; elsewhere as p updates of one row each
(10) to (14)      `rows.least_squares.run_rows` on given rows, `rows.subinnovations` with the exact gradient,
                  `rows.pseudolinear` as published; (12) is `rows.covariance.measurement_update`
================  =======================================================================================

Only the function that runs many axes at once is public; everything else is used through the estimators.
"""

from whsklearn.recursion.rows.batched import least_squares_of_many

__all__ = ["least_squares_of_many"]
