"""The default of a stream: the last samples stay in memory, and are re-run while new ones arrive.

Why a memory: a recursion linearises every row once, at parameters that were poor when the row came, and a law with a
sign then never forgets it.  Re-running the samples at the present parameters costs a bounded number of passes over the
memory a row, and ends at the minimum that a batch fit finds (`benchmarks/accuracy.py`).

Mathematics: `cost` (squared errors of the samples in memory and their Gauss-Newton matrix), `gauss_newton` (one model
to its minimum), `starts` (where models begin), `refit` (which models continue), `linearised`, `sign_density`,
`sign_posterior` and `posterior` (what is known of the parameters, with the signs of dx that are in doubt).

Scheduling: `schedule` alone knows when a re-run begins, what it may cost a row, and when its result takes over.  Work
that is longer than a row is written as a generator (`steps`) that yields where the next row may interrupt it; what it
returns does not depend on where it was interrupted.  `multistart` puts both together as a stream.
"""
