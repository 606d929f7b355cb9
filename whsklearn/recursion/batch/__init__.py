"""A whole record at once: least squares of the free run, from a search over linear models.

`best_linear` fits the best linear approximation, `block_split` divides its poles and zeros between two blocks,
`simulation_search` refines the divisions by successive halving with `simulation_error`, whose sensitivities are exact;
`block_split` and `missing_dynamics` escape from minima that a descent cannot leave.
`axis_free_run` uses the same criterion for a physical axis, and `block_update` carries the sum of squares of a stream
from block to block.
"""
