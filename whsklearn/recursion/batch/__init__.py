"""A whole record at once: least squares of the free run, from a search over linear models.

`best_linear` fits the best linear approximation.  `simulation_search` divides its poles and zeros between two blocks,
refines the divisions by successive halving, and escapes from minima that a descent cannot leave.  `simulation_error`
is the descent, with exact sensitivities, of a whole record or block by block of a stream.  `axis_free_run` uses the
same criterion for a physical axis.
"""
